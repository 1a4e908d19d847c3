"""``mapmeld graph A B ...``."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from mapmeld.cli.errors import NO_MATCH
from mapmeld.cli.options import (
    DEFAULT_METHOD,
    Candidates,
    Cluster,
    Force,
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
)


def graph(
    maps: Annotated[list[str], typer.Argument(metavar="MAP", help="Two or more maps.")],
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", metavar="FILE", help="Write the graph: .json (docs/json.md) or .g2o."),
    ] = None,
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
    """Match every map with every other, find false matches, and say where all maps lie.

    Maps that cannot be joined stay apart; then the exit code is 1, and the graph is written all the same.
    """
    from mapmeld.cli.json_output import as_json, graph_fields
    from mapmeld.cli.many_maps import known_for, note_doubtful_poses, progress_of
    from mapmeld.cli.maps import load_maps, names_of
    from mapmeld.cli.parameters import effective_parameters
    from mapmeld.cli.progress import working
    from mapmeld.io.atomic import write_files
    from mapmeld.merging.by_graph import map_graph
    from mapmeld.merging.graph import as_g2o

    if len(maps) < 2:
        raise typer.BadParameter("two maps or more are needed", param_hint="MAP")
    _check_out(out, force)
    parameters = effective_parameters(method, params, settings)
    known, matching = known_for(maps, known_poses, no_match)
    started = time.perf_counter()
    with working(f"Reading {len(maps)} maps"):
        grids = load_maps(maps, resolution)
    with progress_of(len(maps), Strategy.GRAPH, matching, candidates) as on_pair:
        found = map_graph(
            grids,
            method=method,
            parameters=parameters,
            known_poses=known,
            matching=matching,
            solver=solver.value,
            workers=0 if workers == 1 else workers,
            cluster=cluster,
            store=store,
            candidates=candidates,
            on_pair=on_pair,
        )
    fields = graph_fields(found, method, parameters, maps, time.perf_counter() - started)
    if out is not None:
        text = as_json(fields) + "\n" if out.suffix.lower() == ".json" else as_g2o(found, maps)
        write_files([(out, [text.encode()])], force=force)
    if json:
        typer.echo(as_json(fields))
    else:
        from mapmeld.cli.tables import print_files, print_graph

        print_graph(found, names_of(maps))
        if out is not None:
            print_files([out])
    note_doubtful_poses(known, found.pairs, grids, names_of(maps))
    if len(found.components) > 1:
        raise typer.Exit(NO_MATCH)


def _check_out(out: Path | None, force: bool) -> None:
    from mapmeld.io import MapFileError
    from mapmeld.io.atomic import check_targets

    if out is None:
        return
    if out.suffix.lower() not in (".json", ".g2o"):
        raise MapFileError.of(out, "a graph is written as a .json or a .g2o file; end it in one of these")
    check_targets([out], force=force)
