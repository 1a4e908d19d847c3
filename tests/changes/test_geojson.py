import json
import math
from typing import Any

import numpy as np
import pytest
from drawing import drawn
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.changes import diff
from mapmeld.changes.geojson import GeoJsonError, changes_geojson, geojson_text, moved_geojson, position_count
from mapmeld.grid import OccupancyGrid
from mapmeld.se2 import Pose2

QUARTER = Pose2(10, 20, math.pi / 2)  # (x, y) -> (10 - y, 20 + x)


@pytest.mark.parametrize(
    ("kind", "coordinates", "moved"),
    [
        ("Point", [1, 2], [8.0, 21.0]),
        ("Point", [], []),
        ("Point", [1, 2, 3], [8.0, 21.0, 3]),
        ("MultiPoint", [[1, 2], [0, 0]], [[8.0, 21.0], [10.0, 20.0]]),
        ("LineString", [[1, 2], [0, 0]], [[8.0, 21.0], [10.0, 20.0]]),
        ("MultiLineString", [[[1, 2], [0, 0]], []], [[[8.0, 21.0], [10.0, 20.0]], []]),
        (
            "Polygon",
            [[[1, 2], [0, 0], [1, 0], [1, 2]]],
            [[[8.0, 21.0], [10.0, 20.0], [10.0, 21.0], [8.0, 21.0]]],
        ),
        ("MultiPolygon", [[[[1, 2, 7]]]], [[[[8.0, 21.0, 7]]]]),
    ],
)
def test_every_geometry(kind: str, coordinates: Any, moved: Any) -> None:
    geometry = {"type": kind, "coordinates": coordinates}
    before = json.dumps(geometry)
    assert moved_geojson(geometry, QUARTER) == {"type": kind, "coordinates": moved}
    assert json.dumps(geometry) == before


def test_features_collections_and_all_else_that_is_in_them() -> None:
    point = {"type": "Point", "coordinates": [1, 2], "mine": [1, 2]}
    content = {
        "type": "FeatureCollection",
        "name": "goals",
        "features": [
            {"type": "Feature", "id": 7, "geometry": point, "properties": {"coordinates": [1, 2], "yaw": 1}},
            {"type": "Feature", "geometry": None, "properties": None},
            {
                "type": "Feature",
                "properties": {},
                "geometry": {"type": "GeometryCollection", "geometries": [point, point]},
            },
        ],
    }
    moved = moved_geojson(content, QUARTER)
    there = {"type": "Point", "coordinates": [8.0, 21.0], "mine": [1, 2]}
    assert moved["name"] == "goals"
    assert moved["features"][0] == {**content["features"][0], "geometry": there}  # type: ignore[dict-item]
    assert moved["features"][1] == content["features"][1]
    assert moved["features"][2]["geometry"]["geometries"] == [there, there]
    assert position_count(moved) == 3


@pytest.mark.parametrize(
    ("coordinates", "box", "moved"),
    [
        ([[0, 0], [2, 1]], [0, 0, 2, 1], [9.0, 20.0, 10.0, 22.0]),
        ([[0, 0, 5], [2, 1, 6]], [0, 0, 5, 2, 1, 6], [9.0, 20.0, 5, 10.0, 22.0, 6]),
        ([[0, 0], [2, 1]], [-9, -9, 9, 9], [9.0, 20.0, 10.0, 22.0]),  # that of what is in it
    ],
)
def test_boxes_are_computed_anew(coordinates: Any, box: Any, moved: Any) -> None:
    line = {"type": "LineString", "coordinates": coordinates, "bbox": box}
    whole = {
        "type": "FeatureCollection",
        "bbox": box,
        "features": [{"type": "Feature", "bbox": box, "geometry": line}],
    }
    found = moved_geojson(whole, QUARTER)
    feature = found["features"][0]
    assert found["bbox"] == feature["bbox"] == feature["geometry"]["bbox"] == moved


def test_nothing_has_no_box() -> None:
    assert "bbox" not in moved_geojson(
        {"type": "MultiPoint", "coordinates": [], "bbox": [0, 0, 1, 1]}, QUARTER
    )
    assert moved_geojson({"type": "MultiPoint", "coordinates": [], "bbox": None}, QUARTER)["bbox"] is None


positions = st.lists(st.floats(-1e5, 1e5), min_size=2, max_size=2)


@given(st.lists(positions, min_size=1, max_size=5), st.from_type(Pose2))
def test_there_and_back(coordinates: list[list[float]], T: Pose2) -> None:
    line = {"type": "LineString", "coordinates": coordinates}
    there = moved_geojson(line, T)
    back = moved_geojson(there, T.inverse())
    np.testing.assert_allclose(back["coordinates"], coordinates, atol=1e-7)
    assert json.loads(geojson_text(there)) == there


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({}, "type"),
        ({"type": "Topology"}, "'Topology', which GeoJSON does not know"),
        ({"type": ["Point"]}, "does not know"),
        ({"type": "Point"}, "Point without coordinates"),
        ({"type": "Point", "coordinates": 3}, "'3' among the coordinates of a Point"),
        ({"type": "Point", "coordinates": [1]}, "in place of a position"),
        ({"type": "Point", "coordinates": ["1", "2"]}, "in place of a position"),
        ({"type": "Point", "coordinates": [True, False]}, "in place of a position"),
        ({"type": "Point", "coordinates": [1, 2, None]}, "in place of a position"),
        ({"type": "Point", "coordinates": [2e9, 0]}, "beyond 1,000,000,000 m"),
        ({"type": "Point", "coordinates": [10**400, 0]}, "beyond"),
        ({"type": "LineString", "coordinates": [1, 2]}, "among the coordinates"),
        ({"type": "LineString", "coordinates": [[]]}, "in place of a position"),
        ({"type": "Polygon", "coordinates": [[1, 2]]}, "among the coordinates"),
        ({"type": "Point", "coordinates": [1, 2], "bbox": [1, 2]}, "in place of a bbox"),
        ({"type": "Point", "coordinates": [1, 2], "bbox": "here"}, "in place of a bbox"),
        ({"type": "FeatureCollection"}, "without a list of features"),
        ({"type": "FeatureCollection", "features": [3]}, "'3' in place of a Feature"),
        (
            {"type": "FeatureCollection", "features": [{"type": "Point", "coordinates": [1, 2]}]},
            "place of a Feature",
        ),
        ({"type": "Feature", "geometry": {"type": "Feature", "geometry": None}}, "in place of a geometry"),
        ({"type": "Feature", "geometry": [1, 2]}, "in place of a geometry"),
        ({"type": "GeometryCollection"}, "without a list of geometries"),
        ({"type": "GeometryCollection", "geometries": [None]}, "in place of a geometry"),
    ],
)
def test_what_is_no_geojson(content: Any, said: str) -> None:
    with pytest.raises(GeoJsonError) as refused:
        moved_geojson(content, QUARTER)
    assert said in str(refused.value)


def test_collections_in_collections_without_end() -> None:
    deep: Any = {"type": "Point", "coordinates": [1, 2]}
    for _ in range(100_000):
        deep = {"type": "GeometryCollection", "geometries": [deep]}
    with pytest.raises(GeoJsonError, match="too deep"):
        moved_geojson(deep, QUARTER)


@pytest.mark.parametrize(
    "content",
    [
        {"type": "Point", "coordinates": [1, 2], "features": [1], "geometries": 5, "geometry": "round"},
        {"type": "Feature", "geometry": None, "properties": {}, "features": 5, "coordinates": "north"},
        {"type": "FeatureCollection", "features": [], "geometries": "abc", "coordinates": [[1]]},
        {"type": "GeometryCollection", "geometries": [], "features": {"a": 1}, "geometry": 3, "bbox": None},
    ],
)
def test_members_that_mean_something_in_other_types_mean_nothing_here(content: Any) -> None:
    moved = moved_geojson(content, QUARTER)
    foreign = {key: value for key, value in content.items() if key != "coordinates" or value != [1, 2]}
    assert foreign.items() <= moved.items()
    assert position_count(moved) == (content["type"] == "Point")
    assert json.loads(geojson_text(moved)) == moved


texts = st.text(max_size=12) | st.sampled_from(["features", "\0features\0", '"features"', "type"])


@given(st.dictionaries(texts, texts | st.lists(texts, max_size=2), max_size=4), st.lists(texts, max_size=3))
def test_text_says_what_it_was_made_of(members: dict[str, Any], notes: list[str]) -> None:
    features = [{"type": "Feature", "geometry": None, "properties": {"note": note}} for note in notes]
    content = {**members, "type": "FeatureCollection", "features": features}
    assert json.loads(geojson_text(content)) == content
    assert list(json.loads(geojson_text(content))) == list(content)


def test_text_has_a_line_for_every_feature() -> None:
    features = [{"type": "Feature", "geometry": None, "properties": {"name": "\ud800 ü"}} for _ in range(3)]
    content = {"type": "FeatureCollection", "a": 1, "features": features, "b": 2}
    text = geojson_text(content)
    assert text.isascii()
    assert text.count("\n") == 5
    assert json.loads(text) == content
    assert json.loads(geojson_text({"type": "FeatureCollection", "features": []}))["features"] == []


def test_changes_as_polygons_in_metres() -> None:
    origin = Pose2(5, 6, 0.3)
    old = OccupancyGrid(drawn("........\n........\n........").cells, 0.1, origin)
    new = OccupancyGrid(drawn("........\n.###....\n.#......").cells, 0.1, origin)
    found = diff(old, new, T_old_new=Pose2(), max_bend=0)
    content = changes_geojson(found, "old.yaml")
    assert "metres" in content["note"]
    assert "old.yaml" in content["note"]
    (feature,) = content["features"]
    assert feature["properties"]["kind"] == "appeared"
    assert feature["properties"]["number"] == feature["id"] == 1
    assert feature["properties"]["area_m2"] == pytest.approx(0.04)
    (ring,) = feature["geometry"]["coordinates"]
    assert ring[0] == ring[-1]
    np.testing.assert_allclose(ring[:-1], found.regions[0].outline, atol=1e-9)
    x, y = np.array(ring[:-1]).T
    assert (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2 == pytest.approx(0.04)  # counter-clockwise
    assert feature["bbox"] == pytest.approx([x.min(), y.min(), x.max(), y.max()])
    # It is GeoJSON by this module's own reading, and keeps its meaning when it is carried over.
    again = moved_geojson(content, QUARTER)
    moved = again["features"][0]["properties"]
    assert {**moved, "centroid": None} == {**feature["properties"], "centroid": None}
    assert moved["centroid"] == pytest.approx(QUARTER.apply(feature["properties"]["centroid"]))
    assert "old.yaml" not in again["note"], "they are not in its frame any more"
    named = moved_geojson(again, QUARTER.inverse(), "new.yaml")
    assert "new.yaml" in named["note"]
    assert named["features"][0]["properties"]["centroid"] == pytest.approx(feature["properties"]["centroid"])
    assert json.loads(geojson_text(content)) == content
