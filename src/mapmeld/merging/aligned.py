"""Merging maps whose poses are known (paper, section 2.1.7)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapmeld.errors import MapmeldError
from mapmeld.grid import OccupancyGrid, resample
from mapmeld.merging.fusion import fuse
from mapmeld.se2 import Pose2

MAX_CELLS = 400_000_000
"""Largest merged map: 20,000 x 20,000 cells, what can be written as a file."""


class MergeError(MapmeldError):
    """The maps cannot be merged as asked."""


def merge_aligned(
    grids: Sequence[OccupancyGrid], poses: Sequence[Pose2], fusion: str = "colour"
) -> OccupancyGrid:
    """Merge maps into the lattice and the frame of the first.

    The lattice of the first map is extended by whole cells until it holds all known cells of
    all maps; its own cells keep their place and, before fusion, their value. The others
    are sampled on it (`mapmeld.grid.resample`).

    Parameters
    ----------
    grids
        The maps, the reference first.
    poses
        ``T_first_i`` for each map; the first must be the identity.
    fusion
        A rule of `mapmeld.merging.fusion.FUSIONS`. "newest" goes by the stamps of the maps
        if all have one, otherwise by their order.

    Raises
    ------
    MergeError
        The maps lie so far apart that the merged map would have more than `MAX_CELLS` cells.
    UnknownFusionError
        There is no such rule.
    """
    if len(grids) != len(poses) or not grids:
        raise ValueError("as many poses as maps are needed, and at least one")
    if poses[0] != Pose2():
        raise ValueError("the first map is the reference: its pose must be the identity")
    canvas = lattice_for_all(grids, poses)
    layers = [canvas.cells, *(resample(g, T, canvas) for g, T in zip(grids[1:], poses[1:], strict=True))]
    stamps = [g.stamp for g in grids]
    known_stamps = [s for s in stamps if s is not None]
    if fusion == "newest" and len(known_stamps) == len(grids):
        layers = [layers[i] for i in np.argsort(np.array(known_stamps), kind="stable")]
    return replace(canvas, cells=fuse(layers, fusion), stamp=max(known_stamps, default=None))


def lattice_for_all(grids: Sequence[OccupancyGrid], poses: Sequence[Pose2]) -> OccupancyGrid:
    """Return the first map extended by whole unknown cells to reach over all maps.

    Parameters and errors are those of `merge_aligned`.
    """
    first = grids[0]
    rows, cols = first.shape
    low, high = np.zeros(2), np.array([cols, rows], dtype=np.float64)
    for grid, T_first_grid in zip(grids[1:], poses[1:], strict=True):
        grid = grid.cropped()
        if not grid.known.any():
            continue
        height, width = grid.shape
        corners = grid.lattice_to_metres([(0, 0), (width, 0), (0, height), (width, height)])
        reached = first.metres_to_lattice(T_first_grid.apply(corners))
        # A hair's breadth over a cell edge, by rounding, is no reason for another row of cells.
        low = np.minimum(low, np.floor(reached.min(axis=0) + 1e-6))
        high = np.maximum(high, np.ceil(reached.max(axis=0) - 1e-6))
    width, height = high - low
    if not width * height <= MAX_CELLS:
        raise MergeError(
            f"the merged map would have {width:.0f} x {height:.0f} cells, more than {MAX_CELLS:,}; "
            "check the poses and resolutions of the maps"
        )
    return first.extended(
        left=-math.floor(low[0]),
        bottom=-math.floor(low[1]),
        right=math.ceil(high[0]) - cols,
        top=math.ceil(high[1]) - rows,
    )
