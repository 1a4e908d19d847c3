"""The true map of an environment, as a `map_server` map."""

from __future__ import annotations

import math
from collections.abc import Iterable

import cv2
import numpy as np

from mapmeld.grid import FREE, OCCUPIED, UNKNOWN, Mask, OccupancyGrid
from mapmeld.simulation.boxes import Box
from mapmeld.simulation.environment import Environment
from mapmeld.simulation.errors import SimulationError

MAX_CELLS = 50_000_000

_TOUCH = 1e-6  # of a cell: what only touches a cell's edge is not in it


def cover(mask: Mask, boxes: Iterable[Box], resolution: float) -> None:
    """Set the cells that share area with a box, in place; the lattice begins at (0, 0)."""
    rows, cols = mask.shape
    for box in boxes:
        reach_x, reach_y = box.reach()
        c0 = max(0, math.floor((box.x - reach_x) / resolution + _TOUCH))
        c1 = min(cols, math.ceil((box.x + reach_x) / resolution - _TOUCH))
        r0 = max(0, math.floor((box.y - reach_y) / resolution + _TOUCH))
        r1 = min(rows, math.ceil((box.y + reach_y) / resolution - _TOUCH))
        if r0 >= r1 or c0 >= c1:
            continue
        if math.isclose(math.sin(2 * box.theta), 0.0, abs_tol=1e-12):
            mask[r0:r1, c0:c1] = True
            continue
        # Separating axes: the window settled the lattice's own two, these are the box's.
        y, x = np.mgrid[r0:r1, c0:c1] + 0.5
        u = box.pose.inverse().apply(np.stack([x, y], axis=-1) * resolution)
        c, s = abs(math.cos(box.theta)), abs(math.sin(box.theta))
        half = (c + s) * resolution / 2 - _TOUCH * resolution
        mask[r0:r1, c0:c1] |= (np.abs(u[..., 0]) < box.length / 2 + half) & (
            np.abs(u[..., 1]) < box.width / 2 + half
        )


def covered(environment: Environment, boxes: Iterable[Box], resolution: float) -> Mask:
    """Return the cells (rows, cols) of the ground that share area with boxes, row 0 at the bottom."""
    width, height = environment.size
    if not (math.isfinite(resolution) and 0 < resolution <= 1):
        raise SimulationError(f"the cells of a true map are at most 1 m, not {resolution:g}")
    shape = (math.ceil(height / resolution - _TOUCH), math.ceil(width / resolution - _TOUCH))
    if shape[0] * shape[1] > MAX_CELLS:
        raise SimulationError(f"cells of {resolution:g} m are too many ({shape[0] * shape[1]:,})")
    mask = np.zeros(shape, np.bool_)
    cover(mask, boxes, resolution)
    return mask


def true_map(environment: Environment, resolution: float = 0.05) -> OccupancyGrid:
    """Return the map that a perfect robot would draw, in the environment's frame.

    A cell is an obstacle where anything solid has part in it, unknown outside the outer walls
    (doors to the outside count as closed) and floor elsewhere.

    Raises
    ------
    SimulationError
        The resolution [m] is not over 0 and at most 1, or gives too many cells.
    """
    occupied = covered(environment, environment.solids(), resolution)
    cells = np.full(occupied.shape, FREE, np.int8)
    cells[outside(environment, resolution)] = UNKNOWN
    cells[occupied] = OCCUPIED
    return OccupancyGrid(cells, resolution)


def outside(environment: Environment, resolution: float) -> Mask:
    """Return the cells (rows, cols) from which the edge of the ground is reached without a door."""
    closed = covered(environment, environment.walls(open_doors=False), resolution)
    # A ring of cells around the ground joins all that lies at its edge.
    _, labels = cv2.connectedComponents(
        np.pad(~closed, 1, constant_values=True).astype(np.uint8), connectivity=4
    )
    found: Mask = labels[1:-1, 1:-1] == labels[0, 0]
    return found
