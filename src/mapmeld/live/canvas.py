"""The merged map of a fleet: a lattice of the world frame that stays where it is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mapmeld.grid import UNKNOWN, Cells, OccupancyGrid, resample
from mapmeld.merging.aligned import MAX_CELLS, MergeError
from mapmeld.merging.fusion import fuse
from mapmeld.se2 import Pose2, wrap_angle

BLOCK = 128
"""The lattice grows by blocks of so many cells, so that its origin stays for as long as there is room."""


@dataclass(frozen=True, slots=True, eq=False)
class _Layer:
    """A map as it lies on the lattice: its cells, and where they begin [cells of the lattice]."""

    grid: OccupancyGrid
    pose: Pose2
    col: int
    row: int
    cells: Cells


class Canvas:
    """Draws maps into the world frame.

    Cell edges are at whole multiples of the resolution in the world frame, for good: its x and y axes are
    those of the world, and it only ever grows, by whole blocks.

    Parameters
    ----------
    resolution
        Side of a cell [m].
    frame_id
        Of the world.
    """

    def __init__(self, resolution: float, frame_id: str) -> None:
        self.resolution = resolution
        self.frame_id = frame_id
        self._layers: dict[str, _Layer] = {}
        self._low: tuple[int, int] | None = None  # (col, row) of the lower left corner and, exclusive,
        self._high = (0, 0)  # the upper right corner, in cells from the world's origin

    def draw(self, placed: Mapping[str, tuple[OccupancyGrid, Pose2]], fusion: str) -> OccupancyGrid | None:
        """Return the maps merged, each a (grid, T_world_grid); None if nothing is known in any of them.

        Raises
        ------
        MergeError
            The merged map would have more than `MAX_CELLS` cells; nothing has changed then.
        ResolutionError, UnknownFusionError
            As `mapmeld.merging.merge_aligned`.
        """
        layers = {name: self._layer(name, *placed[name]) for name in sorted(placed)}
        layers = {name: layer for name, layer in layers.items() if layer.cells.size}
        if not layers:
            return None
        self._reach(layers)
        self._layers = layers
        assert self._low is not None
        (left, bottom), (right, top) = self._low, self._high
        empty = np.full((top - bottom, right - left), UNKNOWN, np.int8)
        stack = []
        for layer in layers.values():
            sheet = empty.copy()
            rows, cols = layer.cells.shape
            row, col = layer.row - bottom, layer.col - left
            sheet[row : row + rows, col : col + cols] = layer.cells
            stack.append((layer.grid.stamp, sheet))
        if fusion == "newest" and all(stamp is not None for stamp, _ in stack):
            stack.sort(key=lambda item: item[0] or 0.0)
        stamps = [stamp for stamp, _ in stack if stamp is not None]
        return OccupancyGrid(
            fuse([sheet for _, sheet in stack], fusion),
            self.resolution,
            Pose2(left * self.resolution, bottom * self.resolution),
            max(stamps, default=None),
            self.frame_id,
        )

    def blank(self) -> OccupancyGrid | None:
        """Return a map as large as the last one, in which nothing is known; None if nothing was drawn yet."""
        if self._low is None:
            return None
        (left, bottom), (right, top) = self._low, self._high
        origin = Pose2(left * self.resolution, bottom * self.resolution)
        cells = np.full((top - bottom, right - left), UNKNOWN, np.int8)
        return OccupancyGrid(cells, self.resolution, origin, None, self.frame_id)

    def _layer(self, name: str, grid: OccupancyGrid, pose: Pose2) -> _Layer:
        before = self._layers.get(name)
        if before is not None and before.grid is grid and before.pose == pose:
            return before
        known = grid.cropped()
        height, width = known.shape
        if not known.known.any():
            return _Layer(grid, pose, 0, 0, np.zeros((0, 0), np.int8))
        corners = known.lattice_to_metres([(0, 0), (width, 0), (0, height), (width, height)])
        reached = pose.apply(corners) / self.resolution
        low = np.floor(reached.min(axis=0) + 1e-6)
        high = np.ceil(reached.max(axis=0) - 1e-6)
        cols, rows = high - low
        if not cols * rows <= MAX_CELLS:
            raise MergeError(f"the map of {name} would have {cols:.0f} x {rows:.0f} cells in the merged map")
        col, row = int(low[0]), int(low[1])
        size = np.zeros((int(rows), int(cols)), np.int8)
        target = OccupancyGrid(size, self.resolution, Pose2(col * self.resolution, row * self.resolution))
        if _one_lattice(known, pose, self.resolution) and size.shape == known.shape:
            return _Layer(grid, pose, col, row, known.cells)
        return _Layer(grid, pose, col, row, resample(known, pose, target))

    def _reach(self, layers: Mapping[str, _Layer]) -> None:
        cols = [c for layer in layers.values() for c in (layer.col, layer.col + layer.cells.shape[1])]
        rows = [r for layer in layers.values() for r in (layer.row, layer.row + layer.cells.shape[0])]
        low, high = (min(cols), min(rows)), (max(cols), max(rows))
        if self._low is not None:
            low = min(low[0], self._low[0]), min(low[1], self._low[1])
            high = max(high[0], self._high[0]), max(high[1], self._high[1])
        low = math.floor(low[0] / BLOCK) * BLOCK, math.floor(low[1] / BLOCK) * BLOCK
        high = math.ceil(high[0] / BLOCK) * BLOCK, math.ceil(high[1] / BLOCK) * BLOCK
        width, height = high[0] - low[0], high[1] - low[1]
        if width * height > MAX_CELLS:
            raise MergeError(
                f"the merged map would have {width} x {height} cells, more than {MAX_CELLS:,}; "
                "check the poses and resolutions of the maps"
            )
        self._low, self._high = low, high


def _one_lattice(grid: OccupancyGrid, pose: Pose2, resolution: float) -> bool:
    """Whether a map's cells are cells of the world's lattice, so that nothing need be sampled."""
    placed = pose @ grid.origin
    if grid.resolution != resolution or abs(wrap_angle(placed.theta)) > 1e-9:
        return False
    at = np.array([placed.x, placed.y]) / resolution
    return bool(np.abs(at - np.rint(at)).max() < 1e-6)
