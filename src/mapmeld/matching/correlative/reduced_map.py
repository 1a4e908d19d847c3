"""A map made ready for the search: coarse rasters of its walls and floor, and which way its walls run."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmeld.matching.correlative.directions import SPECTRUM_BLUR, direction_spectrum, main_direction
from mapmeld.matching.correlative.masks import Image, MapMasks
from mapmeld.se2 import Pose2

REDUCED_CELL = 0.2
"""Side of a raster cell [m], about: the nearest whole multiple of the map's own cells."""


@dataclass(frozen=True, slots=True, eq=False)
class ReducedMap:
    """What the search needs of one map.

    All rasters have square cells of `cell` metres, row 0 at the bottom. The map's "mid" frame has the
    raster's axes, and its origin is the middle of the smallest box around the walls that is parallel to
    the main direction: correlations are then as small as they can be.

    Attributes
    ----------
    wall, floor
        0..255: obstacle (any in the reduced cell), share of free cells.
    known
        255 where measured, else 0.
    middle
        The mid frame's origin in cells of the rasters (col, row), corner based.
    T_map_mid
        Takes a point of the mid frame to the map's metric frame.
    spectrum
        How much wall runs in each direction, `BINS` bins over 180 degrees of the mid frame.
    main_direction
        [rad] of the mid frame, modulo a right angle.
    points
        Wall cell centres (n, 2) in the mid frame [m].
    area
        Known area [m^2].
    """

    cell: float
    wall: Image
    floor: Image
    known: Image
    middle: tuple[float, float]
    T_map_mid: Pose2
    spectrum: NDArray[np.float64]
    main_direction: float
    points: NDArray[np.float32]
    area: float


def reduce_map(masks: MapMasks) -> ReducedMap:
    """Reduce a map to what the search needs."""
    k = max(1, round(REDUCED_CELL / masks.resolution))
    cell = masks.resolution * k
    margin = math.ceil(4 * SPECTRUM_BLUR / cell)
    covered = _with_border(shares(masks.wall, k), margin)
    wall = cv2.inRange(covered, 1, 255)
    floor = _with_border(shares(masks.floor, k), margin)
    floor[wall > 0] = 0
    known = cv2.max(wall, cv2.inRange(floor, 128, 255))
    spectrum = direction_spectrum(covered, cell)
    main = main_direction(spectrum)
    # A row for x and one for y: what is done to them is several times as fast then.
    points = (np.stack(places(wall)[::-1]).astype(np.float32) + np.float32(0.5)) * np.float32(cell)
    middle = _middle(points, main)
    x, y = middle.tolist()
    mid = masks.origin @ Pose2(x - margin * cell, y - margin * cell)
    return ReducedMap(
        cell=cell,
        wall=wall,
        floor=floor,
        known=known,
        middle=(x / cell, y / cell),
        T_map_mid=replace(mid, theta=masks.origin.theta),
        spectrum=spectrum,
        main_direction=main,
        points=(points - middle[:, None]).T,
        area=cv2.countNonZero(known) * cell**2,
    )


def _middle(points: NDArray[np.float32], direction: float) -> NDArray[np.float32]:
    """Middle of the box around the points (2, n) that is turned by `direction`."""
    if not points.size:
        return np.zeros(2, np.float32)
    c, s = math.cos(direction), math.sin(direction)
    axes = np.array([[c, s], [-s, c]], np.float32)
    u = axes @ points
    middle: NDArray[np.float32] = (u.min(axis=1) + u.max(axis=1)) / 2 @ axes
    return middle


def places(mask: Image) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns where a mask is not 0, in the mask's order: `np.nonzero`, ten times as fast."""
    at = np.flatnonzero(mask != 0)
    row = at // mask.shape[1]
    return row, at - row * mask.shape[1]


def pooled(image: Image, k: int) -> Image:
    """Average of k x k blocks; the last blocks are filled up with 0."""
    if k == 1:
        return image
    if k > 15 and image.dtype == np.uint8:
        # A single pixel must not be rounded away.
        return np.ceil(pooled(image.astype(np.float32), k)).astype(np.uint8)
    rows, cols = image.shape
    image = cv2.copyMakeBorder(image, 0, -rows % k, 0, -cols % k, cv2.BORDER_CONSTANT)
    return cv2.resize(image, (image.shape[1] // k, image.shape[0] // k), interpolation=cv2.INTER_AREA)


def shares(mask: Image, k: int) -> Image:
    """Share of k x k blocks where a mask (0 or 255) holds, 0..255: `pooled`, faster."""
    if k not in (4, 8):
        return pooled(mask, k)
    # OpenCV halves an image many times as fast as it shrinks it by other numbers. With this value in
    # place of 255 every half is a whole number.
    whole = 256 - k * k
    rows, cols = mask.shape
    halved: Image = cv2.copyMakeBorder(mask, 0, -rows % k, 0, -cols % k, cv2.BORDER_CONSTANT)
    np.bitwise_and(halved, whole, out=halved)
    for _ in range(k.bit_length() - 1):
        halved = pooled(halved, 2)
    return cv2.convertScaleAbs(halved, alpha=255 / whole)


def _with_border(image: Image, margin: int) -> Image:
    return cv2.copyMakeBorder(image, margin, margin, margin, margin, cv2.BORDER_CONSTANT)
