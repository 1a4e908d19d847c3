import gc
import weakref

import pytest
from drawing import drawn

from mapmeld.grid import OccupancyGrid
from mapmeld.matching.per_map import PerMap


class Counted:
    """The width of a map, and how often it was asked for."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, grid: OccupancyGrid) -> list[int]:
        self.calls += 1
        return [grid.shape[1]]


@pytest.fixture
def counted() -> Counted:
    return Counted()


def test_a_map_is_looked_at_once(counted: Counted) -> None:
    widths = PerMap(counted)
    grid = drawn("...")
    assert widths(grid) is widths(grid)
    assert widths(grid) == [3]
    assert counted.calls == 1


def test_an_equal_map_that_is_another_object_is_looked_at_anew(counted: Counted) -> None:
    widths = PerMap(counted)
    one, other = drawn("..."), drawn("...")
    assert one == other
    assert widths(one) is not widths(other)
    assert counted.calls == 2
    assert widths(one) is widths(one)  # neither pushes the other out
    assert widths(other) is widths(other)
    assert counted.calls == 2


def test_nothing_is_remembered_of_maps_that_are_gone() -> None:
    grid, kept = drawn("..."), drawn(".")
    held = PerMap(Value.of)
    value = weakref.ref(held(grid))
    held(kept)
    gone = weakref.ref(grid)
    del grid
    gc.collect()
    assert gone() is None  # remembering does not keep a map alive
    assert value() is None  # and what was remembered goes with it
    assert len(held._known) == 1
    assert held(kept) is held(kept)


class Value:
    """Something that can be referred to weakly."""

    def __init__(self, what: object) -> None:
        self.what = what

    @classmethod
    def of(cls, grid: OccupancyGrid) -> "Value":
        return cls(grid.shape)


def test_a_new_map_at_the_place_of_an_old_one_is_not_taken_for_it(counted: Counted) -> None:
    widths = PerMap(counted)
    seen = set()
    for width in range(1, 200):
        grid = drawn("." * width)
        seen.add(id(grid))
        assert widths(grid) == [width]
        del grid
    assert len(seen) < 199  # Python did use a place again, else nothing was tested


def test_a_stale_entry_is_not_believed(counted: Counted) -> None:
    # An id may be used again before the weak reference's callback has run.
    widths = PerMap(counted)
    old, new = drawn("..."), drawn(".....")
    widths(old)
    widths._known[id(new)] = widths._known[id(old)]
    assert widths(new) == [5]
    assert widths(new) == [5]
    assert counted.calls == 2


def test_none_is_remembered_too() -> None:
    calls: list[OccupancyGrid] = []
    nothing: PerMap[None] = PerMap(calls.append)
    grid = drawn(".")
    nothing(grid)
    nothing(grid)
    assert len(calls) == 1


def test_an_exception_is_not_remembered() -> None:
    def fails(grid: OccupancyGrid) -> int:
        calls.append(grid)
        if len(calls) == 1:
            raise RuntimeError("once")
        return 7

    calls: list[OccupancyGrid] = []
    once = PerMap(fails)
    grid = drawn(".")
    with pytest.raises(RuntimeError, match="once"):
        once(grid)
    assert once(grid) == 7
