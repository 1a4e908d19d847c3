"""How much of a map has changed from one state to the next."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapmeld.grid import FREE_UP_TO, OCCUPIED_FROM, OccupancyGrid
from mapmeld.se2 import wrap_angle

_SAME_CELL = 0.01  # [cells] origins that differ by so much of a whole number are on one lattice
_SAME_TURN = 1e-6  # [rad]


def same_map(before: OccupancyGrid, now: OccupancyGrid) -> bool:
    """Whether two states show the same, cell by cell in the same places; unknown borders aside."""
    if before.resolution != now.resolution:
        return False
    if before.shape != now.shape or before.origin != now.origin:
        before, now = before.cropped(), now.cropped()
    near, turned = before.origin.distance_to(now.origin)
    there = near <= 1e-6 * before.resolution and turned <= 1e-9
    return there and np.array_equal(before.cells, now.cells)


def changed_area(before: OccupancyGrid, now: OccupancyGrid) -> float:
    """Return how much of a map shows something else than before: unknown, floor, obstacle, neither [m^2].

    Where the cells of the two states do not coincide, that is all that is known.
    """
    moved = _whole_cells(before, now)
    if moved is None:
        return max(before.known_area, now.known_area)
    left, bottom = moved
    (rows, cols), (height, width) = before.shape, now.shape
    there = before.extended(left, bottom, width - cols - left, height - rows - bottom)
    changed = int(np.count_nonzero(_kinds(there) != _kinds(now)))
    gone = int(np.count_nonzero(before.known)) - int(np.count_nonzero(there.known))
    return (changed + gone) * now.resolution**2


def _whole_cells(before: OccupancyGrid, now: OccupancyGrid) -> tuple[int, int] | None:
    """Return where the lattice of `before` begins on that of `now` (columns, rows); None if between cells."""
    if before.resolution != now.resolution or not (before.cells.size and now.cells.size):
        return None
    if abs(wrap_angle(before.origin.theta - now.origin.theta)) > _SAME_TURN:
        return None
    at = now.metres_to_lattice((before.origin.x, before.origin.y))
    whole = np.rint(at)
    if np.abs(at - whole).max() > _SAME_CELL:
        return None
    return int(whole[0]), int(whole[1])


def _kinds(grid: OccupancyGrid) -> NDArray[np.int8]:
    return _KIND[grid.cells.view(np.uint8)]


# By the cell as a byte, of which unknown, -1, is the last.
_KIND = np.full(256, 2, np.int8)
_KIND[: FREE_UP_TO + 1] = 0
_KIND[OCCUPIED_FROM:] = 1
_KIND[255] = 3
