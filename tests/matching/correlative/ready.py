"""Maps made ready for comparison, for tests of the steps between."""

import numpy as np

from mapmeld.grid import OccupancyGrid
from mapmeld.matching.correlative.masks import map_masks
from mapmeld.matching.correlative.reduced_map import ReducedMap, reduce_map
from mapmeld.matching.correlative.wall_map import Doubles, WallMap, wall_map
from mapmeld.se2 import Pose2


def walls_of(grid: OccupancyGrid) -> WallMap:
    masks = map_masks(grid)
    assert masks is not None
    return wall_map(masks)


def reduced(grid: OccupancyGrid) -> ReducedMap:
    masks = map_masks(grid)
    assert masks is not None
    return reduce_map(masks)


def rows(*poses: Pose2) -> Doubles:
    """Transforms as the steps take them: (k, 3)."""
    return np.array([(T.x, T.y, T.theta) for T in poses])
