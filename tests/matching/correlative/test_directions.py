import math

import numpy as np
import pytest
from drawing import office, school, seen_from
from hypothesis import given, settings
from hypothesis import strategies as st
from ready import reduced

from mapmeld.matching.correlative.directions import (
    BINS,
    direction_spectrum,
    main_direction,
    relative_directions,
)
from mapmeld.se2 import Pose2

RIGHT_ANGLE = math.pi / 2


def apart(one: float, other: float) -> float:
    """Degrees between directions modulo a right angle."""
    return abs(math.degrees(math.remainder(one - other, RIGHT_ANGLE)))


@settings(max_examples=20)
@given(st.floats(-math.pi, math.pi))
def test_the_lag_of_two_spectra_is_the_rotation_modulo_a_right_angle(turn: float) -> None:
    # T_b_a turns a by `turn`: b must be turned back by it to lie on a.
    a, b = reduced(office()), reduced(seen_from(office(), Pose2(2, -7, turn)))
    lags = relative_directions(a.spectrum, b.spectrum)
    assert apart(lags[0][0], -turn) < 1.5
    assert [weight for _, weight in lags] == sorted((weight for _, weight in lags), reverse=True)


@pytest.mark.parametrize("degrees", [0.0, 13.0, 44.0, 45.0, 60.0, 89.0])
def test_the_main_direction_is_that_of_the_walls(degrees: float) -> None:
    turned = reduced(seen_from(school(), Pose2(0, 0, math.radians(degrees))))
    assert apart(turned.main_direction, math.radians(degrees)) < 1.5
    assert 0 <= turned.main_direction < RIGHT_ANGLE


def test_a_spectrum_counts_walls_by_their_length_whichever_way_they_run() -> None:
    wall = np.zeros((200, 200), np.uint8)
    wall[50, 20:180] = 255  # normals point up and down: 90 degrees
    wall[100:140, 100] = 255  # a quarter as long, normals at 0 and 180 degrees
    spectrum = direction_spectrum(wall, 0.2)
    assert spectrum.shape == (BINS,)
    assert spectrum.min() >= 0
    quarter = BINS // 4
    up = spectrum[2 * quarter - 8 : 2 * quarter + 8].sum()
    sideways = spectrum[:8].sum() + spectrum[-8:].sum()
    assert up / sideways == pytest.approx(4, rel=0.2)
    assert up + sideways > 0.8 * spectrum.sum()


def test_a_map_turned_by_a_whole_bin_turns_its_spectrum() -> None:
    rng = np.random.default_rng(0)
    spectrum = np.convolve(rng.random(BINS) ** 8, np.ones(5), "same")
    for lag in (0, 3, 50, 179):
        found = relative_directions(np.roll(spectrum, lag), spectrum)[0][0]
        assert apart(found, lag * math.pi / BINS) < 0.1


def test_without_any_direction_there_is_still_an_answer() -> None:
    flat = np.ones(BINS)
    for pair in ((flat, flat), (np.zeros(BINS), np.zeros(BINS)), (np.zeros(BINS), flat)):
        lags = relative_directions(*pair)
        assert lags
        assert all(math.isfinite(v) for lag in lags for v in lag)
    assert math.isfinite(main_direction(np.zeros(BINS)))
    assert direction_spectrum(np.zeros((5, 5), np.uint8), 0.2).sum() == 0
