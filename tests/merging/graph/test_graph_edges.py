import math

import numpy as np
import pytest
from drawing import drawn, office, seen_from
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.merging.graph.edges import (
    BENT_METRES,
    BENT_SHARE,
    BENT_TURN,
    Edges,
    Extent,
    bending,
    composed,
    in_own_frames,
    inverted,
    log_odds,
    moves,
    of_another_mode,
    pose_of,
    row_of,
    wrapped,
)
from mapmeld.merging.graph.edges import (
    seen_from as motion_seen_from,
)
from mapmeld.se2 import Pose2

POSES = st.from_type(Pose2)


def rows(*poses: Pose2) -> np.ndarray:
    return np.array([row_of(pose) for pose in poses])


@given(POSES, POSES)
def test_arrays_compose_and_invert_as_poses_do(a: Pose2, b: Pose2) -> None:
    assert pose_of(composed(rows(a), rows(b))[0]).distance_to(a @ b) == pytest.approx((0, 0), abs=1e-9)
    assert pose_of(inverted(rows(a))[0]).distance_to(a.inverse()) == pytest.approx((0, 0), abs=1e-9)


@given(st.floats(-50, 50))
def test_wrapped_angles_are_the_same_direction(angle: float) -> None:
    found = float(wrapped(np.array([angle]))[0])
    assert -math.pi <= found <= math.pi
    assert math.remainder(found - angle, math.tau) == pytest.approx(0, abs=1e-9)
    if abs(angle) <= math.pi:
        assert found == angle


def test_the_extent_of_a_rectangle_is_its_middle_and_diagonal() -> None:
    grid = drawn("\n".join(["." * 40] * 30), 0.1, Pose2(5, -3, 0))
    extent = Extent.of(grid)
    assert (extent.x, extent.y) == pytest.approx((7, -1.5))
    assert extent.size == pytest.approx(5, rel=0.01)


@pytest.mark.parametrize("degrees", [30, 90, 200])
def test_the_extent_does_not_depend_on_how_a_map_lies(degrees: float) -> None:
    grid = office(0.1)
    T = Pose2(3, -2, math.radians(degrees))
    before, after = Extent.of(grid), Extent.of(seen_from(grid, T))
    assert after.size == pytest.approx(before.size, rel=0.01)
    assert (after.x, after.y) == pytest.approx(tuple(T.apply((before.x, before.y))), abs=0.1)


def test_a_map_without_anything_known_has_no_size() -> None:
    assert Extent.of(drawn("  \n  ")) == Extent()


@given(POSES, st.floats(-30, 30), st.floats(-30, 30))
def test_bending_is_a_shift_and_a_turn_about_the_middle_of_the_smaller_map(
    T: Pose2, x: float, y: float
) -> None:
    a, b = Extent(1, 2, 40), Extent(x, y, 10)
    covariance = bending(T, a, b)
    assert covariance[2, 2] == pytest.approx(2 * BENT_TURN**2)
    # Where the middle of the small map lands: its error has no part of the turn.
    c, s = math.cos(T.theta), math.sin(T.theta)
    J = np.array([[1, 0, -s * x - c * y], [0, 1, c * x - s * y]])
    expected = 2 * BENT_METRES**2 + BENT_SHARE**2 * (40**2 + 10**2)
    np.testing.assert_allclose(J @ covariance @ J.T, np.eye(2) * expected, atol=1e-6)


@given(POSES)
def test_bending_is_the_same_seen_from_either_map(T: Pose2) -> None:
    a, b = Extent(1, 2, 40), Extent(-3, 0.5, 10)
    there = moves(rows(T), bending(T, a, b)[None])
    back = moves(rows(T.inverse()), bending(T.inverse(), b, a)[None])
    np.testing.assert_allclose(motion_seen_from(rows(T.inverse()), there), back, atol=1e-6)


def test_larger_maps_may_contradict_one_another_more() -> None:
    small, large = Extent(0, 0, 5), Extent(0, 0, 60)
    assert bending(Pose2(), small, large)[0, 0] > bending(Pose2(), small, small)[0, 0]


@given(POSES)
def test_the_best_mode_is_at_least_as_exact_as_another_one(T: Pose2) -> None:
    b = Extent(2, 1, 10)
    own = np.diag([0.04, 0.01, 0.001])
    other = of_another_mode(Pose2(1, 2, 3), own, T, b)
    assert np.linalg.eigvalsh(other).min() > 0
    assert other[2, 2] == pytest.approx(own[2, 2])


def test_what_a_probability_counts_for() -> None:
    assert log_odds(0.9) == pytest.approx(math.log(9))
    assert log_odds(None) == log_odds(0.9)  # of a method that states none
    assert log_odds(1.0) == log_odds(0.999999) == pytest.approx(math.log(99))
    assert 0 < log_odds(0.0) <= log_odds(0.3) < log_odds(0.6)


def test_errors_in_the_frame_of_the_second_node() -> None:
    covariance = np.diag([1.0, 4.0, 9.0])
    edges = Edges.of([(0, 1, Pose2(7, 7, math.pi / 2), covariance, 1.0)])
    np.testing.assert_allclose(in_own_frames(edges)[0], np.diag([4.0, 1.0, 9.0]), atol=1e-12)


@given(POSES, POSES)
def test_motions_are_seen_from_elsewhere_as_first_order_says(T: Pose2, X: Pose2) -> None:
    """A small motion D of frame b is X D X^-1 in frame a."""
    h = 1e-6
    for k, small in enumerate((Pose2(h, 0, 0), Pose2(0, h, 0), Pose2(0, 0, h))):
        D = X @ small @ X.inverse()
        unit = np.zeros((1, 3, 3))
        unit[0, k, k] = 1
        motion = np.array(row_of(D)) / h
        np.testing.assert_allclose(
            motion_seen_from(rows(X), unit)[0], np.outer(motion, motion), rtol=1e-3, atol=1e-2
        )


def test_no_edges() -> None:
    edges = Edges.of([])
    assert len(edges) == 0
    assert edges.z.shape == (0, 3)
    assert edges.covariance.shape == (0, 3, 3)
