"""Two maps cut so that they share less: what robots know of one place before they have met."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mapmeld.grid import UNKNOWN, OccupancyGrid
from mapmeld.se2 import Pose2

GAP_MOST = 1.0  # [m] between parts that share nothing
STRIP_MOST = 0.5  # of the extent of both maps together: the widest strip that parts share
APART_SHARE = 0.4  # of all seeds give parts that share nothing


def parted(
    a: OccupancyGrid, b: OccupancyGrid, T_a_b: Pose2, seed: int
) -> tuple[OccupancyGrid, OccupancyGrid, float]:
    """Cut two maps of one place by a pair of parallel lines, each map on one side.

    The lines run in any direction near the middle of what both show. Between them lies a strip that
    both keep, up to half as wide as the place, or (for two fifths of the seeds) a gap of up to a metre.

    Parameters
    ----------
    a, b
        The maps; each needs an obstacle.
    T_a_b
        How they fit.
    seed
        The same seed gives the same lines.

    Returns
    -------
    tuple
        Both parts, in the frames and on the lattices of their maps, and the width of the strip [m];
        negative where the parts share nothing.
    """
    rng = np.random.default_rng(seed)
    theta = float(rng.uniform(-math.pi, math.pi))
    normal = np.array([math.cos(theta), math.sin(theta)])
    places = np.concatenate([a.centres(a.occupied), T_a_b.apply(b.centres(b.occupied))]) @ normal
    middle = float(np.quantile(places, rng.uniform(0.35, 0.65)))
    extent = float(np.subtract(*np.quantile(places, [0.98, 0.02])))
    most = 0.0 if rng.random() < APART_SHARE else STRIP_MOST * extent
    width = float(rng.uniform(-GAP_MOST, most))
    T_b_a = T_a_b.inverse()
    c, s = math.cos(T_b_a.theta), math.sin(T_b_a.theta)
    normal_b = np.array([c * normal[0] - s * normal[1], s * normal[0] + c * normal[1]])
    moved = float(normal_b @ [T_b_a.x, T_b_a.y])
    return (
        _below(a, normal, middle + width / 2),
        _below(b, -normal_b, -(middle - width / 2 + moved)),
        width,
    )


def _below(grid: OccupancyGrid, normal: NDArray[np.float64], limit: float) -> OccupancyGrid:
    """Forget the cells whose middle p has normal . p above the limit."""
    above = grid.known.copy()
    above[above] = grid.centres(grid.known) @ normal > limit
    cells = grid.cells.copy()
    cells[above] = UNKNOWN
    return replace(grid, cells=cells)
