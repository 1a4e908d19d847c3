"""What following two mapping processes answers after each new state."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

from mapmeld.grid import OccupancyGrid
from mapmeld.matching import MatchResult
from mapmeld.se2 import Pose2

Which = Literal[1, 2]
"""A mapping process."""

Maps = tuple[OccupancyGrid, OccupancyGrid]
"""The newest map of process 1 and of process 2."""


class Standing(StrEnum):
    """What the states so far come to. Only while ACCEPTED may the maps be merged."""

    UNDECIDED = "undecided"
    ACCEPTED = "accepted"
    WITHDRAWN = "withdrawn"


class Change(StrEnum):
    """What a new state did to the match.

    NONE: nothing. FOUND: accepted, for the first time or again. CONFIRMED: it was accepted and stays.
    LOWERED: it stays, but the newest maps speak less for it (never said by strategy ``paper``).
    SWITCHED: another transform took its place. WITHDRAWN: it is accepted no more.
    """

    NONE = "none"
    FOUND = "found"
    CONFIRMED = "confirmed"
    LOWERED = "lowered"
    SWITCHED = "switched"
    WITHDRAWN = "withdrawn"


class Work(StrEnum):
    """What a new state cost: NOTHING, a CHECK of transforms known already, or a whole SEARCH."""

    NOTHING = "nothing"
    CHECK = "check"
    SEARCH = "search"


@dataclass(frozen=True, slots=True, eq=False)
class Finding:
    """What a strategy makes of the newest two maps; see `Step` for the fields."""

    best: MatchResult | None
    standing: Standing
    change: Change
    why: str
    work: Work


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """The answer after one new state.

    Attributes
    ----------
    number
        Counts the steps from 1.
    which
        The process that gave the new state.
    states
        How many states each process has given so far.
    stamp
        Time of the new state [s]; None if it has none.
    maps
        The newest map of each process; None as long as there is none.
    best
        The current best match, `T_a_b` from the frame of process 2 to that of process 1; None as long as
        there is nothing to match. Its verdict is ``accepted`` exactly while `standing` is.
    standing
        Whether to believe it, after all states so far.
    change
        What the new state did.
    why
        The change in words.
    work
        What the new state cost.
    """

    number: int
    which: Which
    states: tuple[int, int]
    stamp: float | None
    maps: tuple[OccupancyGrid | None, OccupancyGrid | None]
    best: MatchResult | None
    standing: Standing
    change: Change
    why: str
    work: Work

    @property
    def T_1_2(self) -> Pose2 | None:
        """The accepted transform from the frame of process 2 to that of process 1; None if none is."""
        accepted = self.best is not None and self.standing is Standing.ACCEPTED
        return self.best.T_a_b if accepted and self.best else None

    def merged(self, fusion: str = "colour") -> OccupancyGrid | None:
        """Return the newest maps merged in the frame of process 1; None while no match is accepted.

        Raises
        ------
        UnknownFusionError, MergeError
            As `mapmeld.merging.merge_aligned`.
        """
        from mapmeld.merging import merge_aligned

        map_1, map_2 = self.maps
        if self.T_1_2 is None or map_1 is None or map_2 is None:
            return None
        return merge_aligned([map_1, map_2], [Pose2(), self.T_1_2], fusion)
