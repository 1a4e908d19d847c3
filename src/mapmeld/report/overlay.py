"""Maps laid over one another in colours (paper, Figure 8): red, blue, and green where walls agree."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from mapmeld.grid import Cells, OccupancyGrid, resample
from mapmeld.merging import merge_aligned
from mapmeld.report.canvas import Labels, Picture, known_window, paint
from mapmeld.report.palette import FLOOR_WHITE, GREEN, OVERLAY_COLOURS, UNKNOWN_GREY, Colour
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
    grids: Sequence[OccupancyGrid], poses: Sequence[Pose2], names: Sequence[str], caption: str = ""
) -> Picture:
    """Draw maps over one another, on the lattice of the first as in a merge.

    Parameters
    ----------
    grids, poses
        As for `mapmeld.merging.merge_aligned`: ``T_first_i`` per map, the first the identity.
    names
        What to call the maps in the legend.
    caption
        A sentence below the picture.

    Returns
    -------
    Picture: map 1 red, map 2 blue, walls that two or more maps share (within one cell) green,
    floor white, unknown grey.
    """
    lattice = merge_aligned(grids, poses)
    layers = [resample(grid, T, lattice) for grid, T in zip(grids, poses, strict=True)]
    colours: list[Colour] = [OVERLAY_COLOURS[i % len(OVERLAY_COLOURS)] for i in range(len(grids))]
    canvas = paint(
        overlay_labels(layers), [UNKNOWN_GREY, FLOOR_WHITE, *colours, GREEN], known_window(lattice)
    )
    legend = [*zip(colours, names, strict=True)]
    if len(grids) > 1:
        legend.append((GREEN, "walls in both" if len(grids) == 2 else "walls in two or more"))
    return compose([Panel(canvas.picture)], caption, legend, canvas.px_per_cell / lattice.resolution)
