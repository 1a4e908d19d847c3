import re
from typing import Any

import numpy as np
import pytest
from drawing import drawn, office, seen_from
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.grid import OccupancyGrid
from mapmeld.matching import Verdict
from mapmeld.matching.baselines import FeatureOrbParameters, match_feature_orb
from mapmeld.matching.baselines.feature_pipeline import as_bytes, least_squares
from mapmeld.se2 import Pose2

A = office()
B = seen_from(A, Pose2(2.0, -7.0, 0.7))


def test_cells_are_seen_as_bytes() -> None:
    np.testing.assert_array_equal(as_bytes(drawn("#. \n  #")), [[255, 255, 100], [100, 0, 255]])


@given(st.from_type(Pose2))
def test_least_squares_finds_the_motion(T: Pose2) -> None:
    points = np.array([(0, 0), (10, 1), (4, 7)], float)
    metres, radians = least_squares(points, T.apply(points)).distance_to(T)
    assert metres < 1e-9
    assert radians < 1e-9


@given(st.floats(0.5, 2))
def test_least_squares_shares_a_scale_about_the_middle(scale: float) -> None:
    points = np.array([(0, 0), (10, 1), (5, 8)], float)
    T = Pose2(3, -2, 0.4)
    found = least_squares(points, T.apply(points * scale))
    assert found.theta == pytest.approx(0.4)
    np.testing.assert_allclose(found.apply((5, 3)), T.apply(np.array((5, 3)) * scale))


def test_the_threshold_decides() -> None:
    believed = match_feature_orb(A, B)
    doubted = match_feature_orb(A, B, FeatureOrbParameters(accept_confidence=10))
    assert believed.verdict is Verdict.ACCEPTED
    assert doubted.verdict is Verdict.REJECTED
    assert doubted.T_a_b == believed.T_a_b
    assert "below the threshold 10" in doubted.reason


def test_the_reason_names_the_scale_that_the_rigid_answer_leaves_out() -> None:
    # Cells of 4 cm said to be of 5 cm: map b seems a quarter larger than it is.
    swollen = OccupancyGrid(office(0.04).cells, 0.05)
    result = match_feature_orb(A, swollen)
    found = re.search(r"scale ([0-9.]+)", result.reason)
    assert found
    assert float(found[1]) == pytest.approx(0.8, abs=0.02)
    assert result.T_a_b is not None
    assert abs(result.T_a_b.theta) < 0.02


def test_maps_too_small_for_features_are_rejected_with_the_reason() -> None:
    box = drawn("\n".join(["#" * 15] * 15), 0.1)
    assert "map a is less than 16 cells wide" in match_feature_orb(box, A).reason
    square = drawn("\n".join(["#" * 40] * 40), 0.1)
    assert "map b has 0 features" in match_feature_orb(A, square).reason


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("features", 1),
        ("match_conf", 1.0),
        ("match_conf", float("nan")),
        ("accept_confidence", -1.0),
        ("accept_confidence", float("inf")),
        ("seed", -1),
    ],
)
def test_values_out_of_range_are_named(name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=name):
        FeatureOrbParameters(**{name: value})
