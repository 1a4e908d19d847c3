import math
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.changes.places import Place, moved_places, places_text, read_places
from mapmeld.io import MapFileError
from mapmeld.se2 import Pose2

WHOLE = """
points:
  - {name: charger, x: 1.2, y: 3.4}
  - x: -1
    y: .5
poses:
  - {name: dock, x: 0.5, y: -1.0, yaw: 1.5e-1}
polygons:
  - name: kitchen
    points:
      - [0, 0]
      - [4, 0]
      - [4, 3]
"""


def write(folder: Path, text: str) -> Path:
    (folder / "p.yaml").write_text(text, encoding="utf-8")
    return folder / "p.yaml"


def test_points_poses_and_polygons(tmp_path: Path) -> None:
    assert read_places(write(tmp_path, WHOLE)) == {
        "points": [Place("charger", ((1.2, 3.4),)), Place(None, ((-1.0, 0.5),))],
        "poses": [Place("dock", ((0.5, -1.0),), 0.15)],
        "polygons": [Place("kitchen", ((0.0, 0.0), (4.0, 0.0), (4.0, 3.0)))],
    }


def test_a_quarter_turn_and_a_shift() -> None:
    T = Pose2(10, 20, math.pi / 2)
    moved = moved_places({"poses": [Place("dock", ((1.0, 2.0),), 3.0)]}, T)
    assert (
        places_text(moved)
        == f"poses:\n  - {{name: dock, x: 8.0, y: 21.0, yaw: {round(3 - 1.5 * math.pi, 9)}}}\n"
    )


numbers = st.floats(-1e6, 1e6, allow_nan=False)
names = st.one_of(st.none(), st.text(st.characters(exclude_categories=["Cs"]), max_size=12))
corner = st.tuples(numbers, numbers)
all_places = st.fixed_dictionaries(
    {},
    optional={
        "points": st.lists(st.builds(Place, names, corner.map(lambda c: (c,))), max_size=3),
        "poses": st.lists(st.builds(Place, names, corner.map(lambda c: (c,)), st.floats(-3, 3)), max_size=3),
        "polygons": st.lists(
            st.builds(Place, names, st.lists(corner, min_size=3, max_size=5).map(tuple)), max_size=3
        ),
    },
).filter(bool)


@given(all_places)
def test_what_is_written_is_read_back(
    tmp_path_factory: pytest.TempPathFactory, places: dict[str, list[Place]]
) -> None:
    text = places_text(places)
    assert yaml.safe_load(text).keys() == places.keys()
    again = read_places(write(tmp_path_factory.mktemp("p"), text))
    assert again.keys() == places.keys()
    for kind in places:
        for one, other in zip(places[kind], again[kind], strict=True):
            assert one.name == other.name
            assert len(one.corners) == len(other.corners)
            for a, b in zip(one.corners, other.corners, strict=True):
                assert a == pytest.approx(b, abs=1e-9)
            assert one.yaw == (None if other.yaw is None else pytest.approx(other.yaw, abs=1e-9))


@given(all_places, st.from_type(Pose2))
def test_there_and_back(places: dict[str, list[Place]], T: Pose2) -> None:
    back = moved_places(moved_places(places, T), T.inverse())
    for kind in places:
        for one, other in zip(places[kind], back[kind], strict=True):
            for a, b in zip(one.corners, other.corners, strict=True):
                assert a == pytest.approx(b, abs=1e-8)
            if one.yaw is not None and other.yaw is not None:
                assert math.remainder(one.yaw - other.yaw, math.tau) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("zones: []", "'zones', which is none of points, poses, polygons"),
        ("points: 3", "'points' is not a list"),
        ("points: {x: 1, y: 2}", "'points' is not a list"),
        ("points: [[1, 2]]", "entry 1 of its 'points' is not of the form {name: ..., x: ..., y: ...}"),
        ("points: [{x: 1, y: 2, z: 3}]", "'z', which is none of name, x, y"),
        ("points: [{x: 1, y: 2}, {x: 1}]", "entry 2 of its 'points' has no 'y'"),
        ("points: [{x: 1, y: 2, yaw: 3}]", "'yaw'"),
        ("poses: [{x: 1, y: 2}]", "no 'yaw'"),
        ("points: [{x: one, y: 2}]", "'one' in place of a number"),
        ("points: [{x: '1', y: 2}]", "'1' in place of a number"),
        ("points: [{x: .nan, y: 2}]", "'.nan' in place of a number"),
        ("points: [{x: 0x10, y: 2}]", "'0x10' in place of a number"),
        ("points: [{x: 1_0, y: 2}]", "'1_0' in place of a number"),
        ("points: [{x: [1], y: 2}]", "a list or mapping in place of a number"),
        ("points: [{x: 1e400, y: 2}]", "too large"),
        ("points: [{x: 2e9, y: 2}]", "too large"),
        ("points: [{x: 1, y: 2, name: [a]}]", "a name that is not a text"),
        ('points: [{x: 1, y: 2, name: "\\ud800"}]', "a name that is not Unicode text"),
        ("polygons: [{points: [[0, 0], [1, 1]]}]", "not a list of three points or more"),
        ("polygons: [{points: [[0, 0], [1, 1], [1]]}]", "not of the form [x, y]"),
        ("polygons: [{points: [[0, 0], [1, 1], {x: 1, y: 2}]}]", "not of the form [x, y]"),
        ("polygons: [{points: 3}]", "not a list of three points or more"),
        ("- {x: 1, y: 2}", "no 'key: value' lines"),
        ("points: &a [{x: 1, y: 2}]\npoints2: *a", "anchor or alias"),
        ("points: !!python/object:os.system []", "tag"),
        ("points: []\npoints: []", "gives 'points' twice"),
        ("points: [{x: 1, x: 2, y: 1}]", "gives 'x' twice"),
        ("points: []\n---\npoints: []", "second document"),
        ("points: [[[[[[[]]]]]]]", "more than 5 levels"),
        ("points: [", "not valid YAML"),
        ("? [a]\n: b", "no plain word"),
        ("", "is empty"),
        ("# nothing", "no 'key: value' lines"),
        ("points: [{x: 1, y: 2}]" + " " * (1 << 20), "too large"),
    ],
)
def test_what_is_no_file_of_points(tmp_path: Path, text: str, said: str) -> None:
    file = write(tmp_path, text)
    with pytest.raises(MapFileError) as refused:
        read_places(file)
    assert said in str(refused.value)
    assert str(refused.value).startswith(str(file))
    assert "\n" not in str(refused.value)


def test_empty_lists_stay() -> None:
    assert yaml.safe_load(places_text({"points": [], "poses": []})) == {"points": [], "poses": []}
