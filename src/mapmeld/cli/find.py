"""``mapmeld find MAP --in INDEX``."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from mapmeld.cli.errors import NO_MATCH, say
from mapmeld.cli.options import DEFAULT_METHOD, Json, Method, ParamsFile, Resolution, Settings


def find(
    map_: Annotated[
        str,
        typer.Argument(
            metavar="MAP", help="The map whose place is looked for, in any form that `match` takes."
        ),
    ],
    index: Annotated[Path, typer.Option("--in", metavar="INDEX", help="What `mapmeld index` has written.")],
    top: Annotated[
        int,
        typer.Option(
            "--top", metavar="K", min=1, help="How many maps that look like it are matched with it."
        ),
    ] = 10,
    candidates_only: Annotated[
        bool, typer.Option("--candidates-only", help="Rank by looks; match nothing.")
    ] = False,
    json: Json = False,
    method: Method = DEFAULT_METHOD,
    params: ParamsFile = None,
    settings: Settings = None,
    resolution: Resolution = None,
) -> None:
    """Find which maps of an index show the same place as a map, and where.

    The exit code is 0 if a match is accepted (with --candidates-only: if any map looks like it), else 1.
    """
    from mapmeld.cli.maps import load_maps, same_map
    from mapmeld.cli.parameters import effective_parameters
    from mapmeld.cli.progress import counting, working
    from mapmeld.errors import MapmeldError
    from mapmeld.index import candidates_for, read_index, signature_of
    from mapmeld.index import find as find_maps
    from mapmeld.matching import Verdict

    parameters = effective_parameters(method, params, settings)
    started = time.perf_counter()
    with working("Reading the index"):
        (grid,) = load_maps([map_], resolution)
        maps = read_index(index, signature_of(grid))
    own = Path(same_map(map_))
    if candidates_only:
        found = candidates_for(grid, maps, top, own)
    else:
        with counting("Matching", min(top, len(maps.maps))) as step:
            found = find_maps(grid, maps, top, own, method=method, parameters=parameters, on_candidate=step)
    seconds = time.perf_counter() - started
    if json:
        from mapmeld.cli.json_output import as_json, find_fields

        typer.echo(as_json(find_fields(found, maps, method, parameters, [map_, str(index)], seconds)))
    else:
        from mapmeld.cli.tables import print_found

        print_found(found, maps, map_)
    gone = [candidate for candidate in found if candidate.problem]
    for candidate in gone:
        say(f"note: {candidate.problem}")
    if gone:
        say(f"note: {index} is out of date, or not where it was made; run 'mapmeld index' again")
    if found and len(gone) == len(found):
        raise MapmeldError(f"{index}: no map that looks like {map_} could be read")
    accepted = any(c.result is not None and c.result.verdict is Verdict.ACCEPTED for c in found)
    if not (found if candidates_only else accepted):
        raise typer.Exit(NO_MATCH)
