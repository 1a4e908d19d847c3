"""Maps turned by any angle, so that no method can count on the lattices of two maps being parallel."""

from __future__ import annotations

import math

import numpy as np

from mapmeld.grid import UNKNOWN, OccupancyGrid, resample
from mapmeld.se2 import Pose2

_SHIFT = 20.0  # the new frame's origin lies up to this far [m] off in x and y
_MARGIN = 5  # unknown cells left around the turned map


def turned(grid: OccupancyGrid, seed: int) -> tuple[OccupancyGrid, Pose2]:
    """Return a map as a robot with another start would have drawn it.

    The map is turned about its middle by an angle drawn evenly from the circle, shifted by up to
    20 m in x and y, and sampled on a lattice that is parallel to the new frame's axes.

    Parameters
    ----------
    grid
        The map.
    seed
        The same seed gives the same motion.

    Returns
    -------
    tuple
        The turned map and ``T_new_old``, which takes points of the old frame into the new.
    """
    rng = np.random.default_rng(seed)
    theta = float(rng.uniform(-math.pi, math.pi))
    x, y = (float(v) for v in rng.uniform(-_SHIFT, _SHIFT, 2))
    grid = grid.cropped()
    rows, cols = grid.shape
    middle_x, middle_y = grid.lattice_to_metres((cols / 2, rows / 2))
    T_new_old = Pose2(x, y, theta) @ Pose2(-float(middle_x), -float(middle_y))

    corners = T_new_old.apply(grid.lattice_to_metres([(0, 0), (cols, 0), (0, rows), (cols, rows)]))
    low = corners.min(axis=0)
    width, height = np.ceil((corners.max(axis=0) - low) / grid.resolution).astype(int) + 1
    lattice = OccupancyGrid(
        np.full((height, width), UNKNOWN, np.int8),
        grid.resolution,
        Pose2(float(low[0]), float(low[1])),
        grid.stamp,
        grid.frame_id,
    )
    cells = resample(grid, T_new_old, lattice)
    new = OccupancyGrid(cells, grid.resolution, lattice.origin, grid.stamp, grid.frame_id)
    return new.cropped(_MARGIN), T_new_old
