"""Step 1, preprocessing (paper, section 2.1.1): smooth the noise, keep the walls.

Images here are uint8 (rows, cols) in the grid's own order, row 0 at the bottom; 0 is black
(an obstacle), 255 white. Eroding the white ground thickens the black walls, as in the paper's
Figures 2 and 3.
"""

from __future__ import annotations

import cv2
import numpy as np

from mapmeld.grid import OccupancyGrid
from mapmeld.matching.drawn_walls import Image, binarise

_SQUARE = np.ones((3, 3), np.uint8)


def thicken_walls(image: Image, times: int) -> Image:
    """Erode the white ground: walls grow by a pixel each time and gaps in them close (Figure 2a)."""
    return cv2.erode(image, _SQUARE, iterations=times).astype(np.uint8, copy=False)


def thin_walls(image: Image, times: int) -> Image:
    """Dilate the white ground: walls go back to their thickness, closed gaps stay (Figure 2b)."""
    return cv2.dilate(image, _SQUARE, iterations=times).astype(np.uint8, copy=False)


def blur_clutter(image: Image, side_px: int) -> Image:
    """Median blur: specks such as chair and table legs go, walls stay (Figure 3b)."""
    return cv2.medianBlur(image, side_px).astype(np.uint8, copy=False)


def preprocess(grid: OccupancyGrid, median_px: int = 3) -> Image:
    """Run the whole of section 2.1.1: binarise, close gaps in walls, remove clutter.

    Two erosions and two dilations close the gaps (Figure 2); erosion, median blur and dilation
    remove the clutter (Figure 3).
    """
    if not grid.cells.size:
        return np.zeros(grid.shape, np.uint8)
    image = binarise(grid)
    image = thin_walls(thicken_walls(image, 2), 2)
    return thin_walls(blur_clutter(thicken_walls(image, 1), median_px), 1)
