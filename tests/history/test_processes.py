from collections.abc import Iterator

from drawing import drawn
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.grid import OccupancyGrid
from mapmeld.history.processes import in_time_order

Stamps = list[float | None]


def states(stamps: Stamps) -> list[OccupancyGrid]:
    return [OccupancyGrid(drawn("#").cells, 1.0, stamp=stamp) for stamp in stamps]


def order(first: Stamps, second: Stamps) -> list[tuple[int, float | None]]:
    return [(which, grid.stamp) for which, grid in in_time_order(states(first), states(second))]


def test_the_earlier_state_comes_first_and_of_one_moment_that_of_process_1() -> None:
    assert order([0, 5, 10], [5, 6]) == [(1, 0), (1, 5), (2, 5), (2, 6), (1, 10)]


def test_of_one_moment_all_of_process_1_come_first() -> None:
    assert [which for which, _ in order([3, 3, 3], [3, 3])] == [1, 1, 1, 2, 2]
    assert order([0, 3], [3, 3, 4]) == [(1, 0), (1, 3), (2, 3), (2, 3), (2, 4)]


def test_either_may_end_first_or_never_begin() -> None:
    assert order([0], [1, 2]) == [(1, 0), (2, 1), (2, 2)]
    assert order([1, 2], []) == [(1, 1), (1, 2)]
    assert order([], []) == []


def test_without_stamps_they_take_turns() -> None:
    assert [which for which, _ in order([None] * 3, [None] * 2)] == [1, 2, 1, 2, 1]
    assert [which for which, _ in order([7, 8], [None, None])] == [1, 2, 1, 2]


@given(
    st.lists(st.none() | st.floats(0, 100), max_size=8), st.lists(st.none() | st.floats(0, 100), max_size=8)
)
def test_no_state_is_lost_and_each_process_keeps_its_order(first: Stamps, second: Stamps) -> None:
    found = order(first, second)
    assert [stamp for which, stamp in found if which == 1] == first
    assert [stamp for which, stamp in found if which == 2] == second


def test_no_more_than_one_state_of_each_is_asked_for_ahead() -> None:
    asked = []

    def process(name: str) -> Iterator[OccupancyGrid]:
        for k, state in enumerate(states([0, 1, 2])):
            asked.append((name, k))
            yield state

    steps = in_time_order(process("a"), process("b"))
    next(steps)
    assert asked == [("a", 0), ("b", 0)]
    next(steps)
    assert asked == [("a", 0), ("b", 0), ("a", 1)]
