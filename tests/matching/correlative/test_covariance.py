"""The best rigid motion and how exactly it is known: its covariance against errors that are known."""

import math
from dataclasses import replace

import numpy as np
import pytest
from bent_maps import bent, best_transform, drift, part
from drawing import around, built, cut, office, school, seen_from
from hypothesis import given, settings
from hypothesis import strategies as st
from ready import rows, walls_of
from scipy.stats import chi2

import mapmeld
from mapmeld.grid import OccupancyGrid
from mapmeld.matching import Verdict
from mapmeld.matching.correlative.alignment import to_local, to_metric
from mapmeld.matching.correlative.covariance import COVARIANCE_FLOOR, best_fit, of_inverse
from mapmeld.matching.correlative.wall_map import Doubles, WallMap
from mapmeld.se2 import Pose2

FINE = office(0.02)
OFFICE = walls_of(office())


def at_point(T: Pose2, covariance: Doubles, point: tuple[float, float]) -> Doubles:
    """Covariance (2, 2) of where T takes a point."""
    c, s = math.cos(T.theta), math.sin(T.theta)
    x, y = point
    J = np.array([[1, 0, -s * x - c * y], [0, 1, c * x - s * y]])
    return np.asarray(J @ covariance @ J.T)


def of_itself(walls: WallMap, overlap: float = 0.5) -> Doubles:
    """Covariance of a map laid on itself, of which this is said to be the share in common."""
    return best_fit(walls, walls, np.zeros(3), overlap)[1]


def as_two_robots_draw_it(metres: float, seed: int = 0) -> tuple[WallMap, WallMap]:
    rng = np.random.default_rng(seed)
    a, b = (bent(FINE, drift(FINE, metres, 3.0, rng), Pose2(), 0.05) for _ in range(2))
    return walls_of(a), walls_of(b)


def assert_covariance(covariance: Doubles) -> None:
    assert covariance.shape == (3, 3)
    np.testing.assert_allclose(covariance, covariance.T, rtol=1e-9, atol=1e-15)
    assert np.linalg.eigvalsh(covariance).min() > 0


# ---------------------------------------------------------------------- consistent with the errors
def normalised_error(seed: int, metres: float, shared: float) -> float | None:
    """Squared normalised error of one simulated pair; None if it is not accepted.

    Two robots draw the same building, each bent by `metres`, and see `1 - shared` of it alone.
    """
    rng = np.random.default_rng(seed)
    place = (FINE, school(0.02))[seed % 2]
    u_a, u_b = (drift(place, metres, 3.0, rng) for _ in range(2))
    T_a, T_b = (Pose2(*map(float, rng.uniform(-4, 4, 3))) for _ in range(2))
    upright = bool(rng.integers(2))
    seen_a, seen_b = part(place, 0, shared, upright), part(place, 1 - shared, 1, upright)
    truth = best_transform(part(seen_a, 1 - shared, 1, upright), u_a, T_a, u_b, T_b)
    result = mapmeld.match(bent(seen_a, u_a, T_a, 0.05), bent(seen_b, u_b, T_b, 0.05))
    if result.verdict is not Verdict.ACCEPTED:
        return None
    assert result.T_a_b is not None
    assert result.covariance is not None
    T = result.T_a_b
    e = np.array([T.x - truth.x, T.y - truth.y, math.remainder(T.theta - truth.theta, math.tau)])
    return float(e @ np.linalg.solve(result.covariance, e))


@pytest.mark.parametrize("shared", [1.0, 0.75])
@pytest.mark.parametrize("metres", [0.02, 0.04])
def test_errors_on_simulated_maps_are_as_large_as_stated(metres: float, shared: float) -> None:
    found = [normalised_error(seed, metres, shared) for seed in range(24)]
    errors = np.array([error for error in found if error is not None])
    assert len(errors) >= 20
    # Drawn places are no recordings: within a factor of 1.7 of the standard deviation, either way.
    assert 1 / 1.7**2 < errors.mean() / 3 < 1.7**2
    assert (errors < chi2.ppf(0.9, 3)).mean() > 0.6


def test_a_bent_map_is_fitted_as_a_whole() -> None:
    # One end of a building is off by 0.3 m: nothing but the middle way is right for all of it.
    place = school(0.02)
    along = np.linspace(0, 1, place.shape[1])
    u = np.zeros((*place.shape, 2))
    u[..., 1] = 0.3 * np.where(along > 0.5, along - 0.5, 0)
    still = np.zeros_like(u)
    truth = best_transform(place, still, Pose2(), u, Pose2())
    result = mapmeld.match(bent(place, still, Pose2(), 0.05), bent(place, u, Pose2(), 0.05))
    assert result.T_a_b is not None
    middle = np.array([10.0, 4.5])
    assert np.hypot(*(result.T_a_b.apply(middle) - truth.apply(middle))) < 0.015
    assert math.degrees(result.T_a_b.distance_to(truth)[1]) < 0.1


def test_a_transform_off_by_little_is_put_right() -> None:
    for start in ([0.1, -0.05, 0.0], [-0.05, 0.0, 0.01], [0.0, 0.1, -0.005]):
        t, _ = best_fit(OFFICE, OFFICE, np.array(start), 1.0)
        np.testing.assert_allclose(t, 0, atol=0.02)
        again, _ = best_fit(OFFICE, OFFICE, t, 1.0)
        np.testing.assert_allclose(again, 0, atol=0.002)


# ---------------------------------------------------------------------- what it depends on
@settings(max_examples=20)
@given(
    st.builds(Pose2, *[st.floats(-20, 20)] * 2, st.floats(-math.pi, math.pi)),
    st.floats(0, 1.5),
)
def test_it_is_a_covariance_wherever_the_maps_lie(T: Pose2, overlap: float) -> None:
    t, covariance = best_fit(OFFICE, OFFICE, rows(T)[0], overlap)
    assert np.isfinite(t).all()
    assert_covariance(covariance)
    assert math.sqrt(covariance[2, 2]) >= COVARIANCE_FLOOR[1]


def test_an_office_is_fixed_in_all_directions() -> None:
    covariance = best_fit(*as_two_robots_draw_it(0.05), np.zeros(3), 0.5)[1]
    across = np.sqrt(np.linalg.eigvalsh(at_point(Pose2(), covariance, (8, 6))))
    assert across.max() < 0.05
    assert across.max() < 3 * across.min()
    assert math.sqrt(covariance[2, 2]) < 0.05 / 6


@pytest.mark.parametrize("direction", [0.0, 0.5, math.pi / 2])
def test_along_a_corridor_it_is_large_and_across_small(direction: float) -> None:
    corridor = built(20, 2.2, [(0, 0, 20, 0.1), (0, 2.1, 20, 2.2)])
    T = Pose2(3, -4, direction)
    walls = walls_of(seen_from(corridor, T))
    middle = T.apply((10, 1.1))
    covariance = at_point(Pose2(), of_itself(walls), (float(middle[0]), float(middle[1])))
    values, axes = np.linalg.eigh(covariance)
    assert values[1] > 100 * values[0]
    assert abs(axes[:, 1] @ (math.cos(direction), math.sin(direction))) > 0.99
    assert math.sqrt(values[0]) < 0.02
    assert 0.2 < math.sqrt(values[1]) < 1


def test_what_nothing_fixes_stays_where_it_was() -> None:
    walls = walls_of(built(20, 2.2, [(0, 0, 20, 0.1), (0, 2.1, 20, 2.2)]))
    t, _ = best_fit(walls, walls, np.array([0.4, 0.05, 0.0]), 1.0)
    np.testing.assert_allclose(t, [0.4, 0, 0], atol=0.02)


def test_more_bending_makes_it_larger() -> None:
    size = [float(np.trace(best_fit(*as_two_robots_draw_it(m), np.zeros(3), 0.7)[1])) for m in (0, 0.03, 0.1)]
    assert size == sorted(size)
    assert size[-1] > 10 * size[0]


def test_less_wall_makes_it_larger() -> None:
    a, b = (seen_from(cut(grid, 0, 0, 8, 8), Pose2()) for grid in (office(), shaken(0.05)))
    small = best_fit(walls_of(a), walls_of(b), np.zeros(3), 0.5)[1]
    whole = best_fit(OFFICE, walls_of(shaken(0.05)), np.zeros(3), 0.5)[1]
    assert at_point(Pose2(), small, (4, 4)).trace() > at_point(Pose2(), whole, (8, 6)).trace()


def shaken(metres: float) -> OccupancyGrid:
    grid = bent(FINE, drift(FINE, metres, 3.0, np.random.default_rng(1)), Pose2(), 0.05)
    left, bottom = (round(v / 0.05) for v in (grid.origin.x, grid.origin.y))
    return grid.extended(left, bottom, 0, 0)


def test_a_whole_overlap_leaves_less_to_chance_than_a_part() -> None:
    a, b = as_two_robots_draw_it(0.03)
    size = [float(np.trace(best_fit(a, b, np.zeros(3), overlap)[1])) for overlap in (1.5, 1.0, 0.7, 0.3)]
    assert size[0] == size[1]
    assert size[1:] == sorted(size[1:])
    assert size[-1] > 2 * size[1]


def test_it_does_not_shrink_as_more_points_are_looked_at() -> None:
    # Neighbouring points share what is wrong with a map: patches are samples, points are not.
    a, b = as_two_robots_draw_it(0.05)
    few, many = (best_fit(a, b, np.zeros(3), 0.5, n)[1] for n in (400, 1200))
    np.testing.assert_allclose(np.sqrt(np.diag(few)), np.sqrt(np.diag(many)), rtol=0.35)


def test_it_is_smallest_in_the_middle_of_the_walls() -> None:
    far = best_fit(OFFICE, replace(OFFICE, frame=Pose2(500, 0, 0)), np.zeros(3), 0.5)[1]
    near = of_itself(OFFICE)
    assert far[1, 1] > 100 * near[1, 1]  # the zero of b's frame is 500 m away: a turn swings it
    assert far[2, 2] == pytest.approx(near[2, 2])


@settings(max_examples=20)
@given(st.from_type(Pose2), st.from_type(Pose2))
def test_what_a_point_of_the_building_is_known_to_does_not_depend_on_frames(
    T_1_a: Pose2, T_2_b: Pose2
) -> None:
    a, b = replace(OFFICE, frame=T_1_a), replace(OFFICE, frame=T_2_b)
    t, covariance = best_fit(a, b, to_local(a, b, T_1_a @ T_2_b.inverse()), 0.5)
    x, y = T_2_b.apply((3.0, 9.0))
    c, s = math.cos(T_1_a.theta), math.sin(T_1_a.theta)
    R = np.array([[c, -s], [s, c]])
    expected = R @ at_point(Pose2(), of_itself(OFFICE), (3.0, 9.0)) @ R.T
    found = at_point(to_metric(a, b, t), covariance, (float(x), float(y)))
    np.testing.assert_allclose(found, expected, rtol=1e-2, atol=1e-7)


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
    t, far = best_fit(OFFICE, OFFICE, np.array([100.0, 0, 0]), 0.0)
    assert_covariance(far)
    assert t.tolist() == [100, 0, 0]
    assert math.sqrt(far[2, 2]) > 0.05
    assert far[2, 2] > 10 * of_itself(OFFICE)[2, 2]


def test_a_room_is_known_better_than_one_of_its_walls() -> None:
    room, wall = (walls_of(built(10, 8, w)) for w in (around(10, 8), around(10, 8)[:1]))
    assert of_itself(room)[0, 0] < 0.1 * of_itself(wall)[0, 0]
