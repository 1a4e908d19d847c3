"""Peaks of circular correlations."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def separate_peaks(values: NDArray[np.floating], most: int, apart: int) -> list[int]:
    """Return the positions of the highest local maxima of a circular curve (n,), the highest first.

    At most `most`, each more than `apart` samples from every higher one. A curve without any maximum
    (constant) gives its first position.
    """
    n = len(values)
    tops = np.flatnonzero((values >= np.roll(values, 1)) & (values >= np.roll(values, -1)))
    kept: list[int] = []
    for k in tops[np.argsort(-values[tops], kind="stable")]:
        if all(min((k - j) % n, (j - k) % n) > apart for j in kept):
            kept.append(int(k))
            if len(kept) == most:
                break
    return kept


def refined_peak(values: NDArray[np.floating], k: int) -> float:
    """Return where the parabola through samples k - 1, k, k + 1 of a circular curve has its top."""
    n = len(values)
    before, top, after = (float(values[(k + d) % n]) for d in (-1, 0, 1))
    bend = before - 2 * top + after
    return k + (0.5 * (before - after) / bend if bend < 0 else 0.0)
