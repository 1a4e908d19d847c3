"""Step 2, features (paper, section 2.1.2): the corners of the walls."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmeld.matching.alphabet.parameters import AlphabetParameters
from mapmeld.matching.drawn_walls import Image

Points = NDArray[np.float64]

# Side of the neighbourhood over which Shi and Tomasi's matrix is summed, OpenCV's default.
_BLOCK_PX = 3
# Rows for which the response is computed at a time: so few stay in the processor's cache,
# which halves the time on large maps.
_STRIP_ROWS = 128


def extract_corners(image: Image, parameters: AlphabetParameters) -> Points:
    """Return the strongest corners of a preprocessed map, the list L_m of Expression 1.

    Good features to track (Shi and Tomasi 1994): at most N corners, none weaker than q times
    the strongest, none nearer to a stronger one than the spacing. The same corners as
    OpenCV's `goodFeaturesToTrack` in half the time; equally strong ones are taken in
    the order of their rows, not of their addresses in memory.

    Returns
    -------
    (n, 2) array of (col, row) lattice positions [px], strongest first: cell corners are whole
    numbers, so the centre of the pixel in which a corner was found is at + 0.5.
    """
    if min(image.shape) < 3:
        return np.empty((0, 2))
    response = _smaller_eigenvalue(image)
    strongest = float(response.max())
    if strongest <= 0.0:
        return np.empty((0, 2))
    rows, cols = np.nonzero(response[1:-1, 1:-1] > parameters.corner_quality * strongest)
    rows, cols = rows + 1, cols + 1
    strength = response[rows, cols]
    peak = np.ones(len(rows), np.bool_)
    for dr, dc in ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)):
        peak &= strength >= response[rows + dr, cols + dc]
    order = np.argsort(-strength[peak], kind="stable")
    waiting = np.stack([cols[peak], rows[peak]], axis=-1)[order].astype(np.float64)
    corners: list[NDArray[np.float64]] = []
    while len(waiting) and len(corners) < parameters.corners:
        corner = waiting[0]
        corners.append(corner)
        away = ((waiting - corner) ** 2).sum(axis=1) >= parameters.corner_spacing_px**2
        away[0] = False
        waiting = waiting[away]
    return np.array(corners) + 0.5


def _smaller_eigenvalue(image: Image) -> NDArray[np.float32]:
    """Return Shi and Tomasi's response: how much the image changes in its most constant direction."""
    response = np.empty(image.shape, np.float32)
    reach = 1 + _BLOCK_PX // 2  # of the derivative and the sum together
    for start in range(0, len(image), _STRIP_ROWS):
        low = max(0, start - reach)
        strip = cv2.cornerMinEigenVal(image[low : start + _STRIP_ROWS + reach], _BLOCK_PX)
        response[start : start + _STRIP_ROWS] = strip[start - low : start - low + _STRIP_ROWS]
    return response
