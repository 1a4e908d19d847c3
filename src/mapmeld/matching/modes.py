"""When two answers are really two: modes of a match that differ by more than its accuracy."""

from __future__ import annotations

import math
from collections.abc import Iterable

from mapmeld.grid import OccupancyGrid
from mapmeld.matching.result import Alternative
from mapmeld.se2 import Pose2

APART_METRES = 0.5
APART_RADIANS = math.radians(5.0)


def distinct_modes(best: Pose2, others: Iterable[Alternative], b: OccupancyGrid) -> tuple[Alternative, ...]:
    """Return the alternatives, in their order, that repeat neither `best` nor an earlier one.

    Two transforms are the same mode if they place the middle of map b within 0.5 m and turn it
    within 5 degrees of one another.
    """
    rows, cols = b.shape
    x, y = map(float, b.lattice_to_metres((cols / 2, rows / 2)))
    middle = Pose2(x, y)
    kept: list[Alternative] = []
    modes = [best @ middle]
    for other in others:
        placed = other.T_a_b @ middle
        if all(_differ(placed, mode) for mode in modes):
            kept.append(other)
            modes.append(placed)
    return tuple(kept)


def _differ(one: Pose2, two: Pose2) -> bool:
    metres, radians = one.distance_to(two)
    return metres > APART_METRES or radians > APART_RADIANS
