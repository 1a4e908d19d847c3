"""Two robots of a fleet: their match over time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from mapmeld.errors import MapmeldError
from mapmeld.grid import check_resolutions
from mapmeld.history import EvidenceParameters, Standing
from mapmeld.history.evidence_over_time import EvidenceOverTime
from mapmeld.history.step import Finding, Maps
from mapmeld.history.transforms import same_place
from mapmeld.live.state import Decree
from mapmeld.matching import MatchResult, Verdict
from mapmeld.merging.graph.edges import MOST_SURE


class Pair:
    """The match of two robots' maps; as `mapmeld.history.Follower`, but both maps may be new at once.

    Attributes
    ----------
    decree
        What a user has said.
    maps
        Those of the last look; None before.
    turn
        When it was last looked at, as a count of looks at any pair.
    """

    def __init__(self, method: str, parameters: Any, evidence: EvidenceParameters | None) -> None:
        self._settings = (method, parameters, evidence)
        self.decree = Decree.NONE
        self.start_anew("not looked at yet")

    def start_anew(self, why: str, *, withdrawn: bool = False) -> None:
        """Forget all matches; what a user forbade stays forbidden, as it was said of the two robots."""
        self._strategy = EvidenceOverTime(*self._settings)
        self.maps: Maps | None = None
        self.finding: Finding | None = None
        self.turn = 0
        self._confirmed: MatchResult | None = None
        if self.decree is Decree.CONFIRMED:
            self.decree = Decree.NONE
        self.withdrawn = withdrawn
        self.why = why

    def look(self, maps: Maps, turn: int) -> None:
        """Match the newest maps."""
        previous, self.maps, self.turn = self.maps, maps, turn
        decree, confirmed = self.decree, self._confirmed
        try:
            check_resolutions(*maps)
            self.finding = self._strategy.update(maps, previous)
            self.why = self.finding.why
            if self.finding.standing is not Standing.UNDECIDED:
                self.withdrawn = self.finding.standing is Standing.WITHDRAWN
        except MapmeldError as error:
            self.start_anew(str(error), withdrawn=self.withdrawn)
            self.maps, self.turn = maps, turn
            self.decree, self._confirmed = decree, confirmed

    def confirm(self) -> str | None:
        """Take the transform of the best match for right from now on; return why not, if there is none."""
        best = None if self.finding is None else self.finding.best
        if best is None or best.T_a_b is None:
            return "there is no match of the two yet that could be confirmed"
        self.decree, self._confirmed = Decree.CONFIRMED, best
        return None

    def forbid(self) -> None:
        """Never join the two by a match of theirs."""
        self.decree, self._confirmed = Decree.FORBIDDEN, None

    def release(self) -> None:
        """Take back what was said."""
        self.decree, self._confirmed = Decree.NONE, None

    @property
    def standing(self) -> Standing:
        """Whether the match is believed, after all states so far."""
        if self.withdrawn:  # also before a restart of one of the two
            return Standing.WITHDRAWN
        return Standing.UNDECIDED if self.finding is None else self.finding.standing

    @property
    def result(self) -> MatchResult | None:
        """The match as the graph of all pairs is to take it; None where it has no say."""
        best = None if self.finding is None else self.finding.best
        if self.decree is Decree.FORBIDDEN:
            return None
        if self._confirmed is None:
            return best
        # What was confirmed is this transform: a match follows the maps' drift, but never to another place.
        if best is None or best.verdict is not Verdict.ACCEPTED or not self._as_confirmed(best):
            best = self._confirmed
            if best.verdict is not Verdict.ACCEPTED:  # such a one's covariance is of a mode among others
                best = replace(best, covariance=None)
        return replace(
            best,
            verdict=Verdict.ACCEPTED,
            probability=max(best.probability or 0.0, MOST_SURE),
            reason="confirmed by the user",
            alternatives=(),
        )

    def _as_confirmed(self, result: MatchResult) -> bool:
        assert self._confirmed is not None
        one, other = self._confirmed.T_a_b, result.T_a_b
        if one is None or other is None or self.maps is None:
            return False
        return same_place(one, other, self.maps)
