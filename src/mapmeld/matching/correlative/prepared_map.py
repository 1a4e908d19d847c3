"""Everything that the matcher needs of one map, computed once a map."""

from __future__ import annotations

from dataclasses import dataclass

from mapmeld.grid import OccupancyGrid
from mapmeld.matching.correlative.masks import map_masks
from mapmeld.matching.correlative.reduced_map import ReducedMap, reduce_map
from mapmeld.matching.correlative.wall_map import WallMap, wall_map
from mapmeld.matching.per_map import PerMap


@dataclass(frozen=True, slots=True, eq=False)
class PreparedMap:
    """A map as the search sees it, and as the comparison of walls does."""

    reduced: ReducedMap
    walls: WallMap


@PerMap
def prepare(grid: OccupancyGrid) -> PreparedMap | None:
    """Prepare a map in time linear in its cells; None if it has no obstacle."""
    masks = map_masks(grid)
    return None if masks is None else PreparedMap(reduce_map(masks), wall_map(masks))
