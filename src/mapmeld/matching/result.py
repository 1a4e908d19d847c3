"""What a matcher answers: a transform together with the evidence for it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from mapmeld.se2 import Pose2


class Verdict(StrEnum):
    """What to do with a match. A wrong merge is worse than none, so only ACCEPTED may be merged."""

    ACCEPTED = "accepted"
    REJECTED = "rejected"
    AMBIGUOUS = "ambiguous"


@dataclass(frozen=True, slots=True)
class Alternative:
    """Another way the two maps could fit together (symmetric places have several).

    Attributes
    ----------
    T_a_b
        Takes a point of map b's metric frame into map a's.
    similarity
        Jaccard similarity of the obstacles under this transform, 0..1.
    probability
        Calibrated P(this transform is right); None if the method has no calibration.
    """

    T_a_b: Pose2
    similarity: float
    probability: float | None = None


@dataclass(frozen=True, slots=True)
class MatchResult:
    """How map b fits on map a, and how sure that is.

    Attributes
    ----------
    T_a_b
        Takes a point of map b's metric frame into map a's. The best guess, whatever the verdict;
        None where there was nothing to match on.
    verdict
        Whether to believe it.
    reason
        The verdict explained in words, with the figures it rests on.
    probability
        Calibrated P(T_a_b is right); None if the method has no calibration.
    similarity
        Jaccard similarity of the obstacles (paper, section 2.1.6), 0..1.
    overlap
        Area known in both maps under T_a_b / known area of the smaller map, 0..1.
    covariance
        3 x 3 covariance of (x, y, theta) of T_a_b [m, m, rad]; None if the method gives none.
    alternatives
        Other modes, best first, without the winner.
    method
        Name of the method that answered.
    seconds
        Wall time that the match took.
    """

    T_a_b: Pose2 | None
    verdict: Verdict
    reason: str
    probability: float | None = None
    similarity: float = 0.0
    overlap: float = 0.0
    covariance: NDArray[np.float64] | None = None
    alternatives: tuple[Alternative, ...] = ()
    method: str = ""
    seconds: float = 0.0
