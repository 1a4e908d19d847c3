"""When two answers are really two: modes of a match that differ by more than its accuracy."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

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
    middle = b.lattice_to_metres((cols / 2, rows / 2))
    kept: list[Alternative] = []
    for other in others:
        modes = (best, *(alternative.T_a_b for alternative in kept))
        if all(_differ(other.T_a_b, mode, middle) for mode in modes):
            kept.append(other)
    return tuple(kept)


def _differ(one: Pose2, two: Pose2, at: np.ndarray) -> bool:
    apart = float(np.hypot(*(one.apply(at) - two.apply(at))))
    return apart > APART_METRES or one.distance_to(two)[1] > APART_RADIANS
