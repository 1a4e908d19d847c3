"""What became of each cell between two maps that lie on one lattice."""

from __future__ import annotations

from enum import IntEnum

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmeld.grid import Mask, OccupancyGrid

Classes = NDArray[np.uint8]
"""(rows, cols), row 0 at the bottom: a `Change` for each cell."""


class Change(IntEnum):
    """What became of a cell."""

    UNKNOWN = 0
    """Neither map knows it."""
    SAME = 1
    """Both know it, and what the later shows is what the earlier did, drift aside."""
    APPEARED = 2
    """An obstacle where the earlier map had seen floor."""
    VANISHED = 3
    """Floor where the earlier map had an obstacle."""
    EXPLORED = 4
    """Only the later map knows it."""
    UNSEEN = 5
    """Only the earlier map knows it."""


def classify(old: OccupancyGrid, new: OccupancyGrid, tolerance: float) -> Classes:
    """Compare two maps cell by cell.

    A cell counts as changed only where one map has an obstacle, the other has *seen floor*, and has
    no obstacle within the tolerance either: what was never looked at, and a wall drawn a little
    beside or thicker than before, are no change.

    Parameters
    ----------
    old, new
        The earlier and the later map, on the same lattice.
    tolerance
        How far from an obstacle of the other map, centre of cell to centre [m], an obstacle is that one.
    """
    classes = np.full(old.shape, Change.UNKNOWN, np.uint8)
    classes[old.known] = Change.UNSEEN
    classes[new.known] = Change.EXPLORED
    classes[old.known & new.known] = Change.SAME
    reach = tolerance / old.resolution
    classes[new.occupied & old.free & (distance_to(old.occupied) > reach)] = Change.APPEARED
    classes[old.occupied & new.free & (distance_to(new.occupied) > reach)] = Change.VANISHED
    return classes


def distance_to(mask: Mask) -> NDArray[np.float32]:
    """Return how far [cells] each cell is from the nearest where `mask` holds; inf if it holds nowhere."""
    if not mask.any():
        return np.full(mask.shape, np.inf, np.float32)
    away = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(away, np.float32)
