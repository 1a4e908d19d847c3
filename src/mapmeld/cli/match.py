"""``mapmeld match A B``."""

from __future__ import annotations

import typer

from mapmeld.cli.errors import NO_MATCH
from mapmeld.cli.options import DEFAULT_METHOD, Json, MapA, MapB, Method, ParamsFile, Resolution, Settings


def match(
    a: MapA,
    b: MapB,
    json: Json = False,
    method: Method = DEFAULT_METHOD,
    params: ParamsFile = None,
    settings: Settings = None,
    resolution: Resolution = None,
) -> None:
    """Find how map B fits on map A and say how sure that is."""
    from mapmeld.cli.maps import load_maps
    from mapmeld.cli.parameters import effective_parameters
    from mapmeld.cli.progress import working
    from mapmeld.matching import Verdict
    from mapmeld.matching import match as match_maps

    parameters = effective_parameters(method, params, settings)
    with working("Matching"):
        grid_a, grid_b = load_maps([a, b], resolution)
        result = match_maps(grid_a, grid_b, method, parameters)
    if json:
        from mapmeld.cli.json_output import as_json, match_fields

        typer.echo(as_json(match_fields(result, parameters, [a, b])))
    else:
        from mapmeld.cli.tables import print_match

        print_match(result, [a, b])
    if result.verdict is not Verdict.ACCEPTED:
        raise typer.Exit(NO_MATCH)
