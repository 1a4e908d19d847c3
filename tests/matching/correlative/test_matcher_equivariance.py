"""What must not depend on how a map happens to be stored, and how the answer follows where it moves."""

import itertools
import math
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from drawing import cut, office, row_of_rooms, school, seen_from
from hypothesis import given, settings
from hypothesis import strategies as st

import mapmeld
from mapmeld.grid import OccupancyGrid
from mapmeld.matching import MatchResult, Verdict
from mapmeld.matching.correlative import match_correlative
from mapmeld.matching.correlative.covariance import of_inverse
from mapmeld.se2 import Pose2

B_T = Pose2(2.0, -7.0, 0.7)
A = office()
PAIRS = {
    "the same": (A, seen_from(A, B_T)),
    "a part": (cut(A, 0, 0, 11, 12), seen_from(cut(A, 5, 0, 16, 12), B_T)),
    "another building": (A, school()),
    "identical rooms": (cut(row_of_rooms(6), 1, 0, 15, 5), cut(row_of_rooms(6), 5, 0, 20, 5)),
}
pairs = st.sampled_from(sorted(PAIRS))
borders = st.tuples(*[st.integers(0, 40)] * 4)


def everything_but_poses(result: MatchResult) -> tuple[object, ...]:
    others = [(other.similarity, other.probability) for other in result.alternatives]
    return result.verdict, result.reason, result.probability, result.similarity, result.overlap, others


def poses(result: MatchResult) -> list[Pose2]:
    assert result.T_a_b is not None
    return [result.T_a_b, *(other.T_a_b for other in result.alternatives)]


def assert_poses(found: list[Pose2], expected: list[Pose2], metres: float, radians: float) -> None:
    for one, other in zip(found, expected, strict=True):
        off, turned = one.distance_to(other)
        assert off <= metres
        assert turned <= radians


# ---------------------------------------------------------------------- frames
@settings(max_examples=15)
@given(pairs, st.from_type(Pose2), st.from_type(Pose2))
def test_moving_the_frames_moves_the_answer(name: str, T_1_a: Pose2, T_2_b: Pose2) -> None:
    a, b = PAIRS[name]
    still, moved = match_correlative(a, b), match_correlative(a.moved(T_1_a), b.moved(T_2_b))
    assert everything_but_poses(moved) == everything_but_poses(still)
    assert_poses(poses(moved), [T_1_a @ T @ T_2_b.inverse() for T in poses(still)], 1e-6, 1e-9)
    # The uncertainty moves along: by the derivative of the transform that is asked for.
    assert still.covariance is not None
    assert moved.covariance is not None
    J = derivative(lambda T: T_1_a @ T @ T_2_b.inverse(), poses(still)[0])
    np.testing.assert_allclose(moved.covariance, J @ still.covariance @ J.T, rtol=1e-4, atol=1e-9)


def derivative(f: Callable[[Pose2], Pose2], T: Pose2) -> np.ndarray:
    """Derivative (3, 3) of (x, y, theta) of f(T) by (x, y, theta) of T."""
    columns = []
    for k in range(3):
        step = np.eye(3)[k] * 1e-6
        high, low = (f(Pose2(T.x + s * step[0], T.y + s * step[1], T.theta + s * step[2])) for s in (1, -1))
        turned = math.remainder(high.theta - low.theta, math.tau)
        columns.append([(high.x - low.x) / 2e-6, (high.y - low.y) / 2e-6, turned / 2e-6])
    return np.array(columns).T


# ---------------------------------------------------------------------- unknown borders
@settings(max_examples=15)
@given(pairs, borders, borders)
def test_unknown_borders_change_nothing(
    name: str, around_a: tuple[int, int, int, int], around_b: tuple[int, int, int, int]
) -> None:
    a, b = PAIRS[name]
    still = match_correlative(a, b)
    for other_a, other_b in ((a.extended(*around_a), b.extended(*around_b)), (a.cropped(), b.cropped(3))):
        again = match_correlative(other_a, other_b)
        assert everything_but_poses(again) == everything_but_poses(still)
        # Not to the last bit: the origins of padded maps are rounded too.
        assert_poses(poses(again), poses(still), 1e-12, 0.0)


# ---------------------------------------------------------------------- either way round
@pytest.mark.parametrize("name", PAIRS)
def test_swapping_the_maps_inverts_the_answer(name: str) -> None:
    a, b = PAIRS[name]
    forth, back = match_correlative(a, b), match_correlative(b, a)
    assert everything_but_poses(forth) == everything_but_poses(back)
    assert_poses(poses(forth), [T.inverse() for T in poses(back)], 1e-12, 1e-12)
    assert forth.covariance is not None
    assert back.covariance is not None
    assert forth.T_a_b is not None
    np.testing.assert_allclose(back.covariance, of_inverse(forth.T_a_b, forth.covariance), rtol=1e-9)


def test_swapping_maps_of_the_same_size_inverts_the_answer() -> None:
    # Neither map is the larger one here.
    turned = OccupancyGrid(A.cells[::-1, ::-1].copy(), A.resolution)
    forth, back = match_correlative(A, turned), match_correlative(turned, A)
    assert_poses(poses(forth), [T.inverse() for T in poses(back)], 1e-12, 1e-12)
    assert everything_but_poses(forth) == everything_but_poses(back)


@pytest.mark.parametrize("border", [(1, 0, 0, 0), (0, 7, 3, 0)])
def test_unknown_borders_change_nothing_for_maps_of_the_same_size(border: tuple[int, int, int, int]) -> None:
    for other in (A.cells[::-1, ::-1], A.cells[:, ::-1], A.cells[::-1]):
        turned = OccupancyGrid(other, A.resolution)
        still = match_correlative(A, turned)
        for pair in ((A.extended(*border), turned), (A, turned.extended(*border))):
            again = match_correlative(*pair)
            assert everything_but_poses(again) == everything_but_poses(still)
            assert_poses(poses(again), poses(still), 1e-12, 1e-12)


@pytest.mark.parametrize("far", [Pose2(), Pose2(5e3, -2e4, 2.0)])
def test_a_map_on_itself_is_the_identity(far: Pose2) -> None:
    result = match_correlative(A.moved(far), A.moved(far))
    assert result.T_a_b is not None
    assert result.T_a_b.distance_to(Pose2()) == pytest.approx((0, 0), abs=1e-6)
    assert result.verdict is Verdict.ACCEPTED


# ---------------------------------------------------------------------- the raster turned
def quarter_turned(grid: OccupancyGrid, quarters: int) -> OccupancyGrid:
    """The same place in the same frame, its lattice turned clockwise by quarters of a turn."""
    rows, cols = grid.shape
    # np.rot90 thinks of row 0 as the top one, so here it turns the other way; the origin makes up for it.
    corner = [(0, 0), (cols, 0), (cols, rows), (0, rows)][quarters % 4]
    x, y = grid.lattice_to_metres(corner)
    origin = Pose2(float(x), float(y), grid.origin.theta + quarters * math.pi / 2)
    return OccupancyGrid(np.rot90(grid.cells, quarters), grid.resolution, origin)


def test_a_quarter_turn_of_the_lattice_moves_no_wall() -> None:
    a = PAIRS["a part"][1].moved(Pose2(1, 2, 0.3))
    walls = a.centres(a.occupied)
    for quarters in range(4):
        turned = quarter_turned(a, quarters)
        again = turned.centres(turned.occupied)
        np.testing.assert_allclose(
            np.sort(again.view(complex), 0), np.sort(walls.view(complex), 0), atol=1e-9
        )


@pytest.mark.parametrize("name", ["the same", "a part", "identical rooms"])
@pytest.mark.parametrize("turned_map", [0, 1])
@pytest.mark.parametrize("quarters", [1, 2, 3])
def test_quarter_turns_of_the_raster_change_little(name: str, turned_map: int, quarters: int) -> None:
    still = match_correlative(*PAIRS[name])
    a, b = (quarter_turned(grid, quarters) if i == turned_map else grid for i, grid in enumerate(PAIRS[name]))
    result = match_correlative(a, b)
    assert result.verdict is still.verdict
    middle = b.lattice_to_metres((b.shape[1] / 2, b.shape[0] / 2))
    level = [T for T, p in zip(poses(result), probabilities(result), strict=True) if p > 0.1]
    expected = [T for T, p in zip(poses(still), probabilities(still), strict=True) if p > 0.1]
    assert len(level) == len(expected)
    for T in expected:
        near = min(level, key=lambda other: T.distance_to(other)[0])
        assert float(np.hypot(*(near.apply(middle) - T.apply(middle)))) <= 0.01
        assert near.distance_to(T)[1] <= math.radians(0.05)


def probabilities(result: MatchResult) -> Iterator[float]:
    for p in itertools.chain([result.probability], (other.probability for other in result.alternatives)):
        assert p is not None
        yield p


@settings(max_examples=15)
@given(st.floats(-math.pi, math.pi), st.floats(-1, 1), st.floats(-1, 1))
def test_any_turn_of_the_raster_changes_little(turn: float, x: float, y: float) -> None:
    T_2_b = Pose2(x, y, turn)
    fine = office(0.025)
    a, b = (seen_from(g, Pose2(), 0.05) for g in (cut(fine, 0, 0, 12, 12), cut(fine, 4, 0, 16, 12)))
    turned = seen_from(cut(fine, 4, 0, 16, 12), T_2_b, 0.05)
    still, result = match_correlative(a, b).T_a_b, match_correlative(a, turned)
    assert still is not None
    assert result.T_a_b is not None
    assert result.verdict is Verdict.ACCEPTED
    metres = np.hypot(*((result.T_a_b @ T_2_b).apply((8.0, 6.0)) - still.apply((8.0, 6.0))))
    assert metres <= 0.05
    assert (result.T_a_b @ T_2_b).distance_to(still)[1] <= math.radians(0.3)


# ---------------------------------------------------------------------- the same answer, bit by bit
def exactly(result: MatchResult) -> list[object]:
    assert result.covariance is not None
    numbers = [v for T in poses(result) for v in (T.x, T.y, T.theta)]
    return [*(float(v).hex() for v in [*numbers, *result.covariance.ravel()]), *everything_but_poses(result)]


def copied(name: str) -> tuple[OccupancyGrid, OccupancyGrid]:
    """The same maps as other objects: nothing about them is remembered."""
    a, b = PAIRS[name]
    return replace(a), replace(b)


@pytest.mark.parametrize("name", PAIRS)
def test_the_same_input_gives_the_same_answer(name: str) -> None:
    first = exactly(match_correlative(*copied(name)))
    assert exactly(match_correlative(*copied(name))) == first
    threads = cv2.getNumThreads()
    try:
        for n in (1, 2):
            cv2.setNumThreads(n)
            assert exactly(match_correlative(*copied(name))) == first
    finally:
        cv2.setNumThreads(threads)


def test_another_process_gives_the_same_answer() -> None:
    program = (
        "import test_matcher_equivariance as t\n"
        "from mapmeld.matching.correlative import match_correlative\n"
        "print([t.exactly(match_correlative(*pair)) for pair in t.PAIRS.values()])"
    )
    here = Path(__file__).parent
    paths = [str(here), str(here.parents[1]), str(Path(mapmeld.__file__).parents[1])]
    env = os.environ | {"PYTHONPATH": os.pathsep.join(paths), "PYTHONHASHSEED": "7"}
    done = subprocess.run(
        [sys.executable, "-c", program], env=env, capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == str([exactly(match_correlative(*pair)) for pair in PAIRS.values()])
