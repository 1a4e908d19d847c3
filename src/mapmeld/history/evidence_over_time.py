"""The default strategy: evidence over time.

Successive states are no independent evidence: the newest maps show nearly all that the earlier ones
did. So probabilities are not multiplied up; that of the newest maps counts, and the past decides only
how much of it is asked for. A match that is accepted is checked at each new state where it lies, which
needs no search; a search is made while nothing is accepted, on contradiction, and when much has changed.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import Any

from mapmeld.grid import OccupancyGrid
from mapmeld.history.changes import changed_area
from mapmeld.history.step import Change, Finding, Maps, Standing, Work
from mapmeld.history.transforms import moved, same_place
from mapmeld.matching import DEFAULT_METHOD, Alternative, MatchResult, Verdict, match
from mapmeld.matching.correlative import CorrelativeParameters
from mapmeld.matching.correlative.assess import assess
from mapmeld.matching.correlative.matcher import LOOKED_AT
from mapmeld.se2 import Pose2
from mapmeld.wording import probability_text


@dataclass(frozen=True, slots=True, kw_only=True)
class EvidenceParameters:
    """How much evidence over time is asked for, and when maps are searched again.

    Attributes
    ----------
    keep_probability
        An accepted match is withdrawn where the newest maps make it less probable than this. (It is
        accepted from the method's `accept_probability`; between the two it is kept.)
    confirm_states
        So many states in a row must agree on a match before it replaces one that was accepted, or
        comes back after one was withdrawn;
    sure_probability
        or a single one that makes it this probable.
    search_change
        While a match is accepted, other transforms are searched for when so much of a map has changed
        since the last search, as a share of its known area then;
    undecided_change
        while none is, so much.
    remember_probability
        Transforms at least this probable are weighed again beside what a new search finds.
    """

    keep_probability: float = 0.5
    confirm_states: int = 2
    sure_probability: float = 0.97
    search_change: float = 0.25
    undecided_change: float = 0.03
    remember_probability: float = 0.01

    def __post_init__(self) -> None:
        for name in ("keep_probability", "sure_probability", "remember_probability"):
            if not 0.0 < getattr(self, name) < 1.0:
                raise ValueError(f"{name} must be above 0 and below 1, not {getattr(self, name)}")
        for name in ("search_change", "undecided_change"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) >= 0.0):
                raise ValueError(f"{name} must be a share from 0, not {getattr(self, name)}")
        if not (isinstance(self.confirm_states, int) and self.confirm_states >= 1):
            raise ValueError(f"confirm_states must be a whole number from 1, not {self.confirm_states}")


class EvidenceOverTime:
    """What the states so far come to; holds transforms and probabilities, no maps.

    Whatever method finds the transforms, the evidence of the walls weighs them
    (`mapmeld.matching.correlative.assess`), with those of the default method beside them, so that every
    method's match has a probability.
    """

    def __init__(self, method: str, parameters: Any, evidence: EvidenceParameters | None = None) -> None:
        self._method = method
        self._parameters = parameters
        self._judge = parameters if isinstance(parameters, CorrelativeParameters) else CorrelativeParameters()
        self._evidence = evidence or EvidenceParameters()
        self._standing = Standing.UNDECIDED
        self._best: MatchResult | None = None
        self._accepted: Pose2 | None = None  # the last one that was, though it be withdrawn
        self._candidate: Pose2 | None = None  # reaches the threshold, but is not accepted yet,
        self._agreed = 0  # for so many states
        self._searched: tuple[float, float] | None = None  # known areas at the last search [m^2],
        self._changed = (0.0, 0.0)  # and how much of the maps has changed since

    def update(self, maps: Maps, previous: Maps | None) -> Finding:
        """Take the newest two maps; `previous` are those of the call before."""
        started = time.perf_counter()
        if previous is not None:
            self._changed = (
                self._changed[0] + _change(previous[0], maps[0]),
                self._changed[1] + _change(previous[1], maps[1]),
            )
        newest, work = self._look(maps)
        if self._standing is Standing.ACCEPTED:
            best, change, why = self._uphold(newest, maps, previous)
        else:
            best, change, why = self._decide(newest, maps)
        if change in (Change.FOUND, Change.SWITCHED):
            self._standing = Standing.ACCEPTED
        elif change is Change.WITHDRAWN:
            self._standing = Standing.WITHDRAWN
        if self._standing is Standing.ACCEPTED:
            best = replace(best, verdict=Verdict.ACCEPTED)
            self._accepted, self._candidate, self._agreed = best.T_a_b, None, 0
        elif best.verdict is Verdict.ACCEPTED:
            best = replace(best, verdict=Verdict.AMBIGUOUS, reason=f"{best.reason}; {why}")
        self._best = replace(best, method=self._method, seconds=time.perf_counter() - started)
        return Finding(self._best, self._standing, change, why, work)

    # ------------------------------------------------------------------ what the newest maps say
    def _look(self, maps: Maps) -> tuple[MatchResult, Work]:
        """Weigh what is known already; search where that does not settle it."""
        known = self._known()
        if known and not self._much_changed():
            seen = assess(*maps, known, self._judge)
            if self._settled(seen, maps):
                return seen, Work.CHECK
        return self._search(maps), Work.SEARCH

    def _known(self) -> list[Pose2]:
        """Return the transforms to weigh again: the best, and its rivals.

        However unlikely they are, what they reach tells what chance reaches with these maps.
        """
        return [] if self._best is None else _modes_of(self._best)[:LOOKED_AT]

    def _worth_keeping(self) -> list[Pose2]:
        """Return those of them that a new search need not find again."""
        best = self._best
        if best is None or best.T_a_b is None:
            return []
        if self._standing is not Standing.ACCEPTED and not self._worth(best.probability):
            return []
        return [best.T_a_b, *(o.T_a_b for o in best.alternatives if self._worth(o.probability))]

    def _worth(self, probability: float | None) -> bool:
        return (probability or 0.0) >= self._evidence.remember_probability

    def _much_changed(self) -> bool:
        """Whether so much has changed since the last search that others may fit now."""
        if self._searched is None:
            return True
        accepted = self._standing is Standing.ACCEPTED
        share = self._evidence.search_change if accepted else self._evidence.undecided_change
        return any(
            changed > share * area for changed, area in zip(self._changed, self._searched, strict=True)
        )

    def _settled(self, seen: MatchResult, maps: Maps) -> bool:
        """Whether a search could not change much: accepted and still sure of it, or nowhere near."""
        if self._standing is Standing.ACCEPTED:
            return _probability_of(self._accepted, seen, maps) >= self._judge.accept_probability
        return (seen.probability or 0.0) < self._evidence.keep_probability

    def _search(self, maps: Maps) -> MatchResult:
        """Match afresh, and weigh together what that finds and what was known.

        A method that does not say how probable its answer is knows too few rivals, so those that the
        default method finds are weighed with it.
        """
        self._searched, self._changed = (maps[0].known_area, maps[1].known_area), (0.0, 0.0)
        fresh = match(*maps, self._method, self._parameters)
        found = _modes_of(fresh)[:LOOKED_AT]
        others = self._worth_keeping()
        if fresh.probability is None:
            others += _modes_of(match(*maps, DEFAULT_METHOD, self._judge))
        missed: list[Pose2] = []
        for T in others:
            if not any(same_place(T, other, maps) for other in (*found, *missed)):
                missed.append(T)
        if fresh.probability is not None and not missed:
            return fresh
        return assess(*maps, [*found, *missed], self._judge) if found or missed else fresh

    # ------------------------------------------------------------------ what that means
    def _uphold(
        self, newest: MatchResult, maps: Maps, previous: Maps | None
    ) -> tuple[MatchResult, Change, str]:
        """Hold the newest maps against the accepted match."""
        assert self._accepted is not None
        probability = _probability_of(self._accepted, newest, maps)
        if probability >= self._evidence.keep_probability:
            best = self._at_accepted(newest, probability, maps)
            assert best.T_a_b is not None
            drift = moved(self._accepted, best.T_a_b, maps)
            if probability >= self._judge.accept_probability:
                return best, Change.CONFIRMED, f"probability {_p(probability)} on the newest maps; {drift}"
            return best, Change.LOWERED, f"only {_p(probability)} probable on the newest maps; {drift}"
        lost = f"only {_p(probability)} probable on the newest maps"
        anew = None if previous is None else _started_anew(previous, maps)
        if anew is not None:
            lost += f", as map {anew} does not lie where it did: its mapping has started anew or was bent"
        if self._convinced(newest, maps):
            now = _p(newest.probability)
            assert newest.T_a_b is not None
            return (
                newest,
                Change.SWITCHED,
                (f"the old one is {lost}; another is {now}; {moved(self._accepted, newest.T_a_b, maps)}"),
            )
        return newest, Change.WITHDRAWN, lost

    def _decide(self, newest: MatchResult, maps: Maps) -> tuple[MatchResult, Change, str]:
        """See whether the newest maps suffice to accept a match."""
        if not self._convinced(newest, maps):
            if self._candidate is None:
                return newest, Change.NONE, newest.reason
            asked = self._evidence.confirm_states
            return (
                newest,
                Change.NONE,
                (
                    f"probability {_p(newest.probability)}, but after a withdrawn match {asked} states "
                    f"in a row must agree: {self._agreed} so far"
                ),
            )
        why = f"probability {_p(newest.probability)}: {newest.reason}"
        assert newest.T_a_b is not None
        if self._accepted is None:
            return newest, Change.FOUND, why
        if same_place(self._accepted, newest.T_a_b, maps):
            return newest, Change.FOUND, f"again, {why}"
        return newest, Change.SWITCHED, f"{moved(self._accepted, newest.T_a_b, maps)}, {why}"

    def _convinced(self, newest: MatchResult, maps: Maps) -> bool:
        """Count the states that agree, and say whether they are enough."""
        T, probability = newest.T_a_b, newest.probability or 0.0
        if T is None or probability < self._judge.accept_probability:
            self._candidate, self._agreed = None, 0
            return False
        agrees = self._candidate is not None and same_place(self._candidate, T, maps)
        self._candidate, self._agreed = T, self._agreed + 1 if agrees else 1
        first = self._accepted is None
        sure = probability >= self._evidence.sure_probability
        return first or sure or self._agreed >= self._evidence.confirm_states

    def _at_accepted(self, newest: MatchResult, probability: float, maps: Maps) -> MatchResult:
        """Return what is said of the accepted match, though another may explain a little more."""
        assert self._accepted is not None
        assert newest.T_a_b is not None
        if same_place(self._accepted, newest.T_a_b, maps):
            return newest
        alone = assess(*maps, [self._accepted], self._judge)
        rival = Alternative(newest.T_a_b, newest.similarity, newest.probability)
        others = (o for o in newest.alternatives if not same_place(self._accepted, o.T_a_b, maps))
        return replace(alone, probability=probability, alternatives=(rival, *others))


def _modes_of(result: MatchResult) -> list[Pose2]:
    """Return the transforms of an answer, the best first."""
    return [] if result.T_a_b is None else [result.T_a_b, *(other.T_a_b for other in result.alternatives)]


def _probability_of(T: Pose2 | None, newest: MatchResult, maps: Maps) -> float:
    """Return how probable the transform is, wherever it is in an answer; 0 if it is not in it."""
    if T is None or newest.T_a_b is None:
        return 0.0
    if same_place(T, newest.T_a_b, maps):
        return newest.probability or 0.0
    others = (other for other in newest.alternatives if same_place(T, other.T_a_b, maps))
    return max((other.probability or 0.0 for other in others), default=0.0)


def _change(before: OccupancyGrid, now: OccupancyGrid) -> float:
    return 0.0 if before is now else changed_area(before, now)


def _started_anew(previous: Maps, maps: Maps) -> int | None:
    """Return which map, if any, does not lie on its own state before, in one frame as both are."""
    for number, (before, now) in enumerate(zip(previous, maps, strict=True), start=1):
        if before is not now and not _lies_on(before, now):
            return number
    return None


def _lies_on(before: OccupancyGrid, now: OccupancyGrid) -> bool:
    there = assess(before, now, [Pose2()])
    sure = (there.probability or 0.0) >= 0.5
    return there.T_a_b is not None and sure and same_place(Pose2(), there.T_a_b, (before, now))


def _p(probability: float | None) -> str:
    return probability_text(probability or 0.0)
