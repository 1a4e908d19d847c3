"""The whole matcher on drawn places: what it finds, and what it says of it."""

import math
from collections.abc import Callable

import cv2
import numpy as np
import pytest
from drawing import built, cut, drawn, hall, office, row_of_rooms, school, seen_from
from numpy.typing import NDArray

import mapmeld
from mapmeld.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mapmeld.matching import MatchResult, Verdict
from mapmeld.matching.correlative import CorrelativeParameters, match_correlative
from mapmeld.se2 import Pose2

A = office()
B_T = Pose2(2.0, -7.0, 0.7)  # takes A's frame into B's
FINE = office(0.02)
Part = tuple[float, float, float, float]


def error(found: Pose2 | None, T_a_b: Pose2) -> tuple[float, float]:
    """Errors in metres, at the middle of the office, and degrees."""
    assert found is not None
    middle = T_a_b.inverse().apply((8.0, 6.0))
    return float(np.hypot(*(found.apply(middle) - (8.0, 6.0)))), math.degrees(found.distance_to(T_a_b)[1])


def assert_found(result: MatchResult, T_a_b: Pose2, metres: float = 0.02, degrees: float = 0.1) -> None:
    off, turned = error(result.T_a_b, T_a_b)
    assert off <= metres
    assert turned <= degrees
    assert result.verdict is Verdict.ACCEPTED


def assert_consistent(result: MatchResult) -> None:
    """What holds for every answer."""
    assert result.probability is not None
    assert result.T_a_b is not None
    alternatives = [other.probability for other in result.alternatives]
    assert all(p is not None for p in alternatives)
    probabilities = [result.probability, *(p for p in alternatives if p is not None)]
    assert all(0 <= p <= 1 for p in probabilities)
    assert sum(probabilities) <= 1 + 1e-12
    assert 0 <= result.overlap <= 1
    assert 0 <= result.similarity <= 1
    assert result.covariance is not None
    np.testing.assert_allclose(result.covariance, result.covariance.T, rtol=1e-9, atol=1e-12)
    assert np.linalg.eigvalsh(result.covariance).min() > 0
    assert ("explains" in result.reason) == (result.T_a_b is not None)


# ---------------------------------------------------------------------- found
@pytest.mark.parametrize("degrees", [0, 10, 33, 45, 90, 121, 180, 233, 300, 359])
def test_a_turned_map_is_found(degrees: int) -> None:
    T_b_a = Pose2(2.0, -7.0, math.radians(degrees))
    result = mapmeld.match(A, seen_from(A, T_b_a))
    assert_found(result, T_b_a.inverse())
    assert_consistent(result)
    assert result.method == "correlative"
    assert result.seconds > 0
    assert result.probability is not None
    assert result.probability > 0.95
    assert result.overlap > 0.95
    assert result.similarity > 0.9


@pytest.mark.parametrize("shift", [(0.03, 0.0), (0.0, 0.02), (0.017, -0.041), (30.0, -55.5)])
def test_a_shift_within_a_cell_is_found(shift: tuple[float, float]) -> None:
    # The lattices of the two maps differ by a part of a cell, where walls come to lie on whole cells.
    T_b_a = Pose2(*shift)
    assert_found(mapmeld.match(seen_from(FINE, Pose2(), 0.05), seen_from(FINE, T_b_a, 0.05)), T_b_a.inverse())


@pytest.mark.parametrize(
    ("part_a", "part_b"),
    [
        ((0, 0, 11.2, 12), (4.8, 0, 16, 12)),  # left and right, 0.4 of the floor in common
        ((0, 0, 16, 8.4), (0, 3.6, 16, 12)),  # lower and upper
        ((0, 0, 13, 9), (3, 3, 16, 12)),  # corners
        ((0, 0, 16, 12), (3, 2, 14, 11)),  # one inside the other
    ],
)
def test_maps_that_share_a_part_are_found(part_a: Part, part_b: Part) -> None:
    result = mapmeld.match(cut(A, *part_a), seen_from(cut(A, *part_b), B_T))
    assert_found(result, B_T.inverse())
    assert_consistent(result)
    shared = [min(part_a[i], part_b[i]) - max(part_a[i - 2], part_b[i - 2]) for i in (2, 3)]
    smaller = min((p[2] - p[0]) * (p[3] - p[1]) for p in (part_a, part_b))
    assert result.overlap == pytest.approx(shared[0] * shared[1] / smaller, abs=0.05)


@pytest.mark.parametrize("resolution_b", [0.02, 0.05, 0.1, 0.2])
@pytest.mark.parametrize("resolution_a", [0.02, 0.05, 0.1, 0.2])
def test_maps_of_all_resolutions_are_found(resolution_a: float, resolution_b: float) -> None:
    a = seen_from(FINE, Pose2(0.31, 0.17, -0.2), resolution_a)
    b = seen_from(FINE, B_T, resolution_b)
    T_a_b = Pose2(0.31, 0.17, -0.2) @ B_T.inverse()
    coarser = max(resolution_a, resolution_b)
    assert_found(mapmeld.match(a, b), T_a_b, max(0.02, 0.4 * coarser), max(0.1, 2 * coarser))


@pytest.mark.parametrize(("resolution", "thickness"), [(0.05, 0.3), (0.1, 0.1), (0.1, 0.2)])
def test_thick_walls_are_aligned_as_finely_as_thin_ones(resolution: float, thickness: float) -> None:
    side = round(thickness / FINE.resolution)
    wall = cv2.dilate(FINE.occupied.astype(np.uint8), np.ones((side, side), np.uint8)) > 0
    place = OccupancyGrid(np.where(wall, np.int8(OCCUPIED), FINE.cells), FINE.resolution)
    T_a = Pose2(0.31, 0.17, -0.2)
    a, b = seen_from(place, T_a, resolution), seen_from(place, B_T, resolution)
    T_a_b = mapmeld.match(a, b).T_a_b
    assert T_a_b is not None
    off, turned = error(T_a.inverse() @ T_a_b, B_T.inverse())
    assert off < 0.01
    assert turned < 0.1


def salted(grid: OccupancyGrid, share: float, seed: int) -> OccupancyGrid:
    cells = grid.cells.copy()
    cells[grid.known & (np.random.default_rng(seed).random(grid.shape) < share)] = OCCUPIED
    return OccupancyGrid(cells, grid.resolution, grid.origin)


def frayed(grid: OccupancyGrid, share: float, seed: int) -> OccupancyGrid:
    """Walls with holes, and with bumps on either side."""
    rng = np.random.default_rng(seed)
    cells = grid.cells.copy()
    near = cv2.dilate(grid.occupied.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    cells[grid.occupied & (rng.random(grid.shape) < share)] = FREE
    cells[near & grid.free & (rng.random(grid.shape) < share)] = OCCUPIED
    return OccupancyGrid(cells, grid.resolution, grid.origin)


def gappy(grid: OccupancyGrid, share: float, seed: int) -> OccupancyGrid:
    """A share of all cells was never measured."""
    cells = grid.cells.copy()
    cells[np.random.default_rng(seed).random(grid.shape) < share] = UNKNOWN
    return OccupancyGrid(cells, grid.resolution, grid.origin)


@pytest.mark.parametrize(("spoil", "share"), [(salted, 0.002), (frayed, 0.2), (frayed, 0.4), (gappy, 0.3)])
def test_noise_does_not_matter(
    spoil: Callable[[OccupancyGrid, float, int], OccupancyGrid], share: float
) -> None:
    result = mapmeld.match(spoil(A, share, 1), spoil(seen_from(A, B_T), share, 2))
    assert_found(result, B_T.inverse(), 0.03, 0.15)


def test_probabilities_instead_of_three_values_do_not_matter() -> None:
    shades = np.select([A.occupied, A.free], [np.int8(70), np.int8(12)], np.int8(-1)).astype(np.int8)
    b = seen_from(A, B_T)
    assert mapmeld.match(OccupancyGrid(shades, 0.05), b).T_a_b == mapmeld.match(A, b).T_a_b


# ---------------------------------------------------------------------- not to be believed
@pytest.mark.parametrize("turn", [0.0, 0.4, 1.5, 3.0])
def test_different_buildings_are_rejected(turn: float) -> None:
    result = mapmeld.match(A, seen_from(school(), Pose2(1, 1, turn)))
    assert result.verdict is Verdict.REJECTED
    assert "not enough" in result.reason
    assert result.probability is not None
    assert result.probability < 0.5
    assert_consistent(result)


@pytest.mark.parametrize("turn", [0.0, 0.7])
@pytest.mark.parametrize(
    ("building", "part_a", "part_b"),
    [
        (office, (0, 0, 4, 12), (4, 0, 16, 12)),
        (office, (0, 0, 6.4, 12), (6.4, 0, 16, 12)),
        (office, (0, 0, 8, 12), (8, 0, 16, 12)),
        (office, (0, 0, 9.6, 12), (9.6, 0, 16, 12)),
        (school, (0, 0, 20, 3), (0, 3, 20, 9)),
        (school, (0, 0, 20, 4), (0, 4, 20, 9)),
        (school, (0, 0, 10, 9), (11, 0, 20, 9)),
        (office, (0, 0, 16, 6.3), (0, 7.3, 16, 12)),  # fit well, though on little wall, turned by 90 degrees
    ],
)
def test_parts_that_do_not_overlap_are_not_accepted(
    building: Callable[[], OccupancyGrid], part_a: Part, part_b: Part, turn: float
) -> None:
    b = seen_from(cut(building(), *part_b), Pose2(2.0, -7.0, turn))
    assert mapmeld.match(cut(building(), *part_a), b).verdict is not Verdict.ACCEPTED


def test_parts_that_do_not_overlap_are_not_accepted_on_a_slanted_lattice() -> None:
    b = seen_from(cut(A, 0, 6.6, 16, 12), B_T)
    assert mapmeld.match(cut(A, 0, 0, 16, 6.6), b).verdict is not Verdict.ACCEPTED


def assert_ambiguous(result: MatchResult, least: int) -> None:
    assert result.verdict is Verdict.AMBIGUOUS
    assert "another transform" in result.reason
    assert_consistent(result)
    assert result.probability is not None
    assert result.probability <= 0.85
    level = [o for o in result.alternatives if o.probability and o.probability > 0.4 * result.probability]
    assert len(level) >= least - 1


@pytest.mark.parametrize("degrees", [0, 40, 90])
def test_a_hall_that_is_its_own_half_turn_is_ambiguous(degrees: int) -> None:
    T_b_a = Pose2(1, 2, math.radians(degrees))
    result = mapmeld.match(hall(), seen_from(hall(), T_b_a))
    assert_ambiguous(result, 2)
    half_turn = Pose2(14, 8, math.pi)
    assert result.T_a_b is not None
    modes = [result.T_a_b, result.alternatives[0].T_a_b]
    for truth in (T_b_a.inverse(), half_turn @ T_b_a.inverse()):
        assert min(mode.distance_to(truth)[0] for mode in modes) < 0.05
    assert modes[0].distance_to(modes[1])[1] == pytest.approx(math.pi, abs=0.01)


def row_window(start: float, stop: float) -> OccupancyGrid:
    """What was seen of a long row of rooms; neither of its ends."""
    return cut(row_of_rooms(10), start, 0, stop, 5)


@pytest.mark.parametrize(
    ("seen_a", "seen_b"),
    [
        ((1, 15), (5, 19)),
        ((1, 15), (14, 28)),
        ((3, 19), (9.5, 24)),
        ((5, 17), (17, 29)),
    ],
)
def test_identical_rooms_are_ambiguous(seen_a: tuple[float, float], seen_b: tuple[float, float]) -> None:
    result = mapmeld.match(row_window(*seen_a), row_window(*seen_b))
    assert_ambiguous(result, 2)
    assert result.T_a_b is not None
    level = [o.T_a_b for o in result.alternatives if o.probability and o.probability > 0.1]
    for T in (result.T_a_b, *level):
        # Modes differ by whole rooms.
        assert T.distance_to(Pose2(4 * round(T.x / 4), 0, 0)) == pytest.approx((0, 0), abs=0.03)


@pytest.mark.parametrize("start", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("metres", [8.0, 9.0])
def test_two_identical_rooms_are_not_accepted(start: float, metres: float) -> None:
    result = mapmeld.match(row_window(start, start + metres), row_window(start + 8, start + 8 + metres))
    assert result.verdict is not Verdict.ACCEPTED


@pytest.mark.parametrize("length", [12, 30])
@pytest.mark.parametrize("walls", [1, 2])
def test_what_slides_along_a_straight_wall_or_corridor_is_not_accepted(length: int, walls: int) -> None:
    straight = [(0.0, 0.0, length + 5.0, 0.1), (0.0, 2.1, length + 5.0, 2.2)][:walls]
    a = cut(built(length + 5, 2.2, straight), 0, 0, length, 2.2)
    b = cut(built(length + 5, 2.2, straight), 5, 0, length + 5, 2.2)
    assert mapmeld.match(a, seen_from(b, B_T)).verdict is not Verdict.ACCEPTED


# ---------------------------------------------------------------------- nothing to match on
def cells_with(value: int, *places: tuple[int, int]) -> NDArray[np.int8]:
    cells = np.full((60, 60), value, np.int8)
    for place in places:
        cells[place] = OCCUPIED
    return cells


@pytest.mark.parametrize("resolution", [0.01, 0.05, 1.0])
@pytest.mark.parametrize(
    "cells",
    [
        np.zeros((0, 0), np.int8),
        np.zeros((0, 5), np.int8),
        np.full((1, 1), UNKNOWN, np.int8),
        np.full((1, 1), FREE, np.int8),
        cells_with(UNKNOWN),
        cells_with(FREE),
        cells_with(50),
    ],
    ids=["no cells", "no rows", "one unknown", "one free", "all unknown", "no obstacle", "neither"],
)
def test_without_an_obstacle_there_is_nothing_to_match_on(cells: NDArray[np.int8], resolution: float) -> None:
    nothing = OccupancyGrid(cells, resolution)
    for pair, name in (((A, nothing), "b"), ((nothing, A), "a"), ((nothing, nothing), "a")):
        result = mapmeld.match(*pair)
        assert result.verdict is Verdict.REJECTED
        assert result.T_a_b is None
        assert result.covariance is None
        assert result.probability == 0.0
        assert result.alternatives == ()
        assert f"nothing to match on: map {name} has no obstacle" in result.reason


def straight_wall(length: int, floor: int) -> OccupancyGrid:
    cells = np.full((40, length), floor, np.int8)
    cells[20] = OCCUPIED
    return OccupancyGrid(cells, 0.05)


@pytest.mark.parametrize(
    "little",
    [
        drawn("#", 0.05),
        drawn("##\n#.", 0.05),
        OccupancyGrid(cells_with(FREE, (30, 30)), 0.05),
        OccupancyGrid(cells_with(UNKNOWN, (0, 0), (59, 59)), 0.05),
        straight_wall(60, FREE),
        straight_wall(60, UNKNOWN),
    ],
    ids=["one wall cell", "three wall cells", "a speck on the floor", "two specks", "a wall", "a bare wall"],
)
def test_hardly_anything_to_match_on_is_rejected(little: OccupancyGrid) -> None:
    for pair in ((A, little), (little, A), (little, little), (little, straight_wall(90, FREE))):
        result = mapmeld.match(*pair)
        assert result.verdict is Verdict.REJECTED
        assert result.reason
        assert result.probability is not None
        assert result.probability < 0.5


@pytest.mark.parametrize("resolution", [0.05, 0.2])
def test_a_map_of_walls_alone_is_never_accepted(resolution: float) -> None:
    solid = OccupancyGrid(np.full((60, 60), OCCUPIED, np.int8), resolution)
    for pair in ((A, solid), (solid, A), (solid, solid)):
        assert mapmeld.match(*pair).verdict is not Verdict.ACCEPTED


# ---------------------------------------------------------------------- settings
def test_the_wanted_probability_decides() -> None:
    # Ever smaller parts, until the matcher is neither sure nor at a loss.
    parts = (seen_from(cut(A, 4, 3, 4 + side, 3 + side), B_T) for side in np.arange(9.0, 3.0, -0.2))
    b, p = next((b, p) for b in parts if (p := match_correlative(A, b).probability or 0.0) < 0.98)
    assert p > 0.5
    result = match_correlative(A, b)
    for accept in (0.5 * (0.5 + p), p, 0.5 * (p + 1)):
        again = match_correlative(A, b, CorrelativeParameters(accept_probability=accept))
        assert (again.T_a_b, again.probability) == (result.T_a_b, p)
        assert (again.verdict is Verdict.ACCEPTED) == (accept <= p)


def test_one_hypothesis_has_no_alternatives() -> None:
    result = match_correlative(A, seen_from(A, B_T), CorrelativeParameters(hypotheses=1))
    assert_found(result, B_T.inverse())
    assert result.alternatives == ()


def test_where_the_walls_do_not_meet_nothing_is_said_of_shares() -> None:
    bare = OccupancyGrid(cells_with(UNKNOWN, (0, 0), (59, 59)), 0.05)
    result = mapmeld.match(bare, bare)
    assert "of 0 m" not in result.reason
    assert "next to no wall" in result.reason or "nothing to match on" in result.reason
