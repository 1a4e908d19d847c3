import numpy as np
import pytest

from mapmeld.matching.baselines.peaks import refined_peak, separate_peaks

CURVE = np.array([5.0, 1, 0, 3, 2, 4, 0, 4.5])


def test_the_highest_peaks_come_first_and_the_curve_is_a_ring() -> None:
    # 7 is not a maximum of its own: its neighbour 0 is higher.
    assert separate_peaks(CURVE, 3, 1) == [0, 5, 3]
    assert separate_peaks(CURVE, 1, 1) == [0]


def test_peaks_keep_their_distance() -> None:
    assert separate_peaks(CURVE, 3, 2) == [0, 5]
    assert separate_peaks(CURVE, 3, 3) == [0]


def test_a_constant_curve_has_one_peak() -> None:
    assert separate_peaks(np.zeros(6), 4, 6) == [0]


def test_a_peak_between_samples_is_refined() -> None:
    x = np.arange(10.0)
    assert refined_peak(-((x - 4.3) ** 2), 4) == pytest.approx(4.3)
    assert refined_peak(np.array([2.0, 1, 0, 1.5]), 0) == pytest.approx(-1 / 6)
    assert refined_peak(np.zeros(5), 2) == 2
