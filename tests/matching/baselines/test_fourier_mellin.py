import math
from typing import Any

import numpy as np
import pytest
from drawing import office, seen_from
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mapmeld.matching import Verdict
from mapmeld.matching.baselines import FourierMellinParameters, fourier_mellin, match_fourier_mellin
from mapmeld.matching.baselines.evidence import Evidence
from mapmeld.matching.baselines.fourier_mellin import (
    Translations,
    drawn_walls,
    magnitudes_by_direction,
    rotations,
)
from mapmeld.se2 import Pose2

A = office()
B = seen_from(A, Pose2(2.0, -7.0, 0.7))
WALLS = Evidence.of(office(0.1), office(0.1)).walls_1_px - (80, 60)


def test_walls_are_drawn_about_the_middle_and_cut_at_the_edge() -> None:
    picture = drawn_walls(np.array([(0.5, 0.5), (-1.5, 0.5), (7.0, 0.0)]), 4)
    np.testing.assert_array_equal(picture, [[0, 0, 0, 0], [0, 0, 0, 0], [1, 0, 1, 0], [0, 0, 0, 0]])


def test_a_wall_between_pixels_is_shared() -> None:
    shared = drawn_walls(np.array([(0.0, 0.25)]), 4)
    np.testing.assert_allclose(shared[1:3, 1:3], [[0.125, 0.125], [0.375, 0.375]])
    assert shared.sum() == 1.0
    assert drawn_walls(np.array([(0.5, 0.5)] * 3), 4).max() == 1.0


@settings(max_examples=20)
@given(st.floats(0, math.pi))
@example(math.radians(1.75))  # where the lattice itself would answer 0, were the pictures not padded
def test_the_rotation_is_found(turn: float) -> None:
    one = magnitudes_by_direction(WALLS, 220, 360)
    two = magnitudes_by_direction(Pose2(3.0, -4.0, -turn).apply(WALLS), 220, 360)
    found = rotations(one, two, 1)[0]
    assert math.remainder(found - turn, math.pi) == pytest.approx(0, abs=math.radians(1))


@given(st.integers(-60, 60), st.integers(-60, 60))
def test_the_translation_is_found_with_the_height_of_an_equal_picture(x: int, y: int) -> None:
    found = Translations(WALLS, 400).best(WALLS - (x, y))
    assert found == pytest.approx((x, y, 1.0), abs=0.01)


def test_one_peak_is_the_publication_and_tries_one_rotation_and_its_half_turn_twin() -> None:
    result = match_fourier_mellin(A, B, FourierMellinParameters(rotation_peaks=1))
    assert len(result.alternatives) == 1
    assert result.verdict is Verdict.ACCEPTED


def test_maps_too_large_are_compared_on_larger_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fourier_mellin, "_MOST_PX", 256)
    result = match_fourier_mellin(A, B)
    assert result.T_a_b is not None
    metres, radians = (result.T_a_b @ Pose2(2.0, -7.0, 0.7)).distance_to(Pose2())
    assert metres < 0.3
    assert radians < math.radians(2)


def test_the_threshold_decides() -> None:
    believed = match_fourier_mellin(A, B)
    doubted = match_fourier_mellin(A, B, FourierMellinParameters(accept_response=1.0))
    assert (believed.verdict, doubted.verdict) == (Verdict.ACCEPTED, Verdict.REJECTED)
    assert doubted.T_a_b == believed.T_a_b
    assert "(threshold 1)" in doubted.reason
    assert "do not both suffice" in doubted.reason
    unlike = match_fourier_mellin(A, B, FourierMellinParameters(accept_index=1.0))
    assert unlike.verdict is Verdict.REJECTED


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("rotation_peaks", 0),
        ("directions", 7),
        ("cell", -0.1),
        ("cell", float("inf")),
        ("accept_response", 1.5),
        ("accept_index", -0.5),
    ],
)
def test_values_out_of_range_are_named(name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=name):
        FourierMellinParameters(**{name: value})
