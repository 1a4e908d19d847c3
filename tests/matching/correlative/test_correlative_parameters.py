from dataclasses import FrozenInstanceError
from typing import Any

import pytest

from mapmeld.matching.correlative import CorrelativeParameters


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("accept_probability", 0.5),
        ("accept_probability", 1.0),
        ("accept_probability", float("nan")),
        ("hypotheses", 0),
        ("hypotheses", 41),
        ("hypotheses", 2.5),
    ],
)
def test_values_out_of_range_are_named(name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=name):
        CorrelativeParameters(**{name: value})


def test_the_ends_of_the_ranges_are_allowed() -> None:
    for n in (1, 40):
        assert CorrelativeParameters(hypotheses=n).hypotheses == n
    assert CorrelativeParameters(accept_probability=0.51).accept_probability == 0.51


def test_settings_do_not_change() -> None:
    with pytest.raises(FrozenInstanceError):
        CorrelativeParameters().hypotheses = 3  # type: ignore[misc]
