import math
from typing import Any

import numpy as np
import pytest
from drawing import office, seen_from
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.matching import Verdict
from mapmeld.matching.baselines import HoughSpectrumParameters, match_hough_spectrum
from mapmeld.matching.baselines.hough_spectrum import hough_spectrum, offset_along, rotations
from mapmeld.se2 import Pose2

# Walls of a room with a long side along x, as points.
ROOM = np.concatenate(
    [np.stack([np.arange(200), np.full(200, y)], axis=-1) for y in (0, 80)]
    + [np.stack([np.full(80, 60), np.arange(80)], axis=-1)]
).astype(float)


def test_the_spectrum_is_highest_along_the_normal_of_the_walls() -> None:
    spectrum = hough_spectrum(ROOM, 180)
    assert spectrum.argmax() == 90
    # Every wall is one line: the two long ones in one row of the transform, the short one in another.
    assert spectrum[90] == pytest.approx(2 * 200**2, rel=0.05)
    assert spectrum[0] == pytest.approx(80**2, rel=0.2)


def test_the_spectrum_is_nearly_as_before_when_the_map_is_moved() -> None:
    # Not exactly: lines fall differently between the bins, one pixel wide.
    moved = ROOM + np.array((1000.3, 1000.6))
    np.testing.assert_allclose(hough_spectrum(ROOM, 90), hough_spectrum(moved, 90), rtol=0.15)


@given(st.floats(0, math.pi))
def test_the_rotation_is_found(turn: float) -> None:
    turned = Pose2(theta=-turn).apply(ROOM)
    found = rotations(hough_spectrum(ROOM, 180), hough_spectrum(turned, 180), 1)[0]
    assert math.remainder(found - turn, math.pi) == pytest.approx(0, abs=math.radians(1))


@given(st.integers(-500, 500))
def test_the_offset_along_an_axis_is_found(offset: int) -> None:
    walls = np.array([3.5] * 50 + [40.5] * 70 + [52.5] * 20)
    assert offset_along(walls + offset, walls) == pytest.approx(offset, abs=0.01)


def test_the_threshold_decides() -> None:
    a = office()
    b = seen_from(a, Pose2(2.0, -7.0, 0.7))
    believed = match_hough_spectrum(a, b)
    doubted = match_hough_spectrum(a, b, HoughSpectrumParameters(accept_index=1.0))
    assert (believed.verdict, doubted.verdict) == (Verdict.ACCEPTED, Verdict.REJECTED)
    assert doubted.T_a_b == believed.T_a_b
    assert "below the threshold 1" in doubted.reason


@pytest.mark.parametrize(
    ("name", "value"),
    [("directions", 7), ("rotation_peaks", 0), ("accept_index", 1.1), ("accept_index", float("nan"))],
)
def test_values_out_of_range_are_named(name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=name):
        HoughSpectrumParameters(**{name: value})
