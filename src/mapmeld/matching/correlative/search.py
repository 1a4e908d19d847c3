"""The search: a short ranked list of poses under which two maps may fit together.

The spectra of wall directions leave four rotations, known to a few degrees. For a small fan around each, the
maps are correlated over all shifts at once by FFT on coarse cells: a wall on a wall counts for, a wall on
the other's floor against. The sum is divided by a power of the area known in both (also an FFT), since
otherwise large overlaps of empty floor win. Where nothing stands out of the list, all rotations are tried.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmeld.matching.correlative.directions import relative_directions
from mapmeld.matching.correlative.masks import Image
from mapmeld.matching.correlative.reduced_map import ReducedMap, pooled
from mapmeld.se2 import Pose2, wrap_angle

Rows = NDArray[np.float64]

# Rotations to try
FAN_HALF = 4.0  # [deg] to either side of a direction: how wrong the spectra may be
STEP_MAX = 2.0  # [deg] between rotations
STEP_ARM = 0.1  # on large maps a step moves this share of their side by at most one cell
STEPS_MAX = 5  # to either side
SECOND_WEIGHT = 0.25  # of the best lag: further lags of the spectra above this get a fan of their own
DIRECTIONS_MAX = 4
UNCLEAR = 1.2  # best score / last score of the list, below which all rotations are tried

# Correlation
CELL_MIN = 0.3  # [m]
CELL_GROWS = 54.0  # [m] side of the correlation above which cells grow
CELL_POWER = 0.5  # with this power of the side
WALL_BLUR = 0.5  # [cells] of either map: how far walls may be apart and still support each other
FLOOR_WEIGHT = 2.0  # of floor against walls
FLOOR_GAP = 4.0  # how quickly floor stops counting near walls
MEAN_SHARE = 0.5  # of the mean of the signed raster, taken off
AREA_POWER = 0.8  # of the area known in both: 0.5 would suit independent cells, 1 asks for the best mean
OVERLAP_MIN = 0.2  # of the smaller map; smaller overlaps are divided as if they had this
KNOWN_STEP = 4  # that area varies slowly: its cells are this many times larger
PEAKS = 100  # of each quarter turn and direction

# The list
LISTED = 40
APART_METRES = 0.8
APART_RADIANS = math.radians(6)

_AROUND = np.ones((3, 3), np.uint8)


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """A pose to look at: `T_a_b` takes a point of b's metric frame to a's; larger scores are better."""

    T_a_b: Pose2
    score: float


def search(a: ReducedMap, b: ReducedMap, limit: int = LISTED) -> list[Hypothesis]:
    """Return at most `limit` (<= `LISTED`) poses of b in a, best first, different by 0.8 m or 6 degrees."""
    if not len(a.points) or not len(b.points):
        return []
    directions = _directions(a, b)
    rows = _correlate(a, b, directions)
    kept = _distinct(rows)
    if not kept or kept[0][3] < UNCLEAR * kept[-1][3]:
        # Nothing stands out: the walls' directions may have misled. All rotations.
        others = [directions[0] + k * math.radians(10) for k in range(1, 9)]
        rows = np.concatenate([rows, _correlate(a, b, others)])
        kept = _distinct(rows[np.argsort(-rows[:, 3], kind="stable")])
    if not kept:
        return []
    kept = kept[:limit]
    poses = _in_map_frames(a.T_map_mid, np.array(kept)[:, :3], b.T_map_mid)
    return [
        Hypothesis(Pose2(x, y, wrap_angle(theta)), float(row[3]))
        for (x, y, theta), row in zip(poses.tolist(), kept, strict=True)
    ]


def _in_map_frames(T_a_mid: Pose2, mids: Rows, T_b_mid: Pose2) -> Rows:
    """T_a_mid @ mid @ inverse(T_b_mid) for poses (n, 3) at once."""
    inverse = T_b_mid.inverse()
    c, s = np.cos(mids[:, 2]), np.sin(mids[:, 2])
    x = c * inverse.x - s * inverse.y + mids[:, 0]
    y = s * inverse.x + c * inverse.y + mids[:, 1]
    at = T_a_mid.apply(np.stack([x, y], axis=1))
    return np.column_stack([at, T_a_mid.theta + mids[:, 2] + inverse.theta])


def _directions(a: ReducedMap, b: ReducedMap) -> list[float]:
    """Return the relative directions worth a fan of their own, best first."""
    lags = relative_directions(a.spectrum, b.spectrum)
    out: list[float] = []
    for lag, weight in lags:
        if weight < SECOND_WEIGHT * lags[0][1]:
            break
        apart = [abs(math.remainder(lag - other, math.pi / 2)) for other in out]
        if all(d > math.radians(FAN_HALF + 2) for d in apart):
            out.append(lag)
    return out[:DIRECTIONS_MAX]


# ---------------------------------------------------------------------- correlation
def _correlate(a: ReducedMap, b: ReducedMap, directions: Sequence[float]) -> Rows:
    """Peaks (n, 4) of x, y, theta (mid frames), score; best first."""
    # a is turned so that its walls are parallel to the raster: its box is smallest then.
    base = -a.main_direction
    extent_a = _extent(a.points, base)
    extents_b = [_extent(b.points, direction + base) for direction in directions]
    side = math.sqrt(float(np.mean([np.prod(extent_a + e) for e in (extents_b[0], extents_b[0][::-1])])))
    cell = CELL_MIN * max(1.0, side / CELL_GROWS) ** CELL_POWER
    step = min(STEP_MAX, math.degrees(cell / (STEP_ARM * side)))
    count = min(STEPS_MAX, math.ceil(FAN_HALF / step - 1e-9))
    turns = np.radians(step * np.arange(-count, count + 1))
    coarse = cell * KNOWN_STEP
    signed_a, signed_b = (_signed(m, cell) for m in (a, b))
    known_a, known_b = (_Raster.reduced(m.known, m, coarse).as_float() for m in (a, b))
    least = OVERLAP_MIN * min(a.area, b.area) / coarse**2
    turned_a, turned_known_a = signed_a.turned(base, cell), known_a.turned(base, coarse)
    found = []
    for direction, extent_b in zip(directions, extents_b, strict=True):
        fan = [signed_b.turned(direction + turn + base, cell) for turn in turns]
        turned_known_b = known_b.turned(direction + base, coarse)
        for quarter in range(2):
            if quarter:
                fan = [cv2.rotate(image, cv2.ROTATE_90_CLOCKWISE) for image in fan]
                turned_known_b = cv2.rotate(turned_known_b, cv2.ROTATE_90_CLOCKWISE)
            theta = direction + quarter * math.pi / 2
            # Room for b turned by the middle of the fan; what juts out at its ends wraps around.
            size = extent_a + (extent_b[::-1] if quarter else extent_b)
            shape = (_fft_side(size[0] / cell), _fft_side(size[1] / cell))
            coarse_shape = (_fft_side(size[0] / coarse), _fft_side(size[1] / coarse))
            columns, lines = (np.fft.fftfreq(n, 1 / n).astype(np.float32) for n in shape)
            from_column, from_line = (
                _interpolation(at / KNOWN_STEP, n)
                for at, n in zip((columns, lines), coarse_shape, strict=True)
            )
            # The inverse transform's scale is taken along by a, once for all correlations.
            spectrum_a = _spectrum(turned_a, shape, cv2.DFT_SCALE)
            known_spectrum_a = _spectrum(turned_known_a, coarse_shape, cv2.DFT_SCALE)
            known_spectrum_b = _spectrum(turned_known_b, coarse_shape)
            spectra_b = [_spectrum(image, shape) for image in fan]
            for half in range(2):
                both = _correlation(known_spectrum_a, known_spectrum_b, half)
                both = cv2.pow(cv2.max(both, least), -AREA_POWER)
                got = [_correlation(spectrum_a, f, half) for f in spectra_b]
                best = got[0].copy()
                for other in got[1:]:
                    cv2.max(best, other, dst=best)
                best *= from_line @ both @ from_column.T
                top = np.flatnonzero((best >= cv2.dilate(best, _AROUND)) & (best > 0))
                value = best.take(top)
                if len(top) > PEAKS:
                    order = np.argpartition(-value, PEAKS - 1)[:PEAKS]
                    top, value = top[order], value[order]
                turn = turns.take(np.argmax(np.array([g.take(top) for g in got]), axis=0))
                row, col = np.divmod(top, shape[0])
                # Half a turn by convolution moves the answer by one cell (see _correlation).
                x, y = columns.take(col + half, mode="wrap"), lines.take(row + half, mode="wrap")
                found.append((x * cell, y * cell, theta + half * math.pi + turn, value))
    x, y, angle, value = map(np.concatenate, zip(*found, strict=True))
    c, s = math.cos(base), math.sin(base)
    rows = np.column_stack([c * x + s * y, c * y - s * x, angle, value])
    return rows[np.argsort(-value, kind="stable")]


def _signed(m: ReducedMap, cell: float) -> _Raster:
    """Walls +1, floor away from walls -FLOOR_WEIGHT, unknown 0; half of the mean taken off where known."""
    wall, floor, known = (_Raster.reduced(i, m, cell) for i in (m.wall, m.floor, m.known))
    sigma = WALL_BLUR * cell / wall.cell
    # Scaled so that a straight thin wall (one cell of the reduced map wide) has height 1.
    w: Image = cv2.GaussianBlur(wall.image.astype(np.float32), (0, 0), sigma)
    w *= np.float32(sigma * wall.cell / m.cell * 2.5 / 255)
    f = cv2.GaussianBlur(floor.image.astype(np.float32), (0, 0), sigma) * np.float32(1 / 255)
    k = known.image.astype(np.float32) * np.float32(1 / 255)
    out: Image = w - np.float32(FLOOR_WEIGHT) * np.maximum(np.float32(0), f * (1 - np.float32(FLOOR_GAP) * w))
    out -= k * np.float32(MEAN_SHARE * cv2.sumElems(cv2.multiply(out, k))[0] / max(cv2.sumElems(k)[0], 1.0))
    return _Raster(out, wall.cell, wall.centre)


@dataclass(frozen=True, slots=True)
class _Raster:
    image: Image
    cell: float
    centre: tuple[float, float]  # the mid frame's origin, (col, row) of pixel centres

    @classmethod
    def reduced(cls, image: Image, m: ReducedMap, wanted: float) -> _Raster:
        """Average a raster down by a whole number: sampling it `wanted` metres apart then skips nothing."""
        k = max(1, int(wanted / m.cell + 0.2))
        return cls(pooled(image, k), m.cell * k, (m.middle[0] / k - 0.5, m.middle[1] / k - 0.5))

    def as_float(self) -> _Raster:
        """Bytes 0..255 as 0..1."""
        return replace(self, image=self.image.astype(np.float32) * np.float32(1 / 255))

    def turned(self, theta: float, cell: float) -> Image:
        """Sample the whole map, turned by theta about its middle, which stays in the middle of the image."""
        c, s = math.cos(theta) * cell / self.cell, math.sin(theta) * cell / self.cell
        rows, cols = self.image.shape
        x, y = self.centre
        # To a pixel beyond the outermost centres, where the map has faded out.
        reach_x, reach_y = max(x + 1, cols - x), max(y + 1, rows - y)
        along, aside = abs(c) / (c * c + s * s), abs(s) / (c * c + s * s)
        u, v = math.ceil(along * reach_x + aside * reach_y), math.ceil(aside * reach_x + along * reach_y)
        m = np.array([[c, s, x - c * (u - 0.5) - s * (v - 0.5)], [-s, c, y + s * (u - 0.5) - c * (v - 0.5)]])
        return cv2.warpAffine(self.image, m, (2 * u, 2 * v), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)


def _spectrum(image: Image, shape: tuple[int, int], flags: int = 0) -> Image:
    """Spectrum of an image cut or filled up with 0 to `shape` (cols, rows) about its middle; all even."""
    rows, cols = image.shape
    right, top = (shape[0] - cols) // 2, (shape[1] - rows) // 2
    if right < 0 or top < 0:
        image = image[max(0, -top) : rows + min(0, top), max(0, -right) : cols + min(0, right)]
        right, top = max(0, right), max(0, top)
    return cv2.dft(cv2.copyMakeBorder(image, top, top, right, right, cv2.BORDER_CONSTANT), flags=flags)


def _interpolation(at: NDArray[Any], n: int) -> NDArray[np.float32]:
    """Matrix (len(at), n) that takes n values, repeated for ever, to those in between at `at`."""
    before = np.floor(at)
    share = at - before
    before = before.astype(np.intp)
    rows = np.arange(len(at))
    weights = np.zeros((len(at), n), np.float32)
    weights[rows, before % n] = 1 - share
    weights[rows, (before + 1) % n] += share
    return weights


def _correlation(spectrum_a: Image, spectrum_b: Image, half_turn: int) -> Image:
    """Sum over cells of a times b shifted; b also turned by half a turn where wanted.

    Turning the image by 180 degrees conjugates its spectrum up to a shift by one cell, which is left
    in the answer.
    """
    product = cv2.mulSpectrums(spectrum_a, spectrum_b, 0, conjB=not half_turn)
    return cv2.dft(product, dst=product, flags=cv2.DFT_INVERSE)


def _extent(points: NDArray[np.float32], theta: float) -> Rows:
    c, s = math.cos(theta), math.sin(theta)
    reach: Rows = np.abs(np.array([[c, -s], [s, c]], np.float32) @ points.T).max(axis=1).astype(np.float64)
    return 2 * reach + 1.0


def _fft_side(cells: float) -> int:
    n = cv2.getOptimalDFTSize(math.ceil(cells))
    while n % 2:
        n = cv2.getOptimalDFTSize(n + 1)
    return n


def _distinct(rows: Rows) -> list[Rows]:
    """Return the best `LISTED` rows (x, y, theta, score; best first) that are not near a better one."""
    rows = rows[: 5 * LISTED]
    (x, y), turn = rows[:, :2].T.astype(np.float32), rows[:, 2]
    near = (x[:, None] - x) ** 2 + (y[:, None] - y) ** 2 < APART_METRES**2
    heading = np.stack([np.cos(turn), np.sin(turn)])
    near &= heading.T @ heading > math.cos(APART_RADIANS)
    far = ~near
    kept: list[int] = []
    alive = np.ones(len(rows), np.bool_)
    while len(kept) < min(LISTED, len(rows)):
        best = int(alive.argmax())
        if not alive[best]:
            break
        kept.append(best)
        alive &= far[best]
    return [rows[k] for k in kept]
