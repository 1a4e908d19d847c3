"""GeoJSON (RFC 7946) with metres of a map's frame for coordinates: changes written, drawings carried over."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterator, Mapping
from typing import Any

from mapmeld.changes.diff import MapDiff
from mapmeld.changes.places import GREATEST, rounded
from mapmeld.changes.regions import Region
from mapmeld.io.plain_yaml import short
from mapmeld.se2 import Pose2

Json = dict[str, Any]

# How deep the positions of each kind of geometry lie in lists.
_DEPTHS: Mapping[str, int] = {
    "Point": 0,
    "MultiPoint": 1,
    "LineString": 1,
    "MultiLineString": 2,
    "Polygon": 2,
    "MultiPolygon": 3,
}
_MEMBERS: Mapping[str, str] = {"FeatureCollection": "features", "GeometryCollection": "geometries"}
_GEOMETRIES = (*_DEPTHS, "GeometryCollection")


class GeoJsonError(ValueError):
    """Not GeoJSON; the message says what is wrong."""


# ---------------------------------------------------------------------- carried over
def position_count(content: Json) -> int:
    """Return how many positions there are in GeoJSON that has been checked."""
    return sum(1 for _ in _positions(content))


def moved_geojson(content: Json, T: Pose2, to: str = "to which they were carried") -> Json:
    """Return GeoJSON in the frame that `T` takes points to.

    Positions are moved, a third coordinate is kept, and every ``bbox`` is computed anew. All else is
    kept as it is: properties too, whatever they say about places or directions. Only in what
    `changes_geojson` made, the note then names the map `to`, and the centroids are moved.

    Raises
    ------
    GeoJsonError
        It is not GeoJSON, or a number is too large.
    """
    try:
        return _changes_moved(_moved(content, T), T, to)
    except RecursionError:
        raise GeoJsonError("nests its values too deep") from None


def _moved(content: Any, T: Pose2) -> Json:
    if not isinstance(content, dict):
        raise GeoJsonError(f"has {_short(content)} where an object is needed")
    kind = content.get("type")
    moved = dict(content)
    if kind == "FeatureCollection":
        moved["features"] = [_only(f, ("Feature",), T) for f in _list(content, "features")]
    elif kind == "Feature":
        if content.get("geometry") is not None:
            moved["geometry"] = _only(content["geometry"], _GEOMETRIES, T)
    elif kind == "GeometryCollection":
        moved["geometries"] = [_only(g, _GEOMETRIES, T) for g in _list(content, "geometries")]
    elif isinstance(kind, str) and kind in _DEPTHS:
        if "coordinates" not in content:
            raise GeoJsonError(f"has a {kind} without coordinates")
        moved["coordinates"] = _moved_positions(content["coordinates"], _DEPTHS[kind], kind, T)
    else:
        raise GeoJsonError(f"has an object of the type {_short(kind)}, which GeoJSON does not know")
    if moved.get("bbox") is not None:
        box = _box(moved, content["bbox"])
        moved.pop("bbox")
        if box is not None:
            moved["bbox"] = box
    return moved


def _changes_moved(content: Json, T: Pose2, to: str) -> Json:
    """Carry over what, besides the positions, `changes_geojson` says of places."""
    if content["type"] != "FeatureCollection" or not _NOTE_OF_ANY.fullmatch(str(content.get("note"))):
        return content
    features = []
    for feature in content["features"]:
        properties = feature.get("properties")
        centroid = properties.get("centroid") if isinstance(properties, dict) else None
        if isinstance(centroid, list) and len(centroid) == 2 and all(map(_is_number, centroid)):
            moved = _moved_positions(centroid, 0, "centroid", T)
            feature = {**feature, "properties": {**properties, "centroid": moved}}
        features.append(feature)
    return {**content, "note": _note(to), "features": features}


def _note(name: str) -> str:
    return f"Coordinates are metres in the frame of the map {name}, not longitude and latitude."


_NOTE_OF_ANY = re.compile(r"Coordinates are metres in the frame of the map .*, not longitude and latitude\.")


def _only(content: Any, kinds: Collection[str], T: Pose2) -> Json:
    kind = content.get("type") if isinstance(content, dict) else content
    if not isinstance(content, dict) or not isinstance(kind, str) or kind not in kinds:
        needed = "geometry" if "Point" in kinds else "Feature"
        raise GeoJsonError(f"has {_short(kind)} in place of a {needed}")
    return _moved(content, T)


def _list(content: Json, key: str) -> list[Any]:
    value = content.get(key)
    if not isinstance(value, list):
        raise GeoJsonError(f"has a {content['type']} without a list of {key}")
    return value


def _moved_positions(value: Any, depth: int, kind: str, T: Pose2) -> list[Any]:
    if not isinstance(value, list):
        raise GeoJsonError(f"has {_short(value)} among the coordinates of a {kind}")
    if depth:
        return [_moved_positions(item, depth - 1, kind, T) for item in value]
    if kind == "Point" and not value:
        return []  # an empty geometry, which the standard lets writers have
    if len(value) < 2 or not all(_is_number(v) for v in value):
        raise GeoJsonError(f"has a {kind} with {_short(value)} in place of a position [x, y]")
    if not all(abs(v) <= GREATEST for v in value[:2]):
        raise GeoJsonError(f"has a coordinate beyond {GREATEST:,.0f} m in {_short(value)}")
    x, y = (rounded(float(v)) for v in T.apply(value[:2]))
    return [x, y, *value[2:]]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _box(content: Json, old: Any) -> list[Any] | None:
    """Return the bounding box of what was moved, with heights as they were; None if it is empty."""
    if not (isinstance(old, list) and len(old) in (4, 6) and all(map(_is_number, old))):
        raise GeoJsonError(f"has {_short(old)} in place of a bbox")
    corners = [position[:2] for position in _positions(content)]
    if not corners:
        return None
    low, high = ([edge(values) for values in zip(*corners, strict=True)] for edge in (min, max))
    return [*low, *high] if len(old) == 4 else [*low, old[2], *high, old[5]]


def _positions(content: Json) -> Iterator[list[float]]:
    """Yield every position of GeoJSON that has been checked."""
    kind = content["type"]  # which alone says what a member of any name means
    if kind in _MEMBERS:
        for inner in content[_MEMBERS[kind]]:
            yield from _positions(inner)
    elif kind == "Feature":
        if content.get("geometry") is not None:
            yield from _positions(content["geometry"])
    else:
        level = [content["coordinates"]]
        for _ in range(_DEPTHS[kind]):
            level = [item for items in level for item in items]
        yield from (position for position in level if position)


def _short(value: Any) -> str:
    return short(str(value)[:100])


# ---------------------------------------------------------------------- written
def geojson_text(content: Json) -> str:
    """Return JSON text, the features of a collection one to a line."""
    features = content.get("features")
    if content.get("type") != "FeatureCollection" or not features:
        return json.dumps(content, allow_nan=False) + "\n"
    lines = ",\n".join(json.dumps(feature, allow_nan=False) for feature in features)
    members = (
        f"{json.dumps(name)}: "
        + (f"[\n{lines}\n]" if name == "features" else json.dumps(value, allow_nan=False))
        for name, value in content.items()
    )
    return f"{{{', '.join(members)}}}\n"


def changes_geojson(diff: MapDiff, old_name: str) -> Json:
    """Return the changes as a FeatureCollection of Polygons, numbered from 1, the greatest first."""
    return {
        "type": "FeatureCollection",
        "note": _note(old_name),
        "features": [_feature(number, region) for number, region in enumerate(diff.regions, start=1)],
    }


def _feature(number: int, region: Region) -> Json:
    ring = [[rounded(x), rounded(y)] for x, y in region.outline.tolist()]
    return {
        "type": "Feature",
        "id": number,
        "bbox": [rounded(v) for v in region.bounds],
        "geometry": {"type": "Polygon", "coordinates": [[*ring, ring[0]]]},
        "properties": {
            "number": number,
            "kind": region.kind,
            "area_m2": rounded(region.area_m2),
            "centroid": [rounded(v) for v in region.centroid],
        },
    }
