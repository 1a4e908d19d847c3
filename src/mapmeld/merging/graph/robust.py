"""Least squares that let go of what does not fit: graduated non-convexity.

Source: Yang, Antonante, Tzoumas and Carlone, "Graduated Non-Convexity for Robust Spatial Perception: From
Non-Minimal Solvers to Global Outlier Rejection" (2020), with truncated least squares.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mapmeld.merging.graph.edges import Doubles, Edges, Flags, squared_distance
from mapmeld.merging.graph.least_squares import frames_of, optimised, parts, residuals

Robust = Callable[[Doubles, Edges, float, int | None], tuple[Doubles, Flags]]
"""The signature of `graduated`."""

_GROWTH = 1.4
_ROUNDS = 100
_STEPS = 4  # of least squares in each round; the next one goes on from there


def graduated(start: Doubles, edges: Edges, most: float, world: int | None = None) -> tuple[Doubles, Flags]:
    """Return poses (n, 3) and which edges (m,) they rest on.

    Parameters
    ----------
    start
        (n, 3) poses near enough.
    edges
        Those that are given are always kept.
    most
        Squared Mahalanobis distance from which an edge counts as not fitting.
    world
        As in `mapmeld.merging.graph.least_squares.fit`.
    """
    frames = frames_of(parts(len(start), edges), world)
    poses = optimised(start, edges, frames)
    d2 = _unfit(poses, edges)
    # So convex that nothing is let go of yet.
    mu = most / max(2 * float(d2.max(initial=0.0)) - most, 1e-12)
    if d2.max(initial=0.0) <= most:
        return poses, np.ones(len(edges), np.bool_)
    for _ in range(_ROUNDS):
        w = np.sqrt(most * mu * (mu + 1)) / np.sqrt(np.maximum(d2, 1e-12)) - mu
        w = np.where(d2 <= mu / (mu + 1) * most, 1.0, np.where(d2 >= (mu + 1) / mu * most, 0.0, w))
        poses = optimised(poses, edges, frames, w, _STEPS)
        d2 = _unfit(poses, edges)
        if ((w == 0) | (w == 1)).all():
            break
        mu *= _GROWTH
    return poses, np.asarray(d2 <= most)


def _unfit(poses: Doubles, edges: Edges) -> Doubles:
    return np.where(edges.given, 0.0, squared_distance(residuals(poses, edges), edges.covariance))
