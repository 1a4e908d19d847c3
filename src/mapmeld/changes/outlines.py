"""The border of a patch of cells as a polygon, along the edges of the cells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_fill_holes

from mapmeld.grid import Mask

Vertices = NDArray[np.intp]
"""(n, 2): (col, row) corners of cells, the first not repeated at the end."""


def outline(mask: Mask) -> Vertices:
    """Return the outer border of one patch, counter-clockwise, its holes filled.

    Parameters
    ----------
    mask
        (rows, cols), row 0 at the bottom: cells that hang together by their edges, at least one.

    Returns
    -------
    Vertices
        A simple polygon without needless corners: it nowhere crosses or touches itself, for where two cells
        of a patch meet in a corner only, a cell beside that corner lies in a hole.
    """
    filled = np.pad(np.asarray(binary_fill_holes(mask), bool), 1)
    # Every edge between inside and outside, directed so that the inside is to its left.
    up, down = filled[1:-1, 1:-1] & ~filled[1:-1, 2:], filled[1:-1, 1:-1] & ~filled[1:-1, :-2]
    left, right = filled[1:-1, 1:-1] & ~filled[2:, 1:-1], filled[1:-1, 1:-1] & ~filled[:-2, 1:-1]
    edges: dict[tuple[int, int], tuple[int, int]] = {}
    for where, (c0, r0), (c1, r1) in (
        (up, (1, 0), (1, 1)),
        (down, (0, 1), (0, 0)),
        (left, (1, 1), (0, 1)),
        (right, (0, 0), (1, 0)),
    ):
        for row, col in np.argwhere(where).tolist():
            edges[col + c0, row + r0] = (col + c1, row + r1)
    start = min(edges)
    corners = [start]
    while (corner := edges[corners[-1]]) != start:
        corners.append(corner)
    ring = np.array(corners, np.intp)
    way_in, way_out = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    return np.asarray(ring[(way_in != way_out).any(axis=1)])
