"""Recordings in the order of their stamps."""

from __future__ import annotations

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.io.in_order import InOrder


def given_on(stamps: list[float], repeats: bool = False) -> tuple[list[float], Counter[str]]:
    left_out: Counter[str] = Counter()
    order = InOrder[int]("a word", left_out, repeats=repeats)
    found = [one for number, stamp in enumerate(stamps) for one in order.add(stamp, number)]
    found += order.rest()
    assert order.rest() == []
    assert all(stamps[number] == stamp for stamp, number in found)
    return [stamp for stamp, _ in found], left_out


@pytest.mark.parametrize(
    ("stamps", "expected"),
    [
        ([1, 2, 9, 3, 4], [1, 2, 3, 4]),  # one too late
        ([9, 1, 2], [1, 2]),
        ([1, 2, 9], [1, 2, 9]),  # nothing says that this is wrong
        ([5, 6, 1, 7], [5, 6, 7]),  # one too early
        ([5, 6, 7, 1, 2, 3], [5, 6, 7]),  # a clock that was set back
    ],
)
def test_single_stamps_that_are_wrong(stamps: list[float], expected: list[float]) -> None:
    assert given_on(stamps)[0] == expected


def test_repeats() -> None:
    assert given_on([1, 1, 2]) == ([1, 2], {"a word that is no later than the one before it": 1})
    assert given_on([1, 1, 2], repeats=True) == ([1, 1, 2], {})


@given(st.lists(st.integers(0, 20).map(float)), st.booleans())
def test_what_is_given_on_is_in_order_and_the_rest_is_counted(stamps: list[float], repeats: bool) -> None:
    found, left_out = given_on(stamps, repeats)
    assert found == sorted(found)
    assert repeats or len(set(found)) == len(found)
    assert len(found) + left_out.total() == len(stamps)


@given(st.lists(st.integers(0, 100), min_size=2, unique=True).map(sorted), st.data())
def test_one_stamp_too_late_costs_itself_alone(numbers: list[int], data: st.DataObject) -> None:
    wrong = data.draw(st.integers(0, len(numbers) - 2))
    stamps = [1e9 if n == wrong else float(v) for n, v in enumerate(numbers)]
    assert given_on(stamps)[0] == [float(v) for n, v in enumerate(numbers) if n != wrong]
