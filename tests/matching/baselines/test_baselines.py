"""What holds for every baseline."""

import math
from collections.abc import Callable

import cv2
import numpy as np
import pytest
from drawing import drawn, office, seen_from
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import mapmeld
from mapmeld.grid import OccupancyGrid
from mapmeld.matching import METHODS, MatchResult, Verdict
from mapmeld.matching.baselines import AkazeMissingError
from mapmeld.se2 import Pose2

A = office()
B_T = Pose2(2.0, -7.0, 0.7)  # takes A's frame into B's
B = seen_from(A, B_T)


def drawn_numbers() -> NDArray[np.floating]:
    """The next numbers of OpenCV's generator of this thread."""
    return np.asarray(cv2.randu(np.zeros((1, 8)), np.zeros(1), np.ones(1)))


def has_akaze() -> bool:
    try:
        mapmeld.match(A, drawn("."), method="feature_akaze")
    except AkazeMissingError:
        return False
    return True


FROM_WALLS = ["hough_spectrum", "fourier_mellin"]
ALL = [
    "feature_orb",
    *FROM_WALLS,
    pytest.param("feature_akaze", marks=pytest.mark.skipif(not has_akaze(), reason="OpenCV without AKAZE")),
]


def error(found: Pose2 | None, T_a_b: Pose2) -> tuple[float, float]:
    """Errors in metres, at the middle of the office, and degrees."""
    assert found is not None
    middle = T_a_b.inverse().apply((8.0, 6.0))
    return float(np.hypot(*(found.apply(middle) - (8.0, 6.0)))), math.degrees(found.distance_to(T_a_b)[1])


def answers(method: str) -> Callable[[OccupancyGrid, OccupancyGrid], MatchResult]:
    return lambda a, b: METHODS[method].run(a, b, METHODS[method].parameters())


@pytest.mark.parametrize("method", ALL)
def test_a_turned_map_is_found(method: str) -> None:
    result = mapmeld.match(A, B, method=method)
    metres, degrees = error(result.T_a_b, B_T.inverse())
    assert metres < 0.1
    assert degrees < 0.5
    assert result.overlap > 0.95
    # The drawn walls are two cells thick; an answer one cell off keeps a third of them.
    assert result.similarity > 0.33
    assert result.probability is None
    assert "threshold" in result.reason


@pytest.mark.parametrize("method", ["feature_orb", *FROM_WALLS])
def test_a_turned_map_is_believed(method: str) -> None:
    assert mapmeld.match(A, B, method=method).verdict is Verdict.ACCEPTED


@pytest.mark.parametrize("method", FROM_WALLS)
@settings(max_examples=15)
@given(turn=st.floats(-math.pi, math.pi))
def test_any_turn_is_found(method: str, turn: float) -> None:
    T_b_a = Pose2(-3.0, 11.0, turn)
    metres, degrees = error(answers(method)(A, seen_from(A, T_b_a)).T_a_b, T_b_a.inverse())
    assert metres < 0.15
    assert degrees < 1.0


@pytest.mark.parametrize("method", FROM_WALLS)
@pytest.mark.parametrize("resolution", [0.04, 0.08])
def test_maps_of_different_resolution_are_matched(method: str, resolution: float) -> None:
    metres, degrees = error(answers(method)(A, seen_from(office(0.02), B_T, resolution)).T_a_b, B_T.inverse())
    assert metres < 0.15
    assert degrees < 1.0


@pytest.mark.parametrize("method", ALL)
@settings(max_examples=10)
@given(T_1_a=st.from_type(Pose2), T_2_b=st.from_type(Pose2))
def test_moving_the_frames_moves_the_answer(method: str, T_1_a: Pose2, T_2_b: Pose2) -> None:
    still = answers(method)(A, B)
    moved = answers(method)(A.moved(T_1_a), B.moved(T_2_b))
    assert still.T_a_b is not None
    assert moved.T_a_b is not None
    metres, radians = moved.T_a_b.distance_to(T_1_a @ still.T_a_b @ T_2_b.inverse())
    assert metres < 1e-6
    assert radians < 1e-9
    assert moved.reason == still.reason
    assert moved.similarity == still.similarity


@pytest.mark.parametrize("method", FROM_WALLS)
@settings(max_examples=10)
@given(left=st.integers(0, 60), bottom=st.integers(0, 60), right=st.integers(0, 60), top=st.integers(0, 60))
def test_unknown_border_changes_nothing(method: str, left: int, bottom: int, right: int, top: int) -> None:
    still = answers(method)(A, B)
    padded = answers(method)(A.extended(left, bottom, right, top), B.extended(top, right, bottom, left))
    assert still.T_a_b is not None
    assert padded.T_a_b is not None
    assert padded.T_a_b.distance_to(still.T_a_b) == pytest.approx((0, 0), abs=1e-9)
    assert padded.reason == still.reason


@pytest.mark.parametrize("method", ALL)
@pytest.mark.parametrize(
    ("nothing", "reason"),
    [
        (OccupancyGrid(np.zeros((0, 0), np.int8), 0.05), "map b has no obstacle"),
        (OccupancyGrid(np.zeros((0, 7), np.int8), 0.05), "map b has no obstacle"),
        (drawn(".", 0.05), "map b has no obstacle"),
        (drawn("   \n   ", 0.05), "map b has no obstacle"),
        (drawn("\n".join(["." * 50] * 50), 0.05), "map b has no obstacle"),
        (drawn("#", 0.05), "the obstacles of map b lie on one line"),
        (drawn("#" * 300 + "\n" + "." * 300, 0.05), "the obstacles of map b lie on one line"),
    ],
)
def test_a_map_with_nothing_to_match_on_is_rejected_with_the_reason(
    method: str, nothing: OccupancyGrid, reason: str
) -> None:
    result = mapmeld.match(A, nothing, method=method)
    assert result.verdict is Verdict.REJECTED
    assert result.T_a_b is None
    assert "nothing to match on" in result.reason
    assert reason in result.reason
    swapped = mapmeld.match(nothing, A, method=method)
    assert swapped.verdict is Verdict.REJECTED
    assert reason.replace("map b", "map a") in swapped.reason


@pytest.mark.parametrize("method", ALL)
@settings(max_examples=15)
@given(
    cells=st.tuples(st.integers(1, 40), st.integers(1, 40), st.integers(0, 2**32 - 1)).map(
        lambda c: np.random.default_rng(c[2]).integers(-1, 101, c[:2]).astype(np.int8)
    )
)
def test_no_clutter_is_an_error_or_a_match(method: str, cells: NDArray[np.int8]) -> None:
    clutter = OccupancyGrid(cells, 0.05)
    assert answers(method)(A, clutter).verdict is Verdict.REJECTED
    assert answers(method)(clutter, A).verdict is Verdict.REJECTED


@pytest.mark.parametrize("method", ALL)
def test_the_same_input_gives_the_same_answer_and_no_state_is_left_behind(method: str) -> None:
    cv2.setRNGSeed(1)
    first = answers(method)(A, B)
    after = drawn_numbers()
    cv2.setRNGSeed(2)
    assert answers(method)(A, B) == first
    cv2.setRNGSeed(1)
    np.testing.assert_array_equal(after, drawn_numbers())


@pytest.mark.parametrize("method", FROM_WALLS)
def test_the_other_hypotheses_are_kept(method: str) -> None:
    result = answers(method)(A, B)
    assert len(result.alternatives) % 2 == 1  # every rotation and its half-turn twin, without the winner
    half_turn = [other for other in result.alternatives if error(other.T_a_b, B_T.inverse())[1] > 179]
    assert half_turn
    assert all(other.similarity < result.similarity for other in result.alternatives)
