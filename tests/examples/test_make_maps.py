"""The example maps: the laser, the mapping, and that what is shipped fits together."""

from __future__ import annotations

import importlib.util
import math
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from mapmeld.changes import Change, diff
from mapmeld.grid import FREE, OCCUPIED, OccupancyGrid
from mapmeld.io import load
from mapmeld.se2 import Pose2

EXAMPLES = Path(__file__).parents[2] / "examples"
MAPS = EXAMPLES / "maps"


def _script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_maps", EXAMPLES / "make_maps.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["make_maps"] = module  # dataclasses look their module up by name
    spec.loader.exec_module(module)
    return module


make_maps = _script()


def drawn(text: str, resolution: float = 0.1, origin: Pose2 | None = None) -> OccupancyGrid:
    rows = [[OCCUPIED if c == "#" else FREE for c in line] for line in text.split()]
    return OccupancyGrid(np.array(rows[::-1], np.int8), resolution, origin or Pose2())


# Inside: 8 x 4 cells, and a post at column 6, row 2 (from the bottom).
ROOM = """
##########
#........#
#........#
#.....#..#
#........#
##########
"""

TINY = make_maps.Building(
    size=(3.0, 2.0),
    walls=((0, 0, 3, 0), (3, 0, 3, 2), (3, 2, 0, 2), (0, 2, 0, 0), (1.5, 0, 1.5, 2)),
    doors=((1.5, 0.5, 1.5, 1.5),),
    boxes=((2.7, 0.3, 0.3, 0.3, 0.0),),
    tables=((0.4, 1.6, 0.4, 0.4, 20.0),),
)


# ---------------------------------------------------------------- laser
@pytest.mark.parametrize(
    ("bearing", "distance"), [(0.0, 0.35), (math.pi / 2, 0.25), (math.pi, 0.15), (-math.pi / 2, 0.15)]
)
def test_rays_end_at_the_first_wall(bearing: float, distance: float) -> None:
    # From the middle of column 2, row 2: the post, the top, the left and the bottom wall.
    ranges = make_maps.cast_rays(drawn(ROOM), Pose2(0.25, 0.25, 0.0), np.array([bearing]))
    assert ranges[0] == pytest.approx(distance, abs=0.026)


def test_rays_turn_with_robot_and_lattice() -> None:
    bearings = np.linspace(-2.0, 2.0, 9)
    plain = make_maps.cast_rays(drawn(ROOM), Pose2(0.25, 0.25, 0.3), bearings)
    T = Pose2(4.0, -7.0, 0.9)
    moved = make_maps.cast_rays(drawn(ROOM, origin=T), T @ Pose2(0.25, 0.25, 0.3), bearings)
    np.testing.assert_allclose(moved, plain)
    shifted = make_maps.cast_rays(drawn(ROOM), Pose2(0.25, 0.25, 0.0), bearings + 0.3)
    np.testing.assert_allclose(shifted, plain)


def test_rays_past_their_reach_see_nothing() -> None:
    ranges = make_maps.cast_rays(drawn(ROOM), Pose2(0.25, 0.45, 0.0), np.array([0.0, math.pi]), reach=0.5)
    assert ranges[0] == math.inf
    assert math.isfinite(ranges[1])


@given(
    x=st.floats(0.15, 2.85),
    y=st.floats(0.15, 1.85),
    bearings=st.lists(st.floats(-3.1, 3.1), min_size=1, max_size=20),
)
def test_rays_end_where_geometry_says(x: float, y: float, bearings: list[float]) -> None:
    cells = np.full((40, 60), FREE, np.int8)
    cells[[0, -1]] = OCCUPIED
    cells[:, [0, -1]] = OCCUPIED
    angles = np.array(bearings)
    ranges = make_maps.cast_rays(OccupancyGrid(cells, 0.05), Pose2(x, y, 0.0), angles)
    end_x, end_y = x + ranges * np.cos(angles), y + ranges * np.sin(angles)
    # How far the ends are from the rectangle of inner wall faces, 0.05..2.95 x 0.05..1.95.
    off = np.maximum(np.abs(end_x - 1.5) - 1.45, np.abs(end_y - 1.0) - 0.95)
    assert np.abs(off).max() <= 0.0126


# ---------------------------------------------------------------- mapping
def test_scan_frees_the_way_and_marks_the_end_once() -> None:
    log_odds = np.zeros((3, 12))
    # Two nearly equal beams along row 1 that end in column 8: their cells count once.
    make_maps.add_scan(log_odds, np.array([2.5, 1.5]), np.array([0.0, 1e-4]), np.array([6.0, 6.0]))
    expected = np.zeros((3, 12))
    expected[1, 2:8] = make_maps.MISS
    expected[1, 8] = make_maps.HIT
    np.testing.assert_array_equal(log_odds, expected)


def test_beam_without_return_frees_but_marks_nothing() -> None:
    log_odds = np.zeros((1, 130))
    make_maps.add_scan(log_odds, np.array([2.5, 0.5]), np.array([0.0]), np.array([math.inf]))
    reach = round(make_maps.RANGE / make_maps.MAP_RESOLUTION)
    assert (log_odds[0, 2 : 2 + reach] == make_maps.MISS).all()
    assert not (log_odds > 0).any()
    assert not log_odds[0, 2 + reach + 1 :].any()


def test_hit_outweighs_a_miss_in_the_same_scan() -> None:
    log_odds = np.zeros((1, 12))
    make_maps.add_scan(log_odds, np.array([0.5, 0.5]), np.array([0.0, 0.0]), np.array([4.0, 9.0]))
    assert log_odds[0, 4] == make_maps.HIT
    assert log_odds[0, 6] == make_maps.MISS


def test_drift_starts_at_zero_and_stays_mild() -> None:
    errors = make_maps.drift(200, np.random.default_rng(0))
    assert not errors[0].any()
    worst = np.abs(errors).max(axis=0)
    assert (worst >= 0.5 * make_maps.DRIFT).all()
    assert (worst <= make_maps.DRIFT + 6 * make_maps.JITTER).all()


def test_plan_has_walls_doors_and_legs() -> None:
    seen, blocked = make_maps.draw(TINY)

    def at(grid: OccupancyGrid, x: float, y: float) -> bool:
        col, row = np.floor(grid.metres_to_lattice((x, y))).astype(int)
        return bool(grid.occupied[row, col])

    assert at(seen, 1.5, 0.2)
    assert not at(seen, 1.5, 1.0)  # the door
    assert at(seen, 2.7, 0.3)
    assert not at(seen, 0.4, 1.6)  # beneath the table
    assert at(blocked, 0.4, 1.6)
    leg = Pose2(0.4, 1.6, math.radians(20)).apply((0.17, 0.17))
    assert at(seen, float(leg[0]), float(leg[1]))


def test_drive_goes_through_the_door() -> None:
    _, blocked = make_maps.draw(TINY)
    poses = make_maps.drive(blocked, make_maps.Tour(Pose2(0.6, 0.6, 2.0), ((2.4, 1.4),)))
    np.testing.assert_allclose(poses[0], (0.6, 0.6, 2.0))
    assert np.hypot(*(poses[-1, :2] - (2.4, 1.4))) < 0.25
    assert np.hypot(*np.diff(poses[:, :2], axis=0).T).max() <= make_maps.STEP + 1e-9
    assert np.abs(np.diff(poses[:, 2])).max() <= make_maps.TURN + 1e-9
    cols, rows = np.floor(blocked.metres_to_lattice(poses[:, :2])).astype(int).T
    assert not blocked.occupied[rows, cols].any()


def test_same_seed_same_map() -> None:
    tour = make_maps.Tour(Pose2(0.6, 0.6, 0.4), ((1.0, 1.0),))
    first, again, other = (make_maps.simulate(TINY, tour, np.random.default_rng(seed)) for seed in (3, 3, 4))
    assert first == again
    assert first != other
    assert first.origin.theta == 0.0
    col, row = np.floor(first.metres_to_lattice((0.0, 0.0))).astype(int)
    assert first.free[row, col]  # the robot stood here
    assert not first.known[:5].any()
    assert first.known[5].any()


# ---------------------------------------------------------------- files
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


@pytest.mark.parametrize(("a", "b"), [("1", "2"), ("1", "3"), ("2", "3")])
def test_shipped_truth_lays_walls_on_walls(a: str, b: str) -> None:
    map_a, map_b = load(MAPS / f"robot_{a}.yaml"), load(MAPS / f"robot_{b}.yaml")
    T = Pose2(*_shipped_truth()["transforms"][f"T_{a}_{b}"])
    off = _walls_off(map_a, map_b, T)
    assert off.size > 500
    assert np.median(off) < 1.5
    assert np.percentile(off, 90) < 3.0
    # Not by chance: a shift of half a metre is seen.
    assert np.median(_walls_off(map_a, map_b, Pose2(T.x + 0.35, T.y - 0.35, T.theta))) > 2.0


def test_shipped_truth_is_that_of_the_tours() -> None:
    assert _shipped_truth() == make_maps.truth(make_maps.TOURS)


def test_shipped_maps_are_small() -> None:
    assert sum(file.stat().st_size for file in MAPS.iterdir()) < 1_000_000


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
        # Every change is near something that came or went; the longest table reaches 1.5 m from its middle.
        for region in of_kind:
            assert min(math.dist(region.centroid, place) for place in places) < 1.6
        for place in places:
            assert min(math.dist(region.centroid, place) for region in of_kind) < 1.6
    assert found.area(Change.EXPLORED) > 10
