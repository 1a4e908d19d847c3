"""Floors that bend as maps do, for the tests of what changed."""

import numpy as np
from drawing import built, office

from mapmeld.grid import OCCUPIED, OccupancyGrid, resample
from mapmeld.se2 import Pose2


def bowed(grid: OccupancyGrid, amount: float) -> OccupancyGrid:
    """The map as a robot with a drifting heading draws it: a bow, `amount` metres at both ends."""
    wide = grid.extended(20, 20, 20, 20)
    middle = wide.shape[1] / 2

    def displacement(col: np.ndarray, row: np.ndarray) -> np.ndarray:
        return np.asarray(1j * amount / grid.resolution * ((col - middle) / middle) ** 2 + 0 * row)

    cells = resample(grid, Pose2(), wide, displacement=displacement)
    return OccupancyGrid(cells, wide.resolution, wide.origin)


def with_box(grid: OccupancyGrid, x0: float, y0: float, x1: float, y1: float) -> OccupancyGrid:
    """The map with one more thing on the floor (metres of its lattice)."""
    cells = grid.cells.copy()
    c0, r0, c1, r1 = (round(v / grid.resolution) for v in (x0, y0, x1, y1))
    cells[r0:r1, c0:c1] = OCCUPIED
    return OccupancyGrid(cells, grid.resolution, grid.origin)


def area_in(mask: np.ndarray, grid: OccupancyGrid, x0: float, y0: float, x1: float, y1: float) -> float:
    """Area [m^2] of what holds in a rectangle of the metric frame."""
    x, y = grid.centres(mask).T
    return float(((x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)).sum()) * grid.resolution**2


__all__ = ["area_in", "bowed", "built", "office", "with_box"]
