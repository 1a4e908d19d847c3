"""``mapmeld transform-points POINTS --from A --to B -o OUT``."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mapmeld.cli.options import (
    DEFAULT_METHOD,
    Force,
    Json,
    Method,
    ParamsFile,
    Resolution,
    Settings,
    Transform,
)
from mapmeld.wording import plural

if TYPE_CHECKING:
    from collections.abc import Callable

    from mapmeld.se2 import Pose2

_YAML, _GEOJSON = (".yaml", ".yml"), (".geojson", ".json")


def transform_points(
    points: Annotated[
        Path, typer.Argument(metavar="POINTS", help="YAML (see docs/changes.md) or GeoJSON, in metres.")
    ],
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="FILE", help="The file to write, of the same kind.")
    ],
    from_map: Annotated[
        str | None, typer.Option("--from", metavar="A", help="The map that they were drawn on.")
    ] = None,
    to_map: Annotated[
        str | None, typer.Option("--to", metavar="B", help="The map whose frame they are wanted in.")
    ] = None,
    transform: Transform = None,
    force: Force = False,
    json: Json = False,
    method: Method = DEFAULT_METHOD,
    params: ParamsFile = None,
    settings: Settings = None,
    resolution: Resolution = None,
) -> None:
    """Carry points, poses and polygons from the frame of map A into that of map B.

    The maps are matched; --transform X,Y,DEG (how A lies on B) needs no maps, a file of a match their names.
    """
    from mapmeld.cli.json_output import as_json, transform_points_fields
    from mapmeld.cli.maps import load_maps, names_of
    from mapmeld.cli.parameters import effective_parameters
    from mapmeld.cli.placement import (
        Placement,
        accepted_match,
        given_transform,
        note_if_unlikely,
        transform_of_numbers,
    )
    from mapmeld.cli.progress import working
    from mapmeld.cli.tables import pose_text, print_lines
    from mapmeld.io import MapFileError
    from mapmeld.io.atomic import check_targets, write_files

    _check_usage(from_map, to_map, transform)
    carry = _reader(points, out, to_map)
    check_targets([out], force=force)
    parameters = effective_parameters(method, params, settings)
    if from_map is None or to_map is None:
        placed = Placement(transform_of_numbers(transform or ""), None)
    elif transform is not None:
        placed = Placement(given_transform(transform, to_map, from_map), None)
        # Only their names are needed, so they may be elsewhere.
        with working("Weighing"), suppress(MapFileError):
            grid_to, grid_from = load_maps([to_map, from_map], resolution)
            note_if_unlikely(
                f"--transform {transform}", placed.T_a_b, grid_to, grid_from, names_of([to_map, from_map])
            )
    else:
        with working("Matching"):
            grid_to, grid_from = load_maps([to_map, from_map], resolution)
            placed = accepted_match(grid_to, grid_from, method, parameters)
    text, count = carry(placed.T_a_b)
    write_files([(out, (text.encode(),))], force=force)
    if json:
        maps = (from_map, to_map)
        typer.echo(as_json(transform_points_fields(placed, parameters, maps, count, [out])))
    else:
        print_lines(f"T_to_from: {pose_text(placed.T_a_b)}", f"Written: {out} ({_counted(count)})")


def _check_usage(from_map: str | None, to_map: str | None, transform: str | None) -> None:
    if from_map is not None and to_map is not None:
        return
    if from_map is not None or to_map is not None:
        raise typer.BadParameter("needs the other map too", param_hint="--from" if from_map else "--to")
    if transform is None or Path(transform).suffix.lower() == ".json":
        hint = "--transform" if transform else "--from"
        raise typer.BadParameter("needs the names of both maps, --from A --to B", param_hint=hint)


def _reader(points: Path, out: Path, to_map: str | None) -> Callable[[Pose2], tuple[str, dict[str, int]]]:
    """Read the points now, so that nothing is matched for a bad file; return what carries them over."""
    from mapmeld.changes import geojson, places
    from mapmeld.cli.maps import names_of
    from mapmeld.io import MapFileError
    from mapmeld.io.plain_json import read_object
    from mapmeld.se2 import Pose2

    for endings in (_YAML, _GEOJSON):
        if points.suffix.lower() in endings and out.suffix.lower() not in endings:
            kinds = " or ".join(endings)
            raise MapFileError.of(out, f"is of another kind than {points.name}; end it in {kinds}")
    if points.suffix.lower() in _YAML:
        found = places.read_places(points)
        counts = {kind: len(items) for kind, items in found.items()}
        return lambda T: (places.places_text(places.moved_places(found, T)), counts)
    if points.suffix.lower() not in _GEOJSON:
        raise MapFileError.of(points, f"is of no known kind (known: {' '.join((*_YAML, *_GEOJSON))})")
    content = read_object(points)
    try:
        counts = {"positions": geojson.position_count(geojson.moved_geojson(content, Pose2()))}
    except geojson.GeoJsonError as error:
        raise MapFileError.of(points, str(error)) from None
    to = () if to_map is None else names_of([to_map])
    return lambda T: (geojson.geojson_text(geojson.moved_geojson(content, T, *to)), counts)


def _counted(count: dict[str, int]) -> str:
    said = [plural(number, kind.removesuffix("s")) for kind, number in count.items()]
    return ", ".join(said) or "nothing in it"
