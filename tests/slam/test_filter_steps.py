"""Motion noise, weights and resampling."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.se2 import Pose2
from mapmeld.slam.motion import motion_noise, moved, sample_motion
from mapmeld.slam.parameters import GMappingParameters
from mapmeld.slam.resampling import effective_size, low_variance, normalised

weights = st.lists(st.floats(0.001, 1.0), min_size=1, max_size=40).map(lambda w: np.array(w) / sum(w))


# ---------------------------------------------------------------- motion
@given(st.from_type(Pose2), st.from_type(Pose2))
def test_poses_move_in_their_own_frames(pose: Pose2, step: Pose2) -> None:
    found = moved(np.array([[pose.x, pose.y, pose.theta]]), np.array([step.x, step.y, step.theta]))[0]
    expected = pose @ step
    np.testing.assert_allclose(found[:2], (expected.x, expected.y), atol=1e-9)
    assert math.cos(found[2] - expected.theta) == pytest.approx(1.0)


def test_noise_is_in_proportion_to_the_motion() -> None:
    p = GMappingParameters(srr=0.1, srt=0.2, str=0.3, stt=0.4)
    np.testing.assert_allclose(motion_noise(Pose2(2.0, 0.0, 0.0), p), (0.2, 0.06, 0.4))
    np.testing.assert_allclose(motion_noise(Pose2(0.0, 0.0, -0.5), p), (0.15, 0.15, 0.2))
    np.testing.assert_allclose(motion_noise(Pose2(0.0, -1.0, 0.5), p), (0.03 + 0.15, 0.1 + 0.15, 0.4))


def test_samples_have_the_mean_and_the_spread_that_is_asked_for() -> None:
    step, p = Pose2(1.0, 0.5, 0.3), GMappingParameters()
    start = np.tile([3.0, -2.0, 1.1], (20_000, 1))
    found = sample_motion(start, step, p, np.random.default_rng(0))
    back = Pose2(3.0, -2.0, 1.1).inverse()
    x, y = back.apply(found[:, :2]).T
    sigma = motion_noise(step, p)
    samples = np.column_stack([x, y, found[:, 2] - 1.1])
    np.testing.assert_allclose(samples.mean(axis=0), (1.0, 0.5, 0.3), atol=4 * sigma.max() / 141)
    np.testing.assert_allclose(samples.std(axis=0), sigma, rtol=0.03)


def test_a_robot_that_stands_stays() -> None:
    poses = np.array([[1.0, 2.0, 3.0]])
    np.testing.assert_array_equal(
        sample_motion(poses, Pose2(), GMappingParameters(), np.random.default_rng(0)), poses
    )


# ---------------------------------------------------------------- weights
@given(st.lists(st.floats(-1e5, 0), min_size=1, max_size=40), st.floats(0.1, 10))
def test_weights_sum_to_one_and_keep_their_order(logs: list[float], smoothing: float) -> None:
    found = normalised(np.array(logs), smoothing)
    assert found.sum() == pytest.approx(1.0)
    assert found.argmax() == int(np.argmax(logs)) or found.max() == pytest.approx(found[np.argmax(logs)])
    assert (np.diff(found[np.argsort(logs, kind="stable")]) >= 0).all()


def test_smoothing_divides_the_logarithms_by_it_and_the_number_of_particles() -> None:
    found = normalised(np.array([0.0, -6.0]), 3.0)
    assert found[1] / found[0] == pytest.approx(math.exp(-1.0))


@given(weights)
def test_the_effective_size_lies_between_one_and_all(given_weights: np.ndarray) -> None:
    assert 1 - 1e-9 <= effective_size(given_weights) <= len(given_weights) + 1e-9


def test_the_effective_size_of_equal_weights_is_their_number() -> None:
    assert effective_size(np.full(8, 1 / 8)) == pytest.approx(8)
    assert effective_size(np.array([1.0, 0.0, 0.0])) == 1


@given(weights, st.floats(0.0, 1.0, exclude_max=True))
def test_each_particle_comes_up_its_expected_number_of_times(w: np.ndarray, offset: float) -> None:
    drawn = low_variance(w, offset)
    assert len(drawn) == len(w)
    assert (np.diff(drawn) >= 0).all()
    times = np.bincount(drawn, minlength=len(w))
    expected = w * len(w)
    assert (times >= np.floor(expected - 1e-9)).all()
    assert (times <= np.ceil(expected + 1e-9)).all()


def test_particles_without_weight_are_never_drawn() -> None:
    for offset in np.linspace(0, 0.999, 20):
        np.testing.assert_array_equal(low_variance(np.array([0.0, 1.0, 0.0, 0.0]), offset), [1, 1, 1, 1])
