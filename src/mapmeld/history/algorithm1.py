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
        self._method = method
        self._parameters = parameters

    def update(self, maps: Maps, previous: Maps | None) -> Finding:
        """Take delta_1 and delta_2, at least one of them new. No earlier map is needed."""
        del previous
        before = self.best
        Lambda = self._on_new_maps(before, maps)
        current = match(*maps, self._method, self._parameters)
        self.best = more_similar(Lambda, current)
        return _finding(before, Lambda, self.best, maps)

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
            verdict=best.verdict if enough else Verdict.REJECTED,
        )


def more_similar(previous: MatchResult | None, current: MatchResult) -> MatchResult:
    """Return the current matching if it is more similar than the previous best (lines 15 to 18)."""
    if previous is None or (current.T_a_b is not None and current.similarity > previous.similarity):
        return current
    return previous


def _finding(
    before: MatchResult | None, previous: MatchResult | None, best: MatchResult, maps: Maps
) -> Finding:
    """Say in words what became of the best matching: as it was, on the new maps, and now."""
    accepted = best.verdict is Verdict.ACCEPTED
    standing = Standing.ACCEPTED if accepted else Standing.UNDECIDED
    if best.T_a_b is None:
        return Finding(best, standing, Change.NONE, best.reason, Work.SEARCH)
    similarity = f"similarity {best.similarity:.3f}"
    if previous is None or previous.T_a_b is None:
        change, why = Change.FOUND, f"{similarity}: the first matching"
    elif best is previous:
        change, why = (
            Change.CONFIRMED,
            f"{similarity} on the new maps: higher than that of their own matching",
        )
    else:
        rises = f"{similarity}: higher than the {previous.similarity:.3f} of the best so far on the new maps"
        same = same_place(previous.T_a_b, best.T_a_b, maps)
        change = Change.CONFIRMED if same else Change.SWITCHED
        why = f"{rises}; {moved(previous.T_a_b, best.T_a_b, maps)}"
    if before is not None and before.verdict is Verdict.ACCEPTED and not accepted:
        change, why = Change.WITHDRAWN, f"{why}, but not accepted"
    return Finding(best, standing, change, why, Work.SEARCH)
