"""Weights of particles, and drawing the next generation by them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def normalised(log_weights: Floats, smoothing: float) -> Floats:
    """Return weights (n,) that sum to 1: the likelihoods to the power of 1 / (smoothing n).

    The power makes up for beams that are not independent of one another; it is that of GMapping, whose
    `ogain` is the smoothing.
    """
    weights = np.exp((log_weights - log_weights.max()) / (smoothing * len(log_weights)))
    return np.asarray(weights / weights.sum(), np.float64)


def effective_size(weights: Floats) -> float:
    """Return how many equal particles would be as many: 1 / sum of the squares of weights that sum to 1."""
    return float(1.0 / np.square(weights).sum())


def low_variance(weights: Floats, offset: float) -> NDArray[np.intp]:
    """Draw as many particles as there are weights, by equal steps through their sum.

    Each particle comes up its expected number of times, rounded down or up.

    Parameters
    ----------
    weights
        (n,) that sum to 1.
    offset
        Where the first step ends, as a part of it, 0..1.
    """
    n = len(weights)
    ends = np.cumsum(weights)
    steps = (offset + np.arange(n)) / n * ends[-1]
    return np.asarray(np.minimum(np.searchsorted(ends, steps, side="right"), n - 1), np.intp)
