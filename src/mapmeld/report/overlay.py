"""Maps laid over one another in colours (paper, Figure 8): red, blue, and green where walls agree."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from mapmeld.grid import Cells, OccupancyGrid, resample
from mapmeld.merging import merge_aligned
from mapmeld.report.canvas import Labels, Picture, known_window, paint, with_turn
from mapmeld.report.palette import FLOOR_WHITE, GREEN, UNKNOWN_GREY, Colour, colour_of_map
from mapmeld.report.sheet import Panel, compose
from mapmeld.se2 import Pose2

_UNKNOWN, _FLOOR, _FIRST_WALL = 0, 1, 2
# Walls of two maps that are at most this many cells apart are drawn as common: rotated cells
# cannot fall on one another more exactly.
COMMON_WITHIN_CELLS = 1


def overlay_labels(layers: Sequence[Cells]) -> Labels:
    """Return what each cell shows: 0 unknown, 1 floor, 2 + i a wall of map i alone, last a common wall.

    Parameters
    ----------
    layers
        Aligned cells of each map, int8 (rows, cols), -1 unknown or 0..100 percent.
    """
    grids = [OccupancyGrid(cells, 1.0) for cells in layers]
    labels = np.zeros(grids[0].shape, np.uint8)
    labels[np.logical_or.reduce([grid.free for grid in grids])] = _FLOOR
    near = np.zeros(labels.shape, np.uint8)
    disc = np.ones((2 * COMMON_WITHIN_CELLS + 1,) * 2, np.uint8)
    for grid in grids:
        if labels.size:
            near += cv2.dilate(grid.occupied.astype(np.uint8), disc).astype(np.uint8)
    for i, grid in enumerate(grids):
        labels[grid.occupied] = _FIRST_WALL + i
    walls = np.logical_or.reduce([grid.occupied for grid in grids])
    labels[walls & (near >= 2)] = _FIRST_WALL + len(grids)
    return labels


def overlay(
    grids: Sequence[OccupancyGrid],
    poses: Sequence[Pose2 | None],
    names: Sequence[str],
    caption: str = "",
) -> Picture:
    """Draw maps over one another, on the lattice of the first as in a merge.

    Parameters
    ----------
    grids, poses
        As for `mapmeld.merging.merge_aligned`: ``T_first_i`` per map, the first the identity. Maps
        whose pose is None are left out; the others keep their colours.
    names
        What to call the maps in the legend.
    caption
        A sentence below the picture; where the first map's lattice has a yaw, one about that is added.

    Returns
    -------
    Picture: map 1 red, map 2 blue, walls that two or more maps share (within one cell) green,
    floor white, unknown grey.
    """
    placed = [(i, grid, T) for i, (grid, T) in enumerate(zip(grids, poses, strict=True)) if T is not None]
    lattice = merge_aligned([grid for _, grid, _ in placed], [T for _, _, T in placed])
    layers = [resample(grid, T, lattice) for _, grid, T in placed]
    colours: list[Colour] = [colour_of_map(i) for i, _, _ in placed]
    canvas = paint(
        overlay_labels(layers), [UNKNOWN_GREY, FLOOR_WHITE, *colours, GREEN], known_window(lattice)
    )
    legend = [(colour_of_map(i), names[i]) for i, _, _ in placed]
    if len(placed) > 1:
        legend.append((GREEN, "walls in both" if len(placed) == 2 else "walls in two or more"))
    return compose(
        [Panel(canvas.picture)], with_turn(caption, lattice), legend, canvas.px_per_cell / lattice.resolution
    )
