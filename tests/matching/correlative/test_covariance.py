import math
from dataclasses import replace

import numpy as np
import pytest
from drawing import around, built, cut, office, seen_from
from hypothesis import given, settings
from hypothesis import strategies as st
from ready import rows, walls_of

from mapmeld.matching.correlative.alignment import to_local
from mapmeld.matching.correlative.covariance import COVARIANCE_FLOOR, of_inverse, transform_covariance
from mapmeld.matching.correlative.wall_map import Doubles, WallMap
from mapmeld.se2 import Pose2

OFFICE = walls_of(office())
BEND = 0.05


def at_point(T: Pose2, covariance: Doubles, point: tuple[float, float]) -> Doubles:
    """Covariance (2, 2) of where T takes a point."""
    c, s = math.cos(T.theta), math.sin(T.theta)
    x, y = point
    J = np.array([[1, 0, -s * x - c * y], [0, 1, c * x - s * y]])
    return np.asarray(J @ covariance @ J.T)


def of_itself(walls: WallMap, bend: float = BEND) -> Doubles:
    return transform_covariance(walls, walls, np.zeros(3), bend)


def assert_covariance(covariance: Doubles) -> None:
    assert covariance.shape == (3, 3)
    np.testing.assert_allclose(covariance, covariance.T, rtol=1e-9, atol=1e-15)
    assert np.linalg.eigvalsh(covariance).min() > 0


@settings(max_examples=20)
@given(st.builds(Pose2, *[st.floats(-20, 20)] * 2, st.floats(-math.pi, math.pi)), st.floats(0, 0.5))
def test_it_is_a_covariance_wherever_the_maps_lie(T: Pose2, bend: float) -> None:
    covariance = transform_covariance(OFFICE, OFFICE, rows(T)[0], bend)
    assert_covariance(covariance)
    assert math.sqrt(covariance[2, 2]) >= COVARIANCE_FLOOR[1]


def test_an_office_is_fixed_in_all_directions() -> None:
    covariance = of_itself(OFFICE)
    middle = at_point(Pose2(), covariance, (8, 6))
    across = np.sqrt(np.linalg.eigvalsh(middle))
    assert across.max() < BEND
    assert across.max() < 3 * across.min()
    assert math.sqrt(covariance[2, 2]) < BEND / 6


@pytest.mark.parametrize("direction", [0.0, 0.5, math.pi / 2])
def test_along_a_corridor_it_is_large_and_across_small(direction: float) -> None:
    corridor = built(20, 2.2, [(0, 0, 20, 0.1), (0, 2.1, 20, 2.2)])
    T = Pose2(3, -4, direction)
    walls = walls_of(seen_from(corridor, T))
    middle = T.apply((10, 1.1))
    covariance = at_point(Pose2(), of_itself(walls), (float(middle[0]), float(middle[1])))
    values, axes = np.linalg.eigh(covariance)
    assert values[1] > 20 * values[0]
    assert abs(axes[:, 1] @ (math.cos(direction), math.sin(direction))) > 0.99
    assert math.sqrt(values[0]) < 0.5 * BEND < math.sqrt(values[1])


@pytest.mark.xfail(strict=True, reason="along a corridor it is in proportion to the bending, which may be 0")
def test_along_a_corridor_it_is_large_even_without_bending() -> None:
    walls = walls_of(built(20, 2.2, [(0, 0, 20, 0.1), (0, 2.1, 20, 2.2)]))
    covariance = of_itself(walls, 0.0)
    assert math.sqrt(covariance[0, 0]) > 0.1


def test_more_bending_and_less_wall_make_it_larger() -> None:
    size = [float(np.trace(of_itself(OFFICE, bend))) for bend in (0, 0.02, 0.1, 0.3)]
    assert size == sorted(size)
    assert size[-1] > 10 * size[0]
    small = walls_of(cut(office(), 0, 0, 6, 8))
    assert (
        at_point(Pose2(), of_itself(small), (3, 4)).trace()
        > at_point(Pose2(), of_itself(OFFICE), (8, 6)).trace()
    )


def test_it_does_not_shrink_as_more_points_are_looked_at() -> None:
    # Neighbouring points share what is wrong with a map: patches are samples, points are not.
    few, many = (transform_covariance(OFFICE, OFFICE, np.zeros(3), BEND, n) for n in (400, 1200))
    np.testing.assert_allclose(np.sqrt(np.diag(few)), np.sqrt(np.diag(many)), rtol=0.25)


def test_it_is_smallest_in_the_middle_of_the_walls() -> None:
    far = transform_covariance(OFFICE, replace(OFFICE, frame=Pose2(500, 0, 0)), np.zeros(3), BEND)
    near = of_itself(OFFICE)
    assert far[1, 1] > 100 * near[1, 1]  # the zero of b's frame is 500 m away: a turn swings it
    assert far[2, 2] == pytest.approx(near[2, 2])


@settings(max_examples=20)
@given(st.from_type(Pose2), st.from_type(Pose2))
def test_what_a_point_of_the_building_is_known_to_does_not_depend_on_frames(
    T_1_a: Pose2, T_2_b: Pose2
) -> None:
    a, b = replace(OFFICE, frame=T_1_a), replace(OFFICE, frame=T_2_b)
    T = T_1_a @ T_2_b.inverse()
    covariance = transform_covariance(a, b, to_local(a, b, T), BEND)
    x, y = T_2_b.apply((3.0, 9.0))
    c, s = math.cos(T_1_a.theta), math.sin(T_1_a.theta)
    R = np.array([[c, -s], [s, c]])
    expected = R @ at_point(Pose2(), of_itself(OFFICE), (3.0, 9.0)) @ R.T
    np.testing.assert_allclose(at_point(T, covariance, (float(x), float(y))), expected, rtol=1e-3, atol=1e-8)


@pytest.mark.parametrize("T", [Pose2(), Pose2(3, -2, 0.8), Pose2(-10, 4, 3.0), Pose2(0.5, 20, -1.6)])
def test_the_covariance_of_the_inverse_is_that_of_inverted_samples(T: Pose2) -> None:
    rng = np.random.default_rng(0)
    root = rng.normal(size=(3, 3)) * [[0.02], [0.03], [0.002]]
    covariance = root @ root.T
    samples = rng.multivariate_normal((T.x, T.y, T.theta), covariance, 40_000)
    inverses = rows(*(Pose2(*sample).inverse() for sample in samples))
    inverses[:, 2] = -samples[:, 2]  # without the jump at half a turn
    sampled = np.cov(inverses.T)
    found = of_inverse(T, covariance)
    assert_covariance(found)
    scale = np.sqrt(np.outer(np.diag(sampled), np.diag(sampled)))
    np.testing.assert_allclose(found / scale, sampled / scale, atol=0.03)


@given(st.from_type(Pose2))
def test_inverting_twice_gives_it_back(T: Pose2) -> None:
    covariance = np.diag([1e-4, 4e-4, 1e-6])
    np.testing.assert_allclose(of_inverse(T.inverse(), of_inverse(T, covariance)), covariance, atol=1e-9)


def test_walls_that_do_not_meet_leave_everything_open() -> None:
    far = transform_covariance(OFFICE, OFFICE, np.array([100.0, 0, 0]), BEND)
    assert_covariance(far)
    near = transform_covariance(OFFICE, OFFICE, np.zeros(3), BEND)
    assert far[2, 2] > 10 * near[2, 2]


def test_a_room_is_known_better_than_one_of_its_walls() -> None:
    room, wall = (walls_of(built(10, 8, w)) for w in (around(10, 8), around(10, 8)[:1]))
    assert of_itself(room)[0, 0] < 0.1 * of_itself(wall)[0, 0]
