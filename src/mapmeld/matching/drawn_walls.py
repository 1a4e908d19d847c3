"""Obstacles drawn black on white, and how alike those of two maps are.

Images here are uint8 (rows, cols) in the grid's own order, row 0 at the bottom.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmeld.grid import OccupancyGrid
from mapmeld.se2 import Pose2

Image = NDArray[np.uint8]
Points = NDArray[np.float64]

BLACK, WHITE = 0, 255


def binarise(grid: OccupancyGrid) -> Image:
    """Return black obstacles on white; what is unknown becomes white (paper, Figure 1b)."""
    return np.where(grid.occupied, np.uint8(BLACK), np.uint8(WHITE))


def black_pixels(image: Image) -> Points:
    """Return the centres (col, row) + 0.5 of an image's black pixels, shape (n, 2) [px]."""
    rows, cols = np.divmod(np.flatnonzero(image == BLACK), max(image.shape[1], 1))
    return np.stack([cols, rows]).T + 0.5


def jaccard_similarity(image_1: Image, black_2_px: Points, T_1_2_px: Pose2) -> float:
    """Return the black pixels that both maps share / the black pixels of either (Jaccard 1912).

    Each black pixel of map 2 is carried to the pixel of map 1 in which its centre falls. This counts
    what a rotation of the whole image would, to about 0.01, at the cost of the walls only.
    Pixels that fall outside map 1 belong to the union.
    """
    x, y = black_2_px.T
    c, s = math.cos(T_1_2_px.theta), math.sin(T_1_2_px.theta)
    height, width = image_1.shape
    col, row = c * x - s * y + T_1_2_px.x, s * x + c * y + T_1_2_px.y
    inside = (col >= 0) & (col < width) & (row >= 0) & (row < height)
    pixel = row[inside].astype(np.intp) * width + col[inside].astype(np.intp)
    black_1 = image_1.size - cv2.countNonZero(image_1) if image_1.size else 0
    shared = min(int(np.count_nonzero(image_1.ravel()[pixel] == BLACK)), black_1)
    union = black_1 + len(black_2_px) - shared
    return shared / union if union else 0.0
