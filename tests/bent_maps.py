"""Places as two robots map them: each map bent by drift in its own way; the transform that fits best."""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmeld.grid import UNKNOWN, OccupancyGrid
from mapmeld.se2 import Pose2

Doubles = NDArray[np.float64]
MARGIN = 1.0  # [m] of unknown around a bent map


def drift(grid: OccupancyGrid, metres: float, length: float, rng: np.random.Generator) -> Doubles:
    """Displacement (rows, cols, 2) [m] of each cell: rms `metres` per axis, alike within about `length` m."""
    rows, cols = grid.shape
    sigma = length / grid.resolution
    coarse = max(1, round(sigma / 4))  # smooth fields need no fine lattice
    shape = rows // coarse + 1, cols // coarse + 1
    layers = []
    for _ in range(2):
        noise = rng.normal(size=(shape[0] + 24, shape[1] + 24))
        smooth = cv2.GaussianBlur(noise, (0, 0), sigma / coarse)[12:-12, 12:-12]
        layers.append(metres * cv2.resize(smooth / smooth.std(), (cols, rows)))
    return np.stack(layers, axis=-1)


def bent(grid: OccupancyGrid, u: Doubles, T: Pose2, resolution: float) -> OccupancyGrid:
    """The place as a robot draws it whose map is displaced by `u` and lies in a frame reached by `T`."""
    rows, cols = grid.shape
    corners = T.apply(grid.lattice_to_metres([(0, 0), (cols, 0), (0, rows), (cols, rows)]))
    low = corners.min(axis=0) - MARGIN
    width, height = np.ceil((corners.max(axis=0) + MARGIN - low) / resolution).astype(int)
    col, row = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    z = T.inverse().apply(low + resolution * np.stack([col, row], axis=-1).reshape(-1, 2))
    at = np.asarray(grid.metres_to_lattice(z))
    inside = np.clip(at.astype(int), 0, (cols - 1, rows - 1))
    at = np.floor(np.asarray(grid.metres_to_lattice(z - u[inside[:, 1], inside[:, 0]]))).astype(int)
    known = ((at >= 0) & (at < (cols, rows))).all(axis=1)
    cells = np.full(width * height, UNKNOWN, np.int8)
    cells[known] = grid.cells[at[known, 1], at[known, 0]]
    return OccupancyGrid(cells.reshape(height, width), resolution, Pose2(float(low[0]), float(low[1])))


def best_transform(grid: OccupancyGrid, u_a: Doubles, T_a: Pose2, u_b: Doubles, T_b: Pose2) -> Pose2:
    """The rigid T_a_b that fits best (least squares) where the walls of `grid` lie in both bent maps."""
    row, col = np.nonzero(grid.occupied)
    place = grid.lattice_to_metres(np.stack([col, row], axis=-1) + 0.5)
    a, b = (np.asarray(T.apply(place + u[row, col])) @ (1, 1j) for u, T in ((u_a, T_a), (u_b, T_b)))
    turn = np.vdot(b - b.mean(), a - a.mean())
    turn /= abs(turn)
    shift = a.mean() - turn * b.mean()
    return Pose2(float(shift.real), float(shift.imag), math.atan2(turn.imag, turn.real))


def part(grid: OccupancyGrid, start: float, stop: float, upright: bool) -> OccupancyGrid:
    """What lies between two shares of the width (of the height if `upright`); the rest is unknown."""
    size = grid.shape[0 if upright else 1]
    kept = slice(round(start * size), round(stop * size))
    cells = np.full(grid.shape, UNKNOWN, np.int8)
    inside = (kept, slice(None)) if upright else (slice(None), kept)
    cells[inside] = grid.cells[inside]
    return OccupancyGrid(cells, grid.resolution, grid.origin)
