"""The occupancy grid, and the one place where cells meet metres.

Conventions, used everywhere in mapmeld:

- ``cells[row, col]`` with row 0 at the *bottom* (y up), as in ``nav_msgs/OccupancyGrid``.
- A cell is an area. Cell (row, col) covers [col, col + 1) x [row, row + 1) in *lattice
  units*; its centre is at (col + 0.5, row + 0.5).
- ``origin`` is the pose of the lattice's lower left *corner* in the map's metric frame, so
  ``metres = origin.apply(resolution * lattice)``. The yaw of the origin turns the lattice.
- Images have row 0 at the top; `OccupancyGrid.to_image` and `from_image` are the only flips.
"""

from __future__ import annotations

import math
import weakref
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mapmeld.errors import MapmeldError
from mapmeld.se2 import Pose2

UNKNOWN = -1
FREE = 0
OCCUPIED = 100

# What counts as a wall or as floor where cells carry probabilities [percent]:
# the default thresholds of nav2's map_server.
OCCUPIED_FROM = 65
FREE_UP_TO = 25

Cells = NDArray[np.int8]
Mask = NDArray[np.bool_]

# The arrays of all grids, by their id: nobody has ever been able to write to them.
_frozen: weakref.WeakValueDictionary[int, Cells] = weakref.WeakValueDictionary()


class ResolutionError(MapmeldError):
    """Two cell sizes that cannot both be right."""


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class OccupancyGrid:
    """A map: cells on a square lattice with its place in a metric frame.

    Attributes
    ----------
    cells
        int8 array (rows, cols), row 0 at the bottom; -1 unknown, 0..100 occupancy [percent].
        Made read-only: a grid never changes, so what is computed from it stays true.
    resolution
        Side of a cell [m].
    origin
        Pose of the lattice's lower left corner in the map's frame [m, m, rad].
    stamp
        Time of the map [s since the epoch or the start of a recording]; None if unknown.
    frame_id
        Name of the metric frame, as in a ROS header; may be empty.
    """

    cells: Cells
    resolution: float
    origin: Pose2 = field(default_factory=Pose2)
    stamp: float | None = None
    frame_id: str = ""

    def __post_init__(self) -> None:
        cells = np.asarray(self.cells)
        if cells.ndim != 2:
            raise ValueError(f"cells must be a (rows, cols) array, not {cells.ndim}-dimensional")
        if not np.issubdtype(cells.dtype, np.integer):
            raise ValueError(f"cells must be integers (-1, 0..100), not {cells.dtype}")
        if cells.size and (cells.min() < UNKNOWN or cells.max() > OCCUPIED):
            raise ValueError("cells must be -1 (unknown) or 0..100 (percent)")
        if not (math.isfinite(self.resolution) and self.resolution > 0):
            raise ValueError(f"resolution must be a positive number of metres, not {self.resolution}")
        if not all(map(math.isfinite, (self.origin.x, self.origin.y, self.origin.theta))):
            raise ValueError(f"origin must be finite, not {self.origin}")
        # A read-only copy, as somebody may hold a writable view of any array but those of other grids.
        if _frozen.get(id(cells)) is not cells:
            cells = np.array(cells, dtype=np.int8, order="C")
            cells.flags.writeable = False
            _frozen[id(cells)] = cells
        object.__setattr__(self, "cells", cells)

    # ------------------------------------------------------------------ what is known
    @property
    def shape(self) -> tuple[int, int]:
        """(rows, cols)."""
        rows, cols = self.cells.shape
        return rows, cols

    @property
    def occupied(self) -> Mask:
        """Where there is an obstacle: occupancy of at least 65 percent."""
        return self.cells >= OCCUPIED_FROM

    @property
    def free(self) -> Mask:
        """Where there is floor: occupancy known and at most 25 percent."""
        return (self.cells >= 0) & (self.cells <= FREE_UP_TO)

    @property
    def known(self) -> Mask:
        """Where anything was measured."""
        return self.cells >= 0

    @property
    def known_area(self) -> float:
        """Measured area [m^2]."""
        return float(np.count_nonzero(self.known)) * self.resolution**2

    def __eq__(self, other: object) -> bool:
        """Report whether cells, resolution, origin and frame are the same (stamps aside)."""
        if not isinstance(other, OccupancyGrid):
            return NotImplemented
        return (
            self.resolution == other.resolution
            and self.origin == other.origin
            and self.frame_id == other.frame_id
            and np.array_equal(self.cells, other.cells)
        )

    __hash__ = None  # type: ignore[assignment]

    # ------------------------------------------------------------------ cells <-> metres
    def lattice_to_metres(self, lattice: ArrayLike) -> NDArray[np.float64]:
        """Take (col, row) lattice positions (..., 2) into the map's frame [m].

        Whole numbers are cell corners; add 0.5 for centres.
        """
        return self.origin.apply(np.asarray(lattice, dtype=np.float64) * self.resolution)

    def metres_to_lattice(self, points: ArrayLike) -> NDArray[np.float64]:
        """Take points (..., 2) of the map's frame [m] to (col, row) lattice positions.

        ``floor`` of the answer is the cell that holds the point.
        """
        return self.origin.inverse().apply(points) / self.resolution

    def centres(self, mask: Mask) -> NDArray[np.float64]:
        """Return the centres [m], shape (n, 2), of the cells where `mask` (rows, cols) holds."""
        rows, cols = np.nonzero(mask)
        return self.lattice_to_metres(np.stack([cols, rows], axis=-1) + 0.5)

    # ------------------------------------------------------------------ other lattices
    def moved(self, T_new_old: Pose2) -> OccupancyGrid:
        """Return the same cells in another metric frame: only the origin changes, exactly."""
        return replace(self, origin=T_new_old @ self.origin)

    def extended(self, left: int, bottom: int, right: int, top: int) -> OccupancyGrid:
        """Return the map with unknown cells added (or, where negative, cells cut off) per side."""
        rows, cols = self.shape
        new_rows, new_cols = rows + bottom + top, cols + left + right
        cells = np.full((max(new_rows, 0), max(new_cols, 0)), UNKNOWN, np.int8)
        r0, r1 = max(0, -bottom), min(rows, rows + top)
        c0, c1 = max(0, -left), min(cols, cols + right)
        if r0 < r1 and c0 < c1:
            cells[r0 + bottom : r1 + bottom, c0 + left : c1 + left] = self.cells[r0:r1, c0:c1]
        x, y = map(_without_noise, self.lattice_to_metres((-left, -bottom)).tolist())
        return replace(self, cells=cells, origin=Pose2(x, y, self.origin.theta))

    def cropped(self, margin: int = 0) -> OccupancyGrid:
        """Return the map cut (or grown) to its known cells and `margin` cells around them.

        A map with nothing known is returned as it is.
        """
        known = self.known
        rows = np.flatnonzero(known.any(axis=1))
        cols = np.flatnonzero(known.any(axis=0))
        if not rows.size:
            return self
        height, width = self.shape
        return self.extended(
            left=margin - int(cols[0]),
            bottom=margin - int(rows[0]),
            right=margin - (width - 1 - int(cols[-1])),
            top=margin - (height - 1 - int(rows[-1])),
        )

    # ------------------------------------------------------------------ pictures
    def to_image(self) -> NDArray[np.uint8]:
        """Return the paper's grey picture (rows, cols), row 0 at the top.

        0 (black) obstacle, 254 (white) free, 205 (grey) unknown, as map_server writes.
        """
        image = np.full(self.shape, 205, np.uint8)
        image[self.free] = 254
        image[self.occupied] = 0
        return np.ascontiguousarray(image[::-1])


def _without_noise(metres: float) -> float:
    """Return -19.2 for -19.200000000000003: what only the arithmetic added is not worth writing down."""
    plain = round(metres, 9)
    return plain if abs(plain - metres) < 1e-12 else metres


MAX_RATIO = 100
"""Most by which the cell sizes of two maps may differ; beyond it a resolution is surely mistyped."""


def check_resolutions(a: OccupancyGrid, b: OccupancyGrid) -> None:
    """Refuse cell sizes that cannot both be right.

    Raises
    ------
    ResolutionError
        They differ by more than a factor of `MAX_RATIO`.
    """
    if not 1 / MAX_RATIO <= a.resolution / b.resolution <= MAX_RATIO:
        raise ResolutionError(
            f"cells of {a.resolution:g} m and of {b.resolution:g} m cannot be laid over one another: "
            f"they differ by more than a factor of {MAX_RATIO}; check the resolutions"
        )


# Rows of the target that `resample` works on at a time: bounds memory at about 100 MB.
_BLOCK_CELLS = 1 << 20


def resample(
    grid: OccupancyGrid,
    T_target_grid: Pose2,
    target: OccupancyGrid,
    *,
    keep: str = "walls",
    displacement: Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.complex128]] | None = None,
) -> Cells:
    """Sample `grid`, laid down by `T_target_grid`, on the lattice of `target`.

    Every target cell asks the grid what lies under it, so a rotation leaves no holes. Where the
    target's cells are coarser than the grid's, each asks at k x k places, k = ceil(ratio), and
    keeps the highest occupancy (``keep="walls"``: no thin wall is lost) or the mean of what
    is known (``keep="mean"``).

    Parameters
    ----------
    grid
        The map to sample.
    T_target_grid
        Takes a point of the grid's metric frame into the target's.
    target
        Supplies shape, resolution and origin; its cells are not read.
    displacement
        If given, bends the grid: takes positions (cols, rows) on the target's lattice, and what belongs
        there is taken from where the displacement, (col + 1j * row), would have brought it from.

    Returns
    -------
    int8 array of the target's shape: -1 where the grid is unknown or does not reach.

    Raises
    ------
    ResolutionError
        The cell sizes differ by more than a factor of `MAX_RATIO`.
    """
    if keep not in ("walls", "mean"):
        raise ValueError(f"keep must be 'walls' or 'mean', not {keep!r}")
    rows, cols = target.shape
    out = np.full((rows, cols), UNKNOWN, np.int8)
    if not (grid.cells.size and out.size):
        return out
    check_resolutions(grid, target)
    # One affine map from target lattice to grid lattice.
    T_grid_target = grid.origin.inverse() @ T_target_grid.inverse() @ target.origin
    scale = target.resolution / grid.resolution
    c, s = math.cos(T_grid_target.theta) * scale, math.sin(T_grid_target.theta) * scale
    tx, ty = T_grid_target.x / grid.resolution, T_grid_target.y / grid.resolution
    k = max(1, math.ceil(scale - 1e-6))
    offsets = [((i + 0.5) / k, (j + 0.5) / k) for j in range(k) for i in range(k)]
    height, width = grid.shape
    u = np.arange(cols, dtype=np.float64)
    for start in range(0, rows, max(1, _BLOCK_CELLS // cols)):
        stop = min(rows, start + max(1, _BLOCK_CELLS // cols))
        v = np.arange(start, stop, dtype=np.float64)[:, None]
        best = np.full((stop - start, cols), UNKNOWN, np.int8)
        total = np.zeros(best.shape, np.int32)
        count = np.zeros(best.shape, np.int32)
        for du, dv in offsets:
            x, y = u + du, v + dv
            if displacement is not None:
                shift = displacement(*np.broadcast_arrays(x, y))
                x, y = x - shift.real, y - shift.imag
            col = np.floor(c * x - s * y + tx).astype(np.int64)
            row = np.floor(s * x + c * y + ty).astype(np.int64)
            inside = (col >= 0) & (col < width) & (row >= 0) & (row < height)
            value = np.full(best.shape, UNKNOWN, np.int8)
            value[inside] = grid.cells[row[inside], col[inside]]
            np.maximum(best, value, out=best)
            if keep == "mean":
                known = value >= 0
                total[known] += value[known]
                count += known
        if keep == "mean":
            some = count > 0
            best[some] = np.rint(total[some] / count[some]).astype(np.int8)
        out[start:stop] = best
    return out


def at_resolution(grid: OccupancyGrid, resolution: float) -> OccupancyGrid:
    """Return the map on a lattice of another cell size [m] with the same lower left corner.

    Coarser cells keep the highest occupancy that lies in them, so that thin walls stay whole.
    """
    if resolution == grid.resolution:
        return grid
    scale = grid.resolution / resolution
    shape = tuple(max(1, math.ceil(n * scale - 1e-6)) for n in grid.shape) if grid.cells.size else (0, 0)
    target = replace(grid, cells=np.full(shape, UNKNOWN, np.int8), resolution=resolution)
    return replace(target, cells=resample(grid, Pose2(), target))


def overlap_share(a: OccupancyGrid, b: OccupancyGrid, T_a_b: Pose2) -> float:
    """Return the area known in both maps / the known area of the smaller one, 0..1.

    Measured on a regular sample of at most about 60,000 of b's cells.
    """
    smaller = min(a.known_area, b.known_area)
    if smaller == 0.0:
        return 0.0
    step = max(1, math.ceil(math.sqrt(b.cells.size / 60_000)))
    rows, cols = np.nonzero(b.cells[::step, ::step] >= 0)
    points = b.lattice_to_metres(np.stack([cols, rows], axis=-1) * step + 0.5)
    col, row = np.floor(a.metres_to_lattice(T_a_b.apply(points))).astype(np.int64).T
    inside = (col >= 0) & (col < a.shape[1]) & (row >= 0) & (row < a.shape[0])
    both = np.count_nonzero(a.cells[row[inside], col[inside]] >= 0)
    return float(min(1.0, both * (b.resolution * step) ** 2 / smaller))
