"""Where a map has walls, floor, and anything known: the one look at its cells that all else builds on."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmeld.grid import FREE_UP_TO, OCCUPIED, OCCUPIED_FROM, OccupancyGrid
from mapmeld.se2 import Pose2

Image = NDArray[Any]  # bytes or float32; OpenCV's annotations say neither


@dataclass(frozen=True, slots=True, eq=False)
class MapMasks:
    """A map cut to its known cells, so that unknown borders cannot change any answer.

    Attributes
    ----------
    wall, floor, known
        uint8 (rows, cols), row 0 at the bottom: 255 where it is so, else 0.
    resolution
        Side of a cell [m].
    origin
        Pose of the lower left corner of the cut in the map's metric frame.
    """

    wall: Image
    floor: Image
    known: Image
    resolution: float
    origin: Pose2


def map_masks(grid: OccupancyGrid) -> MapMasks | None:
    """Return the masks of a map; None if it has no obstacle."""
    if not grid.cells.size:
        return None
    cells = grid.cells.view(np.uint8)  # unknown, -1, becomes 255
    known = cv2.inRange(cells, 0, OCCUPIED)
    left, bottom, width, height = cv2.boundingRect(known)
    cut = np.s_[bottom : bottom + height, left : left + width]
    wall = cv2.inRange(cells[cut], OCCUPIED_FROM, OCCUPIED) if width else known
    if not width or not cv2.countNonZero(wall):
        return None
    corner = grid.origin @ Pose2(left * grid.resolution, bottom * grid.resolution)
    return MapMasks(
        wall=wall,
        floor=cv2.inRange(cells[cut], 0, FREE_UP_TO),
        known=np.ascontiguousarray(known[cut]),
        resolution=grid.resolution,
        origin=replace(corner, theta=grid.origin.theta),
    )
