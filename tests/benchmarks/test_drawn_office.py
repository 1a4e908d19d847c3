"""The drawn office of the benchmark of changes: its laser, and its mapping."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.grid import FREE, OCCUPIED, OccupancyGrid
from mapmeld.se2 import Pose2

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))  # as when the script is run

import drawn_office


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

TINY = drawn_office.Building(
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
    ranges = drawn_office.cast_rays(drawn(ROOM), Pose2(0.25, 0.25, 0.0), np.array([bearing]))
    assert ranges[0] == pytest.approx(distance, abs=0.026)


def test_rays_turn_with_robot_and_lattice() -> None:
    bearings = np.linspace(-2.0, 2.0, 9)
    plain = drawn_office.cast_rays(drawn(ROOM), Pose2(0.25, 0.25, 0.3), bearings)
    T = Pose2(4.0, -7.0, 0.9)
    moved = drawn_office.cast_rays(drawn(ROOM, origin=T), T @ Pose2(0.25, 0.25, 0.3), bearings)
    np.testing.assert_allclose(moved, plain)
    shifted = drawn_office.cast_rays(drawn(ROOM), Pose2(0.25, 0.25, 0.0), bearings + 0.3)
    np.testing.assert_allclose(shifted, plain)


def test_rays_past_their_reach_see_nothing() -> None:
    ranges = drawn_office.cast_rays(drawn(ROOM), Pose2(0.25, 0.45, 0.0), np.array([0.0, math.pi]), reach=0.5)
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
    ranges = drawn_office.cast_rays(OccupancyGrid(cells, 0.05), Pose2(x, y, 0.0), angles)
    end_x, end_y = x + ranges * np.cos(angles), y + ranges * np.sin(angles)
    # How far the ends are from the rectangle of inner wall faces, 0.05..2.95 x 0.05..1.95.
    off = np.maximum(np.abs(end_x - 1.5) - 1.45, np.abs(end_y - 1.0) - 0.95)
    assert np.abs(off).max() <= 0.0126


# ---------------------------------------------------------------- mapping
def test_scan_frees_the_way_and_marks_the_end_once() -> None:
    log_odds = np.zeros((3, 12))
    # Two nearly equal beams along row 1 that end in column 8: their cells count once.
    drawn_office.add_scan(log_odds, np.array([2.5, 1.5]), np.array([0.0, 1e-4]), np.array([6.0, 6.0]))
    expected = np.zeros((3, 12))
    expected[1, 2:8] = drawn_office.MISS
    expected[1, 8] = drawn_office.HIT
    np.testing.assert_array_equal(log_odds, expected)


def test_beam_without_return_frees_but_marks_nothing() -> None:
    log_odds = np.zeros((1, 130))
    drawn_office.add_scan(log_odds, np.array([2.5, 0.5]), np.array([0.0]), np.array([math.inf]))
    reach = round(drawn_office.RANGE / drawn_office.MAP_RESOLUTION)
    assert (log_odds[0, 2 : 2 + reach] == drawn_office.MISS).all()
    assert not (log_odds > 0).any()
    assert not log_odds[0, 2 + reach + 1 :].any()


def test_hit_outweighs_a_miss_in_the_same_scan() -> None:
    log_odds = np.zeros((1, 12))
    drawn_office.add_scan(log_odds, np.array([0.5, 0.5]), np.array([0.0, 0.0]), np.array([4.0, 9.0]))
    assert log_odds[0, 4] == drawn_office.HIT
    assert log_odds[0, 6] == drawn_office.MISS


def test_drift_starts_at_zero_and_stays_mild() -> None:
    errors = drawn_office.drift(200, np.random.default_rng(0))
    assert not errors[0].any()
    worst = np.abs(errors).max(axis=0)
    assert (worst >= 0.5 * drawn_office.DRIFT).all()
    assert (worst <= drawn_office.DRIFT + 6 * drawn_office.JITTER).all()


def test_plan_has_walls_doors_and_legs() -> None:
    seen, blocked = drawn_office.draw(TINY)

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
    _, blocked = drawn_office.draw(TINY)
    poses = drawn_office.drive(blocked, drawn_office.Tour(Pose2(0.6, 0.6, 2.0), ((2.4, 1.4),)))
    np.testing.assert_allclose(poses[0], (0.6, 0.6, 2.0))
    assert np.hypot(*(poses[-1, :2] - (2.4, 1.4))) < 0.25
    assert np.hypot(*np.diff(poses[:, :2], axis=0).T).max() <= drawn_office.STEP + 1e-9
    assert np.abs(np.diff(poses[:, 2])).max() <= drawn_office.TURN + 1e-9
    cols, rows = np.floor(blocked.metres_to_lattice(poses[:, :2])).astype(int).T
    assert not blocked.occupied[rows, cols].any()


def test_same_seed_same_map() -> None:
    tour = drawn_office.Tour(Pose2(0.6, 0.6, 0.4), ((1.0, 1.0),))
    first, again, other = (drawn_office.simulate(TINY, tour, np.random.default_rng(s)) for s in (3, 3, 4))
    assert first == again
    assert first != other
    assert first.origin.theta == 0.0
    col, row = np.floor(first.metres_to_lattice((0.0, 0.0))).astype(int)
    assert first.free[row, col]  # the robot stood here
    assert not first.known[:5].any()
    assert first.known[5].any()
