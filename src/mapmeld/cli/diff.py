"""``mapmeld diff OLD NEW -o DIR``."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mapmeld.cli.errors import NO_MATCH
from mapmeld.cli.options import (
    DEFAULT_METHOD,
    FolderOut,
    Force,
    Json,
    Method,
    New,
    Old,
    ParamsFile,
    Resolution,
    Settings,
    Transform,
)

if TYPE_CHECKING:
    from mapmeld.changes import MapDiff

# updated.png holds the percentages of maps that have any.
OURS = (
    "changes.png",
    "changes.geojson",
    "changes.yaml",
    "changes.pgm",
    "updated.yaml",
    "updated.pgm",
    "updated.png",
)


def diff(
    old: Old,
    new: New,
    out: FolderOut,
    tolerance: Annotated[
        float,
        typer.Option(
            metavar="METRES",
            min=0,
            max=100,
            help="An obstacle this near to one of the other map is that one.",
        ),
    ] = 0.2,
    max_bend: Annotated[
        float,
        typer.Option(
            metavar="METRES",
            min=0,
            max=100,
            help="How far NEW may be bent locally onto OLD; 0 takes it as it is.",
        ),
    ] = 0.5,
    min_area: Annotated[
        float,
        typer.Option(metavar="M2", min=0, max=1e6, help="Changes of less area are speckle and left out."),
    ] = 0.0075,
    transform: Transform = None,
    force: Force = False,
    json: Json = False,
    method: Method = DEFAULT_METHOD,
    params: ParamsFile = None,
    settings: Settings = None,
    resolution: Resolution = None,
) -> None:
    """Find what changed between an earlier and a later map: a picture, maps, and a list of the changes.

    NEW is laid on OLD and bent onto it a little, so that drift is no change. If the maps do not match, says
    why, writes nothing and exits with 1.
    """
    from mapmeld.changes import NoMatchError
    from mapmeld.changes import diff as diff_maps
    from mapmeld.cli.json_output import as_json, diff_fields
    from mapmeld.cli.maps import load_maps, names_of
    from mapmeld.cli.parameters import effective_parameters
    from mapmeld.cli.placement import given_transform, note_if_unlikely, refuse
    from mapmeld.cli.progress import working
    from mapmeld.cli.tables import print_files, print_lines
    from mapmeld.io.folders import check_folder

    check_folder(out, force=force)
    parameters = effective_parameters(method, params, settings)
    given = None if transform is None else given_transform(transform, old, new)
    started = time.perf_counter()
    with working("Comparing"):
        grid_old, grid_new = load_maps([old, new], resolution)
        if transform is not None and given is not None:
            note_if_unlikely(f"--transform {transform}", given, grid_old, grid_new, names_of([old, new]))
        try:
            found = diff_maps(
                grid_old,
                grid_new,
                T_old_new=given,
                method=method,
                parameters=parameters,
                tolerance=tolerance,
                max_bend=max_bend,
                min_area=min_area,
            )
        except NoMatchError as error:
            if not json:
                refuse(str(error))
            seconds = time.perf_counter() - started
            typer.echo(as_json(diff_fields(None, error.match, parameters, [old, new], [], seconds)))
            raise typer.Exit(NO_MATCH) from None
        files = _write(found, [old, new], out, force)
    if json:
        seconds = time.perf_counter() - started
        typer.echo(as_json(diff_fields(found, found.match, parameters, [old, new], files, seconds)))
    else:
        print_lines(found.summary)
        print_files(files)


def _write(found: MapDiff, paths: list[str], out: Path, force: bool) -> list[Path]:
    from mapmeld.changes.geojson import changes_geojson, geojson_text
    from mapmeld.cli.maps import exact_mode, names_of
    from mapmeld.io import save
    from mapmeld.io.atomic import write_files
    from mapmeld.io.folders import whole_folder
    from mapmeld.report import changes, write_picture

    name_old, name_new = names_of(paths)
    updated = found.updated()
    with whole_folder(out, force=force, ours=OURS) as folder:
        numbers = (
            " Numbers are those in changes.geojson; a paler hem makes a change seen." if found.regions else ""
        )
        picture = changes(found, f"From {name_old} to {name_new}: {found.summary}.{numbers}")
        text = geojson_text(changes_geojson(found, name_old))
        files = [
            write_picture(picture, folder / "changes.png"),
            *save(found.as_map(), folder / "changes.yaml", mode="raw"),
            *save(updated, folder / "updated.yaml", mode=exact_mode(updated)),
            folder / "changes.geojson",
        ]
        write_files([(files[-1], (text.encode(),))])
        return [out / file.name for file in files]
