"""Following two mapping processes, state by state."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any, Protocol

from mapmeld.errors import MapmeldError
from mapmeld.grid import OccupancyGrid, check_resolutions
from mapmeld.history.algorithm1 import Algorithm1
from mapmeld.history.changes import same_map
from mapmeld.history.evidence_over_time import EvidenceOverTime, EvidenceParameters
from mapmeld.history.processes import in_time_order
from mapmeld.history.step import Change, Finding, Maps, Standing, Step, Which, Work
from mapmeld.io.history import read_history
from mapmeld.matching import DEFAULT_METHOD
from mapmeld.matching.match import checked_parameters

DEFAULT_STRATEGY = "evidence"

Process = Iterable[OccupancyGrid] | str | os.PathLike[str]


class UnknownStrategyError(MapmeldError):
    """There is no strategy of that name."""


class _Strategy(Protocol):
    def update(self, maps: Maps, previous: Maps | None) -> Finding: ...


def _algorithm1(method: str, parameters: Any, evidence: EvidenceParameters | None) -> _Strategy:
    if evidence is not None:
        raise ValueError("strategy 'paper' has no settings of evidence over time")
    return Algorithm1(method, parameters)


STRATEGIES: Mapping[str, Callable[[str, Any, EvidenceParameters | None], _Strategy]] = {
    "evidence": EvidenceOverTime,
    "paper": _algorithm1,
}


class Follower:
    """Keeps the match of two growing maps; holds the newest map of each process and no other.

    Parameters
    ----------
    method, parameters
        As for `mapmeld.match`.
    strategy
        ``evidence`` (`EvidenceOverTime`) or ``paper`` (`Algorithm1`).
    evidence
        Settings of strategy ``evidence``; None for the defaults.

    Raises
    ------
    UnknownMethodError, UnknownStrategyError
        No such method or strategy.
    TypeError, ValueError
        `parameters` is of another method's class; `evidence` is given with strategy ``paper``.
    """

    def __init__(
        self,
        method: str = DEFAULT_METHOD,
        parameters: object | None = None,
        strategy: str = DEFAULT_STRATEGY,
        evidence: EvidenceParameters | None = None,
    ) -> None:
        if strategy not in STRATEGIES:
            raise UnknownStrategyError(f"unknown strategy {strategy!r}: choose from {', '.join(STRATEGIES)}")
        self._strategy = STRATEGIES[strategy](method, checked_parameters(method, parameters), evidence)
        self._maps: tuple[OccupancyGrid | None, OccupancyGrid | None] = (None, None)
        self._states = (0, 0)
        self._finding = Finding(None, Standing.UNDECIDED, Change.NONE, "no map yet", Work.NOTHING)

    def update(self, which: Which, grid: OccupancyGrid) -> Step:
        """Take a new state of process 1 or 2 and say what it changes.

        Raises
        ------
        ResolutionError
            The maps' cell sizes differ by more than a factor of 100.
        TypeError, ValueError
            `grid` is not a map; `which` is neither 1 nor 2.
        """
        if which not in (1, 2):
            raise ValueError(f"there are processes 1 and 2, not {which!r}")
        if not isinstance(grid, OccupancyGrid):
            raise TypeError(f"a state must be an OccupancyGrid, not a {type(grid).__name__}")
        before = self._maps[which - 1]
        other = self._maps[2 - which]
        if other is not None:
            check_resolutions(grid, other)
        self._states = (self._states[0] + (which == 1), self._states[1] + (which == 2))
        if before is not None and same_map(before, grid):
            # The map at hand stays: what has been computed from it is remembered for that object.
            why = f"map {which} is as it was"
            self._finding = replace(self._finding, change=Change.NONE, why=why, work=Work.NOTHING)
        else:
            previous = self._maps
            self._maps = (grid, other) if which == 1 else (other, grid)
            self._finding = self._found(previous)
        return self._step(which, grid.stamp)

    def update_1(self, grid: OccupancyGrid) -> Step:
        """Take a new state of process 1."""
        return self.update(1, grid)

    def update_2(self, grid: OccupancyGrid) -> Step:
        """Take a new state of process 2."""
        return self.update(2, grid)

    def _found(self, previous: tuple[OccupancyGrid | None, OccupancyGrid | None]) -> Finding:
        map_1, map_2 = self._maps
        if map_1 is None or map_2 is None:
            missing = 1 if map_1 is None else 2
            return replace(self._finding, why=f"waiting for the first map of process {missing}")
        old_1, old_2 = previous
        both = None if old_1 is None or old_2 is None else (old_1, old_2)
        return self._strategy.update((map_1, map_2), both)

    def _step(self, which: Which, stamp: float | None) -> Step:
        found = self._finding
        return Step(
            number=sum(self._states),
            which=which,
            states=self._states,
            stamp=stamp,
            maps=self._maps,
            best=found.best,
            standing=found.standing,
            change=found.change,
            why=found.why,
            work=found.work,
        )


def follow(
    process_1: Process,
    process_2: Process,
    method: str = DEFAULT_METHOD,
    parameters: object | None = None,
    strategy: str = DEFAULT_STRATEGY,
    evidence: EvidenceParameters | None = None,
) -> Iterator[Step]:
    """Follow two mapping processes: after each new state, give the best match so far and what changed.

    Parameters
    ----------
    process_1, process_2
        The states of each process in time order, or the path of a history folder. Where states have
        stamps the earlier comes first, of the same moment those of process 1; otherwise the processes
        take turns; either may end first. The frame of a process must stay the same, all else (size,
        origin, the map itself) may change.
    method, parameters
        As for `mapmeld.match`.
    strategy
        ``evidence``: evidence over time; a verdict that may be withdrawn. ``paper``: Algorithm 1 of
        "Map Matching for SLAM with Multiple Robots in Different Moments"; the most similar matching stays.
    evidence
        Settings of strategy ``evidence``; None for the defaults.

    Yields
    ------
    Step
        One for each state. A state is read when its step is asked for.

    Raises
    ------
    UnknownMethodError, UnknownStrategyError
        No such method or strategy.
    MapFileError
        A history folder or (later, while iterating) a map in it cannot be read.
    ResolutionError
        While iterating: the maps' cell sizes differ by more than a factor of 100.
    """
    follower = Follower(method, parameters, strategy, evidence)
    states = in_time_order(_states_of(process_1), _states_of(process_2))
    return (follower.update(which, grid) for which, grid in states)


def _states_of(process: Process) -> Iterable[OccupancyGrid]:
    return read_history(process) if isinstance(process, str | os.PathLike) else process
