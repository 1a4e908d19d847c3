"""The example maps: how they are made, and that what is shipped fits together."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

from mapmeld.changes import Change, diff
from mapmeld.evaluation import accuracy, navigability
from mapmeld.grid import OccupancyGrid
from mapmeld.io import load
from mapmeld.matching import match
from mapmeld.merging import merge
from mapmeld.se2 import Pose2
from mapmeld.simulation import Configuration, Settings, generate

EXAMPLES = Path(__file__).parents[2] / "examples"
MAPS = EXAMPLES / "maps"
sys.path.insert(0, str(EXAMPLES))  # as when the script is run

import make_maps  # noqa: E402

ROBOTS = ("robot_1", "robot_2", "robot_3")


# ---------------------------------------------------------------- how they are made
@pytest.fixture(scope="module")
def mappings() -> dict[str, make_maps.Mapping]:
    return make_maps.mappings(make_maps.SEED)


def test_robots_begin_apart_and_stay_in_their_parts(mappings: dict[str, make_maps.Mapping]) -> None:
    for name, (part, _) in make_maps.PARTS.items():
        found = mappings[name]
        size = np.array(found.place.size)
        places = np.array([(found.tour.start.x, found.tour.start.y), *found.tour.stops])
        assert len(places) > 5
        assert (places >= size * part[:2]).all()
        assert (places <= size * part[2:]).all()
    starts = [mappings[name].tour.start for name in ROBOTS]
    assert all(a.distance_to(b)[0] > 4 for a, b in combinations(starts, 2))


def test_later_some_furniture_is_elsewhere(mappings: dict[str, make_maps.Mapping]) -> None:
    office = mappings["robot_1"].place
    later, went, came = make_maps.refurnished(office, make_maps.SEED)
    assert later == mappings["robot_1_later"].place
    assert len(went) == make_maps.MOVED
    assert len(came) >= make_maps.MOVED - 1
    assert set(later.furniture) == (set(office.furniture) - set(went)) | set(came)
    assert later.fields.tobytes() == office.fields.tobytes()
    for new in came:
        for other in (*went, *(piece for piece in later.furniture if piece != new)):
            a, b = new.footprint, other.footprint
            assert math.hypot(a.x - b.x, a.y - b.y) > max(a.length, b.length) + 0.7


def test_the_same_seed_gives_the_same_maps(monkeypatch: pytest.MonkeyPatch) -> None:
    place = generate(Settings(9, 8, Configuration(1, ((5, 5),))), seed=2)
    monkeypatch.setattr(make_maps, "SLAM", replace(make_maps.SLAM, particles=3))
    monkeypatch.setattr(make_maps, "LONGEST", 6.0)
    tour = make_maps.tour(place, (0, 0, 1, 1), (0, 0), 2, 1)
    one, same, other = (list(make_maps.history(make_maps.Mapping(place, tour, n))) for n in (1, 1, 2))
    assert one == same
    assert one != other
    assert [grid.stamp for grid in one] == sorted(grid.stamp for grid in one if grid.stamp is not None)
    col, row = np.floor(one[0].metres_to_lattice((0.2, 0.0))).astype(int)
    assert one[0].free[row, col]  # right ahead of where the robot was set down
    assert not one[0].known[:5].any()
    assert one[0].known[5].any()


def test_refuses_to_overwrite(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    there = tmp_path / "truth.yaml"
    there.write_text("mine")
    assert make_maps.main(["--out", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert str(there) in said
    assert said.count("\n") == 1
    assert list(tmp_path.iterdir()) == [there]
    assert there.read_text() == "mine"


# ---------------------------------------------------------------- what is shipped
def _walls_off(a: OccupancyGrid, b: OccupancyGrid, T_a_b: Pose2) -> NDArray[np.float64]:
    """Return how far [cells] b's obstacles, where map a knows anything, are from a's nearest obstacle."""
    away = cv2.distanceTransform((~a.occupied).astype(np.uint8), cv2.DIST_L2, 5)
    cols, rows = np.floor(a.metres_to_lattice(T_a_b.apply(b.centres(b.occupied)))).astype(int).T
    inside = (rows >= 0) & (rows < a.shape[0]) & (cols >= 0) & (cols < a.shape[1])
    rows, cols = rows[inside], cols[inside]
    return np.asarray(away[rows, cols][a.known[rows, cols]], np.float64)


def _shipped_truth() -> dict[str, Any]:
    content: dict[str, Any] = yaml.safe_load((MAPS / "truth.yaml").read_text())
    return content


PAIRS = [("1", "2"), ("1", "3"), ("2", "3")]


@pytest.mark.parametrize(("a", "b"), PAIRS)
def test_shipped_truth_lays_walls_on_walls(a: str, b: str) -> None:
    map_a, map_b = load(MAPS / f"robot_{a}.yaml"), load(MAPS / f"robot_{b}.yaml")
    T = Pose2(*_shipped_truth()["transforms"][f"T_{a}_{b}"])
    off = _walls_off(map_a, map_b, T)
    assert off.size > 500
    assert np.median(off) < 3.0
    # Not by chance: a shift of half a metre is seen.
    assert np.median(_walls_off(map_a, map_b, Pose2(T.x + 0.35, T.y - 0.35, T.theta))) > np.median(off) + 1.5


@pytest.mark.parametrize("method", ["correlative", "alphabet"])
@pytest.mark.parametrize(("a", "b"), PAIRS)
def test_shipped_maps_match(a: str, b: str, method: str) -> None:
    found = match(load(MAPS / f"robot_{a}.yaml"), load(MAPS / f"robot_{b}.yaml"), method)
    assert found.verdict == "accepted"
    assert found.T_a_b is not None
    metres, radians = found.T_a_b.distance_to(Pose2(*_shipped_truth()["transforms"][f"T_{a}_{b}"]))
    assert metres < 0.3
    assert radians < math.radians(1.5)


def test_shipped_truth_is_that_of_the_tours() -> None:
    made = make_maps.truth(make_maps.SEED)
    assert _flat(_shipped_truth()) == pytest.approx(_flat(made), abs=1e-6)


def _flat(content: Any) -> list[float]:
    if isinstance(content, dict):
        return [value for key in sorted(content) for value in _flat(content[key])]
    if isinstance(content, list):
        return [value for item in content for value in _flat(item)]
    return [float(content)]


def test_shipped_maps_show_the_floor() -> None:
    floor, starts = load(MAPS / "floor.yaml"), _shipped_truth()["start_poses"]
    for name in ROBOTS:
        grid = load(MAPS / f"{name}.yaml")
        assert accuracy(grid, floor, Pose2(*starts[name])) > 0.9
        assert 0.4 * floor.known_area < grid.known_area < 0.9 * floor.known_area


def test_the_merged_maps_can_be_driven() -> None:
    starts = {name: Pose2(*pose) for name, pose in _shipped_truth()["start_poses"].items()}
    merged = merge([MAPS / f"{name}.yaml" for name in ROBOTS])
    found = navigability(
        merged.grid,
        load(MAPS / "floor.yaml"),
        starts["robot_1"],
        starts=[pose for pose in merged.starts if pose is not None],
        pairs=60,
    )
    assert found.pairs == found.reachable_truth == 60
    assert found.false_blocks <= 3
    assert found.false_passages <= 6


def test_shipped_files_are_small() -> None:
    sizes = [file.stat().st_size for file in MAPS.iterdir()]
    assert max(sizes) < 300_000
    assert sum(sizes) < 1_200_000


# ---------------------------------------------------------------- the later map
def test_what_changed_is_what_came_and_went() -> None:
    later = _shipped_truth()["later"]
    T = Pose2(*later["T_1_later"])
    found = diff(load(MAPS / "robot_1.yaml"), load(MAPS / "robot_1_later.yaml"))
    metres, radians = found.T_old_new.distance_to(T)
    assert metres < 0.15
    assert radians < math.radians(1)
    for kind, places in (("appeared", later["came"]), ("vanished", later["gone"])):
        of_kind = [region for region in found.regions if region.kind == kind]
        # Every change is near something that came or went, and all of that is found.
        for region in of_kind:
            assert min(math.dist(region.centroid, place) for place in places) < 1.2
        for place in places:
            assert min(math.dist(region.centroid, place) for region in of_kind) < 1.2
    assert found.area(Change.APPEARED) > 0.1
    assert found.area(Change.VANISHED) > 0.1
