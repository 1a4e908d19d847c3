"""``mapmeld merge A B ... -o OUT.yaml``."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mapmeld.cli.errors import NO_MATCH, say
from mapmeld.cli.options import (
    DEFAULT_METHOD,
    Candidates,
    Cluster,
    Force,
    Fusion,
    Json,
    KnownPoses,
    Method,
    NoMatch,
    ParamsFile,
    Resolution,
    Settings,
    Solver,
    SolverChoice,
    Store,
    Strategy,
    Workers,
    WriteMode,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mapmeld.grid import OccupancyGrid
    from mapmeld.merging import MergeResult
    from mapmeld.report import Picture


def merge(
    maps: Annotated[
        list[str], typer.Argument(metavar="MAP", help="Two or more maps; the first gives the frame.")
    ],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="YAML", help="The merged map to write.")],
    fusion: Annotated[
        Fusion, typer.Option(help="What a cell becomes that several maps know.")
    ] = Fusion.COLOUR,
    mode: Annotated[
        WriteMode, typer.Option(help="trinary: free, occupied, unknown; scale and raw keep percentages.")
    ] = WriteMode.TRINARY,
    partial: Annotated[
        bool,
        typer.Option("--partial", help="Write what could be joined to the first map, even if it is not all."),
    ] = False,
    overlay: Annotated[
        Path | None,
        typer.Option(metavar="PNG", help="Also draw the maps over one another, in colours."),
    ] = None,
    strategy: Annotated[
        Strategy,
        typer.Option(
            help="graph: all pairs, false matches found by contradiction; sequential: one after the other, "
            "as in the paper."
        ),
    ] = Strategy.GRAPH,
    known_poses: KnownPoses = None,
    no_match: NoMatch = False,
    solver: SolverChoice = Solver.OWN,
    workers: Workers = 1,
    cluster: Cluster = None,
    store: Store = None,
    candidates: Candidates = None,
    force: Force = False,
    json: Json = False,
    method: Method = DEFAULT_METHOD,
    params: ParamsFile = None,
    settings: Settings = None,
    resolution: Resolution = None,
) -> None:
    """Match maps, merge those that fit, and write the merged map.

    If some map cannot be joined, says why, writes nothing (but see --partial) and exits with 1.
    """
    from mapmeld.cli.many_maps import known_for, note_doubtful_poses, progress_of
    from mapmeld.cli.maps import load_maps, names_of
    from mapmeld.cli.parameters import effective_parameters
    from mapmeld.cli.progress import working
    from mapmeld.merging import merge as merge_maps

    if len(maps) < 2:
        raise typer.BadParameter("two maps or more are needed", param_hint="MAP")
    _check_outputs(out, mode, overlay, force)
    _note_repeated(maps)
    parameters = effective_parameters(method, params, settings)
    known, matching = known_for(maps, known_poses, no_match)
    started = time.perf_counter()
    with working(f"Reading {len(maps)} maps"):
        grids = load_maps(maps, resolution)
    with progress_of(len(maps), strategy, matching, candidates) as on_pair:
        result = merge_maps(
            grids,
            method=method,
            parameters=parameters,
            fusion=fusion,
            strategy=strategy.value,
            known_poses=known,
            matching=matching,
            solver=solver.value,
            workers=0 if workers == 1 else workers,
            cluster=cluster,
            store=store,
            candidates=candidates,
            on_pair=on_pair,
        )
    seconds = time.perf_counter() - started
    files: tuple[Path, ...] = ()
    if result.complete or (partial and len(result.components[0]) > 1):
        with working("Writing"):
            files = _write(result, grids, names_of(maps), out, mode, overlay, force)

    if json:
        from mapmeld.cli.json_output import as_json, merge_fields

        typer.echo(as_json(merge_fields(result, method, parameters, fusion, maps, files, seconds)))
    else:
        from mapmeld.cli.tables import print_files, print_lines, print_merge

        print_merge(result, names_of(maps))
        if files:
            print_files(files)
        else:
            joined = len(result.components[0])
            hint = f" --partial writes the {joined} maps that were joined." if joined > 1 else ""
            print_lines("", f"Nothing written.{hint}")
    note_doubtful_poses(known, result.pairs, grids, names_of(maps))
    if files and mode is WriteMode.TRINARY and fusion in (Fusion.LOG_ODDS, Fusion.AVERAGE):
        say(f"note: {out} keeps only free, occupied and unknown; --mode scale keeps the percentages")
    if not result.complete:
        raise typer.Exit(NO_MATCH)


def _note_repeated(maps: Sequence[str]) -> None:
    """Say of every map that was given more than once that it counts as often."""
    from mapmeld.cli.maps import same_map

    numbers: dict[str, list[int]] = {}
    for number, path in enumerate(maps, start=1):
        numbers.setdefault(same_map(path), []).append(number)
    for same in numbers.values():
        if len(same) > 1:
            times = "twice" if len(same) == 2 else f"{len(same)} times"
            which = ", ".join(map(str, same[:-1]))
            say(
                f"note: maps {which} and {same[-1]} are the same file, {maps[same[0] - 1]}; it counts {times}"
            )


def _check_outputs(out: Path, mode: WriteMode, overlay: Path | None, force: bool) -> None:
    """Find out before the work that its outcome could not be written."""
    from mapmeld.io import MapFileError
    from mapmeld.io.atomic import check_targets

    if out.suffix.lower() not in (".yaml", ".yml"):
        raise MapFileError.of(
            out, "a map is written as a .yaml file with an image beside it; end it in .yaml"
        )
    image = out.with_suffix(".png" if mode is WriteMode.SCALE else ".pgm")
    check_targets([out, image], force=force)
    if overlay is not None:
        from mapmeld.report import check_picture_path

        check_picture_path(overlay, force=force)
        if overlay.absolute() == image.absolute():
            raise MapFileError.of(overlay, "is the image of the merged map; give the overlay another name")


def _write(
    result: MergeResult,
    grids: Sequence[OccupancyGrid],
    names: Sequence[str],
    out: Path,
    mode: WriteMode,
    overlay: Path | None,
    force: bool,
) -> tuple[Path, ...]:
    from mapmeld.io import save

    picture = None if overlay is None else _overlay(result, grids, names)
    files = save(result.grid, out, mode=mode.value, force=force)
    if overlay is not None and picture is not None:
        from mapmeld.report import write_picture

        files += (write_picture(picture, overlay, force=force),)
    return files


def _overlay(result: MergeResult, grids: Sequence[OccupancyGrid], names: Sequence[str]) -> Picture:
    from mapmeld.report import overlay

    joined = sum(pose is not None for pose in result.poses)
    return overlay(grids, result.poses, names, f"{joined} maps in the frame of {names[0]}.")
