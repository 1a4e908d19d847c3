import math
from typing import Any

import pytest

from mapmeld.matching.alphabet import AlphabetParameters


def test_defaults_are_the_papers() -> None:
    p = AlphabetParameters()
    assert (p.corners, p.corner_quality, p.relation_min_px, p.relation_max_share) == (30, 0.2, 18, 0.5)
    assert (p.distance_tolerance_px, p.angle_tolerance_deg) == (1.1, 1.1)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("corners", 1),
        ("corner_quality", 0.0),
        ("corner_quality", 1.5),
        ("corner_spacing_px", -1.0),
        ("relation_min_px", math.nan),
        ("relation_max_share", 0.0),
        ("distance_tolerance_px", -0.1),
        ("angle_tolerance_deg", 91.0),
        ("candidates", 0),
        ("median_px", 4),
        ("accept_similarity", 1.1),
    ],
)
def test_values_out_of_range_are_named(name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=name):
        AlphabetParameters(**{name: value})
