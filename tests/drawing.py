"""Tiny maps drawn by hand: ``#`` obstacle, ``.`` floor, a space unknown; the top line is the top row."""

import numpy as np

from mapmeld.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, resample
from mapmeld.se2 import Pose2

_CELL = {"#": OCCUPIED, ".": FREE, " ": UNKNOWN}


def drawn(picture: str, resolution: float = 1.0, origin: Pose2 | None = None) -> OccupancyGrid:
    lines = picture.strip("\n").split("\n")
    width = max(map(len, lines))
    rows = [[_CELL[c] for c in line.ljust(width)] for line in reversed(lines)]
    return OccupancyGrid(np.array(rows, np.int8), resolution, origin or Pose2())


def picture_of(grid: OccupancyGrid) -> str:
    signs = {value: sign for sign, value in _CELL.items()}
    return "\n".join("".join(signs[int(v)] for v in row) for row in grid.cells[::-1])


def office(resolution: float = 0.05) -> OccupancyGrid:
    """A floor of 16 x 12 m without symmetry: rooms of different size, doors, two pillars."""
    rows, cols = round(12 / resolution), round(16 / resolution)
    cells = np.zeros((rows, cols), np.int8)
    walls_m = [
        (0, 0, 16, 0.1), (0, 11.9, 16, 12), (0, 0, 0.1, 12), (15.9, 0, 16, 12),
        (5, 0, 5.1, 3), (5, 4, 5.1, 7), (0, 7, 3.5, 7.1), (4.5, 7, 11, 7.1),
        (9, 7, 9.1, 9.5), (9, 10.5, 9.1, 12), (11, 2.5, 11.1, 7), (11, 2.5, 14, 2.6),
        (12.5, 5, 16, 5.1), (7, 1.2, 7.8, 2.0), (13, 9, 13.6, 10.4),
    ]  # fmt: skip
    for x0, y0, x1, y1 in walls_m:
        c0, r0, c1, r1 = (round(v / resolution) for v in (x0, y0, x1, y1))
        cells[r0 : max(r1, r0 + 1), c0 : max(c1, c0 + 1)] = OCCUPIED
    return OccupancyGrid(cells, resolution)


def seen_from(grid: OccupancyGrid, T_new_old: Pose2, resolution: float | None = None) -> OccupancyGrid:
    """The same place mapped on another lattice, in a frame reached by `T_new_old`."""
    resolution = resolution or grid.resolution
    rows, cols = grid.shape
    corners = T_new_old.apply(grid.lattice_to_metres([(0, 0), (cols, 0), (0, rows), (cols, rows)]))
    low, high = corners.min(axis=0), corners.max(axis=0)
    width, height = np.ceil((high - low) / resolution).astype(int) + 6
    target = OccupancyGrid(
        np.full((height, width), UNKNOWN, np.int8),
        resolution,
        Pose2(float(low[0]) - 3 * resolution, float(low[1]) - 3 * resolution),
    )
    return OccupancyGrid(resample(grid, T_new_old, target), resolution, target.origin)
