import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.se2 import Pose2, rigid_through, wrap_angle

poses = st.from_type(Pose2)
coordinates = st.floats(-50, 50, allow_nan=False)
points = st.tuples(coordinates, coordinates)


def same(a: Pose2, b: Pose2) -> bool:
    metres, radians = a.distance_to(b)
    return metres < 1e-9 and radians < 1e-9


def test_a_quarter_turn_takes_x_to_y() -> None:
    np.testing.assert_allclose(Pose2(1, 2, math.pi / 2).apply((3, 0)), (1, 5), atol=1e-12)


@pytest.mark.parametrize(
    ("angle", "wrapped"),
    [(0, 0), (math.pi, math.pi), (-math.pi, math.pi), (3 * math.pi, math.pi), (-3.5, math.tau - 3.5)],
)
def test_wrapped_angles_lie_above_minus_pi_up_to_pi(angle: float, wrapped: float) -> None:
    assert wrap_angle(angle) == pytest.approx(wrapped)


@given(poses, poses, points)
def test_composition_applies_the_right_one_first(T_a_b: Pose2, T_b_c: Pose2, p: tuple[float, float]) -> None:
    np.testing.assert_allclose((T_a_b @ T_b_c).apply(p), T_a_b.apply(T_b_c.apply(p)), atol=1e-9)


@given(poses)
def test_the_inverse_undoes(T: Pose2) -> None:
    assert same(T @ T.inverse(), Pose2())
    assert same(T.inverse() @ T, Pose2())
    assert same(T.inverse().inverse(), T)


@given(poses, points)
def test_the_matrix_does_what_the_pose_does(T: Pose2, p: tuple[float, float]) -> None:
    np.testing.assert_allclose((T.matrix() @ [*p, 1])[:2], T.apply(p), atol=1e-9)
    assert same(Pose2.from_matrix(T.matrix()), T)


@pytest.mark.parametrize(
    "matrix",
    [
        np.eye(2),
        np.diag([2.0, 2, 1]),
        np.diag([1.0, -1, 1]),
        np.diag([1.000005, 1.000005, 1]),
        np.array([[1, 0, np.inf], [0, 1, 0], [0, 0, 1]]),
    ],
)
def test_what_is_not_a_rigid_motion_is_refused(matrix: np.ndarray) -> None:
    with pytest.raises(ValueError, match="matrix"):
        Pose2.from_matrix(matrix)


@given(poses, points, points)
def test_rigid_through_finds_the_motion_of_a_segment(
    T: Pose2, p: tuple[float, float], q: tuple[float, float]
) -> None:
    if math.dist(p, q) > 0.1:
        found = rigid_through(p, q, T.apply(p), T.apply(q))
        np.testing.assert_allclose(found.apply((p, q)), T.apply((p, q)), atol=1e-6)


def test_rigid_through_shares_a_difference_of_length_between_both_ends() -> None:
    T = rigid_through((0, 0), (2, 0), (0, 0), (0, 3))
    np.testing.assert_allclose(T.apply([(0, 0), (2, 0)]), [(0, 0.5), (0, 2.5)], atol=1e-12)
