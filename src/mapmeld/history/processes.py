"""Two mapping processes as one sequence of states."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from mapmeld.grid import OccupancyGrid
from mapmeld.history.step import Which


def in_time_order(
    process_1: Iterable[OccupancyGrid], process_2: Iterable[OccupancyGrid]
) -> Iterator[tuple[Which, OccupancyGrid]]:
    """Give the states of both processes, the earlier first, each with its process.

    Of two states of the same moment that of process 1 comes first. Where a state has no stamp, the
    processes take turns. Either may end first. One state of each is held at a time.
    """
    states = (iter(process_1), iter(process_2))
    waiting = [next(states[0], None), next(states[1], None)]
    given = [0, 0]
    while True:
        first, second = waiting
        if first is None and second is None:
            return
        if first is None or second is None:
            index = 0 if second is None else 1
        elif first.stamp is None or second.stamp is None:
            index = 0 if given[0] <= given[1] else 1
        else:
            index = 0 if first.stamp <= second.stamp else 1
        state = waiting[index]
        assert state is not None
        yield 1 if index == 0 else 2, state
        given[index] += 1
        waiting[index] = next(states[index], None)
