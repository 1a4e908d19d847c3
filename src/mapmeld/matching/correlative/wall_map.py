"""A map made ready for comparison: points on its walls, and fields in which other maps' walls look them up.

Everything is measured in metres, in the map's *local frame* (corner at the lower left of its known
cells, axes along its lattice): far origins cost no precision and unknown borders change nothing.
Points and vectors of the plane are complex numbers: turning is a product, and ``e * conj(normal)`` is
the distance across a wall (real part) and along it (imaginary part) at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmeld.matching.correlative.masks import Image, MapMasks
from mapmeld.matching.correlative.reduced_map import places, shares
from mapmeld.se2 import Pose2

Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]
Plane = NDArray[np.complex64]
Index = NDArray[np.intp]
Cells = NDArray[np.int32]

FIELD_CELL = 0.1  # [m] lattice on which the nearest wall is looked up; finer detail is in the wall points
MAX_FIELD_CELLS = 6_000_000  # larger maps get coarser fields, so that time and memory stay bounded
BORDER = 3  # unknown cells around a field, where points outside the map land
STRAIGHT_LEAST = 0.3  # of a line; below, a wall point has no direction
THICK_LEAST = 0.5  # of a line in more than 3 x 3 field cells; below, its sides may be out of sight
FLOOR_SAMPLE = 1000  # known cells that measure the overlap


def _ring(r: int) -> list[tuple[int, int]]:
    """(dx, dy) of the field cells r away from one, counted as a king walks."""
    square = [(dx, dy) for dy in range(-r, r + 1) for dx in range(-r, r + 1)]
    return [at for at in square if max(map(abs, at)) == r]


_NEAR = [*_ring(0), *_ring(1)]
_FURTHER = [_ring(2), _ring(3)]


@dataclass(frozen=True, slots=True, eq=False)
class WallMap:
    """A map made ready for many comparisons.

    Attributes
    ----------
    frame
        Pose of the local frame in the map's metric frame.
    cell
        Side of a field cell [m].
    shape
        (rows, cols) of the fields, border included.
    depth
        How deep inside the free space a field cell lies: distance to what is not free [m];
        0 on walls, -1 where unknown. Flat.
    nearest
        Index into `points` of the wall point nearest to a field cell. Flat.
    points, normals
        Wall points (n,) [m] on the middle line of the wall and the wall's unit normals, in an order
        in which the first k are a fair sample, for every k.
    straight
        How line-like the wall is at each point (n,), 0 (blob, corner) .. 1.
    lines
        Unit normals (n,) of the lines that the points lie on, thick walls included; 0 where there is none.
    metres
        Length of wall that each point stands for (n,) [m].
    floor
        Sample of known places (m,) [m].
    area
        Known area [m^2].
    """

    frame: Pose2
    cell: float
    shape: tuple[int, int]
    depth: Floats
    nearest: Cells
    points: Plane
    normals: Plane
    straight: Floats
    lines: Plane
    metres: Floats
    floor: Plane
    area: float

    def at(self, z: Plane) -> Cells:
        """Return flat field indices of points of the local frame; outside is the (unknown) border."""
        rows, cols = self.shape
        # Real and imaginary parts side by side, x in the even places.
        cell = z.view(np.float32) * np.float32(1 / self.cell)
        cell += np.float32(BORDER)
        np.maximum(cell, 0, out=cell)
        whole = cell.astype(np.int32)
        flat = np.minimum(whole[..., 1::2], rows - 1)
        flat *= cols
        flat += np.minimum(whole[..., ::2], cols - 1)
        return flat


def wall_map(masks: MapMasks) -> WallMap:
    """Compute the fields and wall points of a map."""
    wall = masks.wall
    k = max(1, round(FIELD_CELL / masks.resolution))
    while wall.size / k**2 > MAX_FIELD_CELLS:
        k += 1
    cell = masks.resolution * k
    shape = (-(-wall.shape[0] // k) + 2 * BORDER, -(-wall.shape[1] // k) + 2 * BORDER)
    wall_points = _wall_points(wall, k, shape)
    own, n = wall_points.own, len(wall_points.own)

    no_wall = np.full(shape[0] * shape[1], 255, np.uint8)
    no_wall[own] = 0
    no_wall = no_wall.reshape(shape)
    _, labels = cv2.distanceTransformWithLabels(
        no_wall, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    label = np.asarray(labels, np.int32).ravel()
    of_label = np.zeros(n + 1, np.int32)
    of_label[label[own]] = np.arange(n, dtype=np.int32)

    is_free = cv2.min(_with_border(cv2.inRange(shares(masks.floor, k), 128, 255)), no_wall)
    depth: Image = cv2.distanceTransform(is_free, cv2.DIST_L2, cv2.DIST_MASK_5)
    depth *= np.float32(cell)
    is_known = (_with_border(shares(masks.known, k)) > 127) | (no_wall == 0)
    depth[~is_known] = -1
    floor = np.flatnonzero(is_known)
    step = max(1, len(floor) // FLOOR_SAMPLE)
    floor = floor[step // 2 :: step]
    floor_row = floor // shape[1]
    floor_place = np.empty(len(floor), np.complex64)
    floor_place.imag = (floor_row + (0.5 - BORDER)) * cell
    floor_place.real = (floor - floor_row * shape[1] + (0.5 - BORDER)) * cell
    return WallMap(
        frame=masks.origin,
        cell=cell,
        shape=shape,
        depth=depth.ravel(),
        nearest=of_label.take(label),
        points=(wall_points.place * cell).astype(np.complex64),
        normals=wall_points.normal.astype(np.complex64),
        straight=wall_points.straight.astype(np.float32),
        lines=wall_points.line.astype(np.complex64),
        metres=(wall_points.length * cell).astype(np.float32),
        floor=floor_place,
        area=cv2.countNonZero(masks.known) * masks.resolution**2,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _WallPoints:
    """One point for each field cell that holds wall; places and lengths in field cells."""

    own: Index  # flat field index
    place: NDArray[np.complex128]
    normal: NDArray[np.complex128]
    straight: Doubles
    line: NDArray[np.complex128]
    length: Doubles  # of wall that the point stands for


def _wall_points(wall: Image, k: int, shape: tuple[int, int]) -> _WallPoints:
    """Find the wall points of a map's cells, k x k of which make a field cell.

    A point is moved onto the wall's middle line, found from the first and second moments of the wall
    cells in the 3 x 3 field cells around it. This takes the raggedness of a cell out of the walls.
    A thick wall looks like a blob to them; whether it is a line after all, 5 x 5 and then 7 x 7 tell. Where
    a wall takes up several field cells side by side, they share its length.
    """
    width = shape[1]
    row, col = places(wall)
    flat = (row // k + BORDER) * width + (col // k + BORDER)
    holds = np.zeros(shape[0] * width, np.bool_)
    holds[flat] = True
    # In any order: the first k of them are a fair sample then.
    own = np.random.default_rng(0).permutation(np.flatnonzero(holds))
    n = len(own)
    place = np.full(shape[0] * width, n, np.int32)
    place[own] = np.arange(n, dtype=np.int32)
    # In half cells centres are whole numbers: their sums and differences are exact, wherever they lie.
    x, y = (2 * v + (2 * k * BORDER + 1.0) for v in (col, row))
    i = place[flat]
    # Row n stays empty: it answers for neighbours without wall.
    m = np.empty((n + 1, 7))
    for column, weight in enumerate((None, x, y, x * x, x * y, y * y)):
        m[:, column] = np.bincount(i, weight, n + 1)
    m[:n, 6], m[n, 6] = 1, 0  # counts field cells
    near = _sums(m, place, own, width, _NEAR)
    along, straight, middle, length = _lines(near)
    blob = np.flatnonzero(straight <= STRAIGHT_LEAST)
    wide = near[blob]
    for ring in _FURTHER:
        wide += _sums(m, place, own[blob], width, ring)
        along_wide, straight_wide, middle_wide, length[blob] = _lines(wide)
        thick = straight_wide > THICK_LEAST
        of_wall = blob[thick]
        along[of_wall], straight[of_wall] = along_wide[thick], straight_wide[thick]
        middle[of_wall] = middle_wide[thick]
        blob, wide = blob[~thick], wide[~thick]
    mine = (m[:n, 1] + 1j * m[:n, 2]) / m[:n, 0]
    on_line = middle + along * ((mine - middle) * along.conj()).real
    spot = np.where(straight > STRAIGHT_LEAST, on_line, mine) / (2 * k) - (1 + 1j) * BORDER
    line = np.where(straight > STRAIGHT_LEAST, along * 1j, 0)
    return _WallPoints(own, np.asarray(spot), along * 1j, straight, line, length / (2 * k))


def _sums(m: Doubles, place: Cells, own: Index, width: int, around: list[tuple[int, int]]) -> Doubles:
    """Return the sums (len(own), 7) of the moments `m` over the field cells (dx, dy) around each of `own`."""
    s = np.zeros((len(own), 7))
    for dx, dy in around:
        s += m.take(place.take(own + (dy * width + dx)), axis=0)
    return s


def _lines(s: Doubles) -> tuple[NDArray[np.complex128], Doubles, NDArray[np.complex128], Doubles]:
    """Fit lines to walls of which these are the moments (n, 7).

    Returns their directions, how straight the walls are, their middles, and the length of them that
    falls to each field cell; in half cells of the map.
    """
    count, x, y, xx, xy, yy, cells = np.ascontiguousarray(s.T)
    # Central moments times the square of count: whole numbers.
    xx, xy, yy = count * xx - x * x, count * xy - x * y, count * yy - y * y
    half, slant = (xx + yy) / 2, (xx - yy) / 2
    root = np.sqrt(slant * slant + xy * xy)
    cosine = np.where(root > 0, slant / np.maximum(root, 0.5), 1)  # of twice the angle
    along = np.empty(len(s), np.complex128)
    along.real, along.imag = np.sqrt((1 + cosine) / 2), np.copysign(np.sqrt((1 - cosine) / 2), xy)
    straight = np.maximum(1 - 3 * (half - root) / np.maximum(half + root, 0.5), 0)
    straight[count < 3] = 0
    # What is spread evenly over a length has a twelfth of its square as variance; so has each map cell.
    length = np.sqrt(12 * ((half + root) / (count * count) + 1 / 3)) / cells
    return along, straight, (x + 1j * y) / count, length


def _with_border(image: Image) -> Image:
    return cv2.copyMakeBorder(image, BORDER, BORDER, BORDER, BORDER, cv2.BORDER_CONSTANT)
