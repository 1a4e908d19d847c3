"""From cells to a picture, and from lattice positions to places in it.

This is the one place of the report where up and down change over: cells, corners and poses have y up
and row 0 at the bottom, pictures have row 0 at the top.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mapmeld.grid import Mask, OccupancyGrid
from mapmeld.report.palette import FLOOR_WHITE, UNKNOWN_GREY, WALL_BLACK, Colour
from mapmeld.se2 import wrap_angle

Picture = NDArray[np.uint8]
"""(height, width, 3), row 0 at the top, blue-green-red."""

Labels = NDArray[np.uint8]
"""(rows, cols), row 0 at the bottom: the number of a cell's colour in a palette."""

LONG_SIDE_PX = 1000
_LONGEST_UNSHRUNK = 2  # times the long side that is aimed at


@dataclass(frozen=True, slots=True)
class Window:
    """The part of a lattice that a picture shows, in whole cells; it may reach beyond the map.

    Attributes
    ----------
    col, row
        Its lower left corner.
    cols, rows
        Its size, at least 1 x 1.
    """

    col: int
    row: int
    cols: int
    rows: int

    @classmethod
    def around(cls, shape: tuple[int, int], mask: Mask, margin: int = 0) -> Window:
        """Return the window of the cells where `mask` holds; of everything if it holds nowhere."""
        rows, cols = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        if not rows.size:
            return cls(0, 0, max(shape[1], 1), max(shape[0], 1))
        return cls(
            int(cols[0]) - margin,
            int(rows[0]) - margin,
            int(cols[-1] - cols[0]) + 1 + 2 * margin,
            int(rows[-1] - rows[0]) + 1 + 2 * margin,
        )

    def reaching(self, lattice: ArrayLike, margin: int = 0) -> Window:
        """Return the window grown to hold the (col, row) positions (n, 2) too."""
        points = np.asarray(lattice, dtype=np.float64).reshape(-1, 2)
        if not len(points):
            return self
        low = np.minimum(np.floor(points.min(axis=0)).astype(int) - margin, (self.col, self.row))
        high = np.maximum(
            np.ceil(points.max(axis=0)).astype(int) + margin, (self.col + self.cols, self.row + self.rows)
        )
        cols, rows = high - low
        return Window(int(low[0]), int(low[1]), int(cols), int(rows))


@dataclass(frozen=True, slots=True, eq=False)
class Canvas:
    """A picture and where the lattice lies in it.

    Attributes
    ----------
    picture
        See `Picture`.
    window
        The part of the lattice that it shows.
    px_per_cell
        A whole number, or one over a whole number.
    """

    picture: Picture
    window: Window
    px_per_cell: float

    def place(self, lattice: ArrayLike) -> NDArray[np.float64]:
        """Take (col, row) lattice positions (..., 2) to (x, y) in the picture [px], y down.

        Whole numbers are pixel corners in the picture as they are cell corners on the lattice.
        """
        p = np.asarray(lattice, dtype=np.float64) - (self.window.col, self.window.row)
        p = p * self.px_per_cell
        return np.stack([p[..., 0], len(self.picture) - p[..., 1]], axis=-1)


def whole_scale(cells: int, long_side_px: int = LONG_SIDE_PX) -> float:
    """Return the pixels per cell, whole or one over whole, for a long side of `cells` cells.

    The picture's long side comes near `long_side_px`; it is shrunk only if it would be twice as long.
    """
    if cells > _LONGEST_UNSHRUNK * long_side_px:
        return 1 / round(cells / long_side_px)
    return float(max(1, round(long_side_px / max(cells, 1))))


def paint(
    labels: Labels,
    palette: Sequence[Colour] | NDArray[np.uint8],
    window: Window | None = None,
    px_per_cell: float | None = None,
) -> Canvas:
    """Turn labels into a picture.

    Parameters
    ----------
    labels
        See `Labels`. Where the picture must be shrunk, the greatest label of a block of cells is
        shown: give what must not be lost (walls) the greater number.
    palette
        The colour of every label.
    window
        What to show, by default everything. Cells beyond the labels get label 0.
    px_per_cell
        As `whole_scale` gives; by default for a long side near 1000 px.
    """
    rows, cols = labels.shape
    window = window or Window(0, 0, max(cols, 1), max(rows, 1))
    scale = px_per_cell or whole_scale(max(window.rows, window.cols))
    shown = _cut(labels, window)
    if scale < 1:
        shown = _shrink(shown, round(1 / scale))
    upright = np.asarray(palette, dtype=np.uint8)[shown[::-1]]
    if scale > 1:
        upright = upright.repeat(round(scale), axis=0).repeat(round(scale), axis=1)
    return Canvas(np.ascontiguousarray(upright), window, scale)


def _cut(labels: Labels, window: Window) -> Labels:
    rows, cols = labels.shape
    cut = np.zeros((window.rows, window.cols), np.uint8)
    r0, r1 = max(window.row, 0), min(window.row + window.rows, rows)
    c0, c1 = max(window.col, 0), min(window.col + window.cols, cols)
    if r0 < r1 and c0 < c1:
        cut[r0 - window.row : r1 - window.row, c0 - window.col : c1 - window.col] = labels[r0:r1, c0:c1]
    return cut


def _shrink(labels: Labels, times: int) -> Labels:
    """Return the greatest label of every block of times x times cells, counted from the lower left."""
    rows, cols = labels.shape
    padded = np.pad(labels, ((0, -rows % times), (0, -cols % times)))
    greatest = padded[::times, ::times].copy()
    for row in range(times):
        for col in range(times):
            np.maximum(greatest, padded[row::times, col::times], out=greatest)
    return greatest


# ---------------------------------------------------------------------- maps
GREYS: tuple[Colour, ...] = (UNKNOWN_GREY, FLOOR_WHITE, WALL_BLACK)


def grey_labels(grid: OccupancyGrid) -> Labels:
    """Return labels for `GREYS`: 0 unknown or undecided, 1 floor, 2 obstacle."""
    labels = grid.free.astype(np.uint8)
    labels[grid.occupied] = 2
    return labels


def paint_map(grid: OccupancyGrid, window: Window | None = None, px_per_cell: float | None = None) -> Canvas:
    """Paint a map in the paper's greys, by default its known part and a small margin."""
    return paint(grey_labels(grid), GREYS, window or known_window(grid), px_per_cell)


def with_turn(caption: str, grid: OccupancyGrid) -> str:
    """Return the caption of a picture of `grid`; if its lattice has a yaw, with a sentence about that.

    Pictures lie along the cells, so that coordinates of a turned lattice cannot be read off them.
    """
    degrees = round(math.degrees(wrap_angle(grid.origin.theta)), 1)
    if degrees == 0:
        return caption
    note = f"The picture lies along the cells, which are turned by {degrees:.1f} degrees in the map's frame."
    return f"{caption} {note}".strip()


def known_window(grid: OccupancyGrid) -> Window:
    """Return the window of a map's known cells with a margin of 2 percent."""
    return Window.around(grid.shape, grid.known, margin=2 + max(grid.shape) // 50)
