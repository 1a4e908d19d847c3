"""When the match of one state is that of another: maps drift between states, and the transform with them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mapmeld.grid import OccupancyGrid
from mapmeld.history.step import Maps
from mapmeld.matching.modes import APART_METRES, APART_RADIANS
from mapmeld.matching.per_map import PerMap
from mapmeld.se2 import Pose2


@PerMap
def _middle(grid: OccupancyGrid) -> NDArray[np.float64]:
    """Middle of the known cells [m]; that of the lattice would move when the map's border grows."""
    known = grid.cropped()
    rows, cols = known.shape
    return known.lattice_to_metres((cols / 2, rows / 2))


def apart(one: Pose2, two: Pose2, maps: Maps) -> tuple[float, float]:
    """Return (metres at the middle of map 2, radians) between two T_1_2."""
    middle = _middle(maps[1])
    dx, dy = two.apply(middle) - one.apply(middle)
    return math.hypot(dx, dy), one.distance_to(two)[1]


def same_place(one: Pose2, two: Pose2, maps: Maps) -> bool:
    """Whether two T_1_2 differ by no more than a map drifts: 0.5 m at its middle and 5 degrees."""
    metres, radians = apart(one, two, maps)
    return metres <= APART_METRES and radians <= APART_RADIANS


def moved(before: Pose2, now: Pose2, maps: Maps) -> str:
    """Return by how much the transform moved, in words."""
    metres, radians = apart(before, now, maps)
    return f"moved by {metres:.2f} m, {math.degrees(radians):.1f} deg"
