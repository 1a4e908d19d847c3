"""How much a stated probability is worth.

Sources: reliability diagrams and the expected calibration error with bins of equal count after
Naeini, Cooper and Hauskrecht, "Obtaining Well Calibrated Probabilities Using Bayesian Binning" (AAAI
2015); the score of Brier, "Verification of forecasts expressed in terms of probability" (1950).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ReliabilityBin:
    """Answers of about the same stated probability.

    Attributes
    ----------
    count
        How many answers.
    stated
        Mean of their probabilities.
    observed
        Share of them that is right.
    """

    count: int
    stated: float
    observed: float

    def interval(self, z: float = 1.96) -> tuple[float, float]:
        """Return the Wilson score interval of the observed share, by default of 95 percent.

        Source: Wilson, "Probable inference, the law of succession, and statistical inference" (1927).
        """
        n, p = self.count, self.observed
        middle = (p + z * z / (2 * n)) / (1 + z * z / n)
        half = z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n)
        return max(0.0, middle - half), min(1.0, middle + half)


@dataclass(frozen=True, slots=True)
class PrecisionRecall:
    """What accepting from each of the occurring scores would give, from the strictest on.

    Attributes
    ----------
    threshold
        (n,) falling scores; from this score answers are accepted.
    precision
        (n,) share of the accepted that is right.
    recall
        (n,) accepted and right / all that there was to find.
    """

    threshold: Floats
    precision: Floats
    recall: Floats


def reliability(probability: ArrayLike, right: ArrayLike, bins: int = 10) -> tuple[ReliabilityBin, ...]:
    """Sort answers by their probability and sum them up in bins of equal count.

    Where the number of answers is no multiple of `bins`, the first bins hold one more. Answers of
    equal probability that fall into two bins count in each with their common share of right ones,
    so the outcome does not depend on the order of the answers.

    Parameters
    ----------
    probability
        (n,) stated probabilities, 0..1.
    right
        (n,) whether the answer was right.
    bins
        Number of bins; with fewer answers, one bin each. No answers, no bins.

    Raises
    ------
    ValueError
        The lengths differ, or a probability is not in 0..1.
    """
    if bins < 1:
        raise ValueError(f"at least one bin is needed, not {bins}")
    p, y = _checked(probability, right)
    if not p.size:
        return ()
    levels, level = np.unique(p, return_inverse=True)
    shares = np.bincount(level, weights=y) / np.bincount(level)
    order = np.sort(level)
    parts = np.array_split(order, min(bins, p.size))
    return tuple(
        ReliabilityBin(part.size, float(levels[part].mean()), float(shares[part].mean())) for part in parts
    )


def expected_calibration_error(probability: ArrayLike, right: ArrayLike, bins: int = 10) -> float | None:
    """Return the mean of |stated - observed| over the bins of `reliability`, weighted by their counts.

    None if there are no answers.
    """
    curve = reliability(probability, right, bins)
    if not curve:
        return None
    return sum(b.count * abs(b.stated - b.observed) for b in curve) / sum(b.count for b in curve)


def brier_score(probability: ArrayLike, right: ArrayLike) -> float | None:
    """Return the mean squared difference of probability and outcome (1 right, 0 wrong); None if empty."""
    p, y = _checked(probability, right)
    return float(np.mean((p - y) ** 2)) if p.size else None


def precision_recall(score: ArrayLike, right: ArrayLike, to_find: int | None = None) -> PrecisionRecall:
    """Return the precision-recall curve of accepting by a score.

    Parameters
    ----------
    score
        (n,) probabilities or similarities: the higher, the surer.
    right
        (n,) whether the answer was right.
    to_find
        How many right answers there could have been: pairs of the same place. None counts only those
        that were found, whatever their score.
    """
    s, y = _sorted_by_score(score, right)
    total = int(y.sum()) if to_find is None else to_find
    if total < y.sum():
        raise ValueError(f"{int(y.sum())} right answers, but only {total} to find")
    if not s.size:
        return PrecisionRecall(s, s, s)
    last = np.append(np.flatnonzero(np.diff(s)), s.size - 1)  # equal scores are accepted together
    found = np.cumsum(y)[last]
    recall = found / total if total else np.zeros_like(found)
    return PrecisionRecall(s[last], found / (last + 1), recall)


def recall_without_wrong(score: ArrayLike, right: ArrayLike, to_find: int | None = None) -> float | None:
    """Return the greatest recall of any threshold that accepts no wrong answer.

    The parameters are those of `precision_recall`. None if there is nothing to find.
    """
    s, y = _sorted_by_score(score, right)
    total = int(y.sum()) if to_find is None else to_find
    if not total:
        return None
    wrong = s[y == 0]
    return float(np.count_nonzero(y[s > wrong.max()]) if wrong.size else y.sum()) / total


def _checked(probability: ArrayLike, right: ArrayLike) -> tuple[Floats, Floats]:
    p, y = np.asarray(probability, np.float64), np.asarray(right, np.float64)
    if p.ndim != 1 or p.shape != y.shape:
        raise ValueError(f"as many outcomes as probabilities are needed, not {y.shape} and {p.shape}")
    if not ((p >= 0) & (p <= 1)).all():
        raise ValueError("probabilities must be from 0 to 1")
    return p, y


def _sorted_by_score(score: ArrayLike, right: ArrayLike) -> tuple[Floats, Floats]:
    s, y = np.asarray(score, np.float64), np.asarray(right, np.float64)
    if s.ndim != 1 or s.shape != y.shape:
        raise ValueError(f"as many outcomes as scores are needed, not {y.shape} and {s.shape}")
    if np.isnan(s).any():
        raise ValueError("a score is not a number")
    order = np.argsort(-s, kind="stable")
    return s[order], y[order]
