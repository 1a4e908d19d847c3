"""The paper's Algorithm 1: the best matching so far, or the matching of the newest maps.

Source: "Map Matching for SLAM with Multiple Robots in Different Moments", Abstract, section 2.1 and
Algorithm 1. There is no verdict in it: whichever is more similar stays.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from mapmeld.grid import overlap_share
from mapmeld.history.step import Change, Finding, Maps, Standing, Work
from mapmeld.history.transforms import moved, same_place
from mapmeld.matching import MatchResult, Verdict, match, method_named
from mapmeld.se2 import Pose2


class Algorithm1:
    """The loop of Algorithm 1, which whoever holds the maps calls once for each new state.

    Attributes
    ----------
    best
        Capital lambda, the best current matching, with its similarity, capital psi. Probability and
        verdict are those of the states on which it was found; where the method accepts by a threshold on
        the similarity (`accept_similarity`), the updated one must reach it too.
    """

    def __init__(self, method: str, parameters: Any) -> None:
        self.best: MatchResult | None = None
        self._found = Verdict.REJECTED  # the verdict of the states on which `best` was found
        self._accepted: Pose2 | None = None  # the last one that was, though it be withdrawn
        self._method = method
        self._parameters = parameters

    def update(self, maps: Maps, previous: Maps | None) -> Finding:
        """Take delta_1 and delta_2, at least one of them new. No earlier map is needed."""
        del previous
        was_accepted = self.best is not None and self.best.verdict is Verdict.ACCEPTED
        Lambda = self._on_new_maps(self.best, maps)
        current = match(*maps, self._method, self._parameters)
        self.best = more_similar(Lambda, current)
        if self.best is current:
            self._found = current.verdict
        accepted = self.best.verdict is Verdict.ACCEPTED
        standing = Standing.ACCEPTED if accepted else Standing.UNDECIDED
        change = self._change(was_accepted, self.best, maps)
        if accepted:
            self._accepted = self.best.T_a_b
        why = _why(Lambda, self.best, maps)
        if was_accepted and not accepted:
            why += ", but not accepted"
        return Finding(self.best, standing, change, why, Work.SEARCH)

    def _on_new_maps(self, best: MatchResult | None, maps: Maps) -> MatchResult | None:
        """Re-score the best matching points of the previous iteration (Abstract)."""
        if best is None or best.T_a_b is None:
            return None
        similarity = method_named(self._method).similarity_at(*maps, best.T_a_b, self._parameters)
        enough = similarity >= getattr(self._parameters, "accept_similarity", 0.0)
        return replace(
            best,
            similarity=similarity,
            overlap=overlap_share(*maps, best.T_a_b),
            verdict=self._found if enough else Verdict.REJECTED,
        )

    def _change(self, was_accepted: bool, best: MatchResult, maps: Maps) -> Change:
        if best.verdict is not Verdict.ACCEPTED or best.T_a_b is None:
            return Change.WITHDRAWN if was_accepted else Change.NONE
        if self._accepted is None:
            return Change.FOUND
        if not same_place(self._accepted, best.T_a_b, maps):
            return Change.SWITCHED
        return Change.CONFIRMED if was_accepted else Change.FOUND


def more_similar(previous: MatchResult | None, current: MatchResult) -> MatchResult:
    """Return the current matching if it is more similar than the previous best (lines 15 to 18)."""
    if previous is None or (current.T_a_b is not None and current.similarity > previous.similarity):
        return current
    return previous


def _why(previous: MatchResult | None, best: MatchResult, maps: Maps) -> str:
    """Say in words how the best matching compares with the best so far, as that is on the new maps."""
    if best.T_a_b is None:
        return best.reason
    similarity = f"similarity {best.similarity:.3f}"
    if previous is None or previous.T_a_b is None:
        return f"{similarity}: the first matching"
    if best is previous:
        return f"{similarity} on the new maps: higher than that of their own matching"
    rises = f"{similarity}: higher than the {previous.similarity:.3f} of the best so far on the new maps"
    return f"{rises}; {moved(previous.T_a_b, best.T_a_b, maps)}"
