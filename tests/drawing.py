"""Tiny maps drawn by hand: ``#`` obstacle, ``.`` floor, a space unknown; the top line is the top row."""

from collections.abc import Sequence

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


Walls = Sequence[tuple[float, float, float, float]]


def built(width: float, height: float, walls: Walls, resolution: float = 0.05) -> OccupancyGrid:
    """A floor of `width` x `height` m with rectangles (x0, y0, x1, y1) [m] of wall on it."""
    cells = np.zeros((round(height / resolution), round(width / resolution)), np.int8)
    for rectangle in walls:
        c0, r0, c1, r1 = (round(v / resolution) for v in rectangle)
        cells[r0 : max(r1, r0 + 1), c0 : max(c1, c0 + 1)] = OCCUPIED
    return OccupancyGrid(cells, resolution)


def around(width: float, height: float) -> list[tuple[float, float, float, float]]:
    """The outer walls, 0.1 m thick."""
    return [
        (0, 0, width, 0.1), (0, height - 0.1, width, height),
        (0, 0, 0.1, height), (width - 0.1, 0, width, height),
    ]  # fmt: skip


def office(resolution: float = 0.05) -> OccupancyGrid:
    """A floor of 16 x 12 m without symmetry: rooms of different size, doors, two pillars."""
    walls_m = [
        *around(16, 12),
        (5, 0, 5.1, 3), (5, 4, 5.1, 7), (0, 7, 3.5, 7.1), (4.5, 7, 11, 7.1),
        (9, 7, 9.1, 9.5), (9, 10.5, 9.1, 12), (11, 2.5, 11.1, 7), (11, 2.5, 14, 2.6),
        (12.5, 5, 16, 5.1), (7, 1.2, 7.8, 2.0), (13, 9, 13.6, 10.4),
    ]  # fmt: skip
    return built(16, 12, walls_m, resolution)


def school(resolution: float = 0.05) -> OccupancyGrid:
    """Another building, 20 x 9 m, that has no room of the office."""
    walls_m = [
        *around(20, 9),
        (0, 5, 2, 5.1), (3, 5, 9, 5.1), (10, 5, 20, 5.1), (4, 5, 4.1, 9), (8.5, 5, 8.6, 9), (14, 6, 14.1, 9),
        (6, 0, 6.1, 2), (6, 3, 6.1, 5), (13, 0, 13.1, 3.5), (17, 1.5, 20, 1.6), (9.2, 2, 10, 2.4),
    ]  # fmt: skip
    return built(20, 9, walls_m, resolution)


def hall(resolution: float = 0.05) -> OccupancyGrid:
    """A hall of 14 x 8 m that looks the same turned by half a turn."""
    walls_m = [*around(14, 8), (4, 3, 4.5, 3.5), (9.5, 4.5, 10, 5), (6, 0, 6.1, 2), (7.9, 6, 8, 8)]
    return built(14, 8, walls_m, resolution)


def row_of_rooms(rooms: int, resolution: float = 0.05) -> OccupancyGrid:
    """Identical rooms every 4 m along a corridor, each with its door; 5 m high."""
    length = 4 * rooms + 0.1
    walls_m = [*around(length, 5)]
    for x in range(0, 4 * rooms + 1, 4):
        walls_m.append((x, 1.9, x + 0.1, 5))
        if x < 4 * rooms:
            walls_m.append((x + 1, 1.9, x + 4, 2))
    return built(length, 5, walls_m, resolution)


def cut(grid: OccupancyGrid, x0: float, y0: float, x1: float, y1: float) -> OccupancyGrid:
    """What of a map lies in a rectangle [m] of its lattice; its frame stays."""
    rows, cols = grid.shape
    left, bottom, right, top = (round(v / grid.resolution) for v in (x0, y0, x1, y1))
    return grid.extended(-left, -bottom, right - cols, top - rows)


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
