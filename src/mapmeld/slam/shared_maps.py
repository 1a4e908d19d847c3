"""The maps of all particles, which share the patches in which they do not differ.

After resampling, the maps of two particles with the same past are the same, and they start to differ
only where new scans are entered. A map is therefore a table of square patches; patches are counted
by how many maps use them and copied when one of those maps is about to change them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mapmeld.errors import MapmeldError
from mapmeld.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mapmeld.se2 import Pose2
from mapmeld.slam.kernels import PATCH, Bits, Cells, Floats, Ids, register

MAX_SIDE = 1 << 11
"""Most patches along one side of a map; what is larger comes from an error, and would not fit into memory."""


class MapTooLargeError(MapmeldError):
    """The robot went, or was said to go, farther than any map reaches."""


class SharedMaps:
    """One map per particle.

    Patch 0 stands for all that nobody has seen; it is never written.

    Attributes
    ----------
    cells
        float32 (patches, PATCH * PATCH, 4), row by row from the bottom. Of every cell: where in it beams
        ended on average (x, y; 0..1 from its lower left corner), how many did, and how many
        ended in it or passed through it.
    walls
        int64 (patches, PATCH): bit q of row r says whether cell (r, q) is wall to the scan matching.
    tables
        int32 (maps, rows, cols): the patches of every map.
    corner
        Lower left corner of the tables on the lattice of all cells, whose (0, 0) is at the origin of
        the maps' frame: (col, row) [cells], multiples of PATCH.
    """

    def __init__(self, count: int, delta: float, low: tuple[float, float], high: tuple[float, float]) -> None:
        """Make `count` empty maps with cells of `delta` [m] that reach at least from `low` to `high` [m]."""
        self.delta = delta
        self.cells: Cells = np.zeros((1, PATCH * PATCH, 4), np.float32)
        self.walls: Bits = np.zeros((1, PATCH), np.int64)
        self._references: Ids = np.zeros(1, np.int32)
        self._spare: Ids = np.zeros(0, np.int32)
        self._spares = 0
        self.tables: Ids = np.zeros((count, 0, 0), np.int32)
        self.corner = (0, 0)
        self.reach(low, high)

    # ------------------------------------------------------------------ metres <-> lattice of the tables
    def lattice(self, poses: Floats) -> Floats:
        """Take poses (n, 3) [m, m, rad] to lattice coordinates of the tables [cells, cells, rad]."""
        scale = np.array([self.delta, self.delta, 1.0])
        return np.asarray(poses / scale - np.array([*self.corner, 0.0]), np.float64)

    def metres(self, poses: Floats) -> Floats:
        """Take poses (n, 3) from lattice coordinates of the tables to [m, m, rad]."""
        scale = np.array([self.delta, self.delta, 1.0])
        return np.asarray((poses + np.array([*self.corner, 0.0])) * scale, np.float64)

    # ------------------------------------------------------------------ room
    def reach(self, low: tuple[float, float], high: tuple[float, float]) -> None:
        """Let the tables reach at least from `low` to `high` [m].

        Raises
        ------
        MapTooLargeError
            They would have more than `MAX_SIDE` patches to a side.
        """
        patch = PATCH * self.delta
        # A patch more on every side: the scan matching looks a few cells around the ends of beams.
        wanted = [math.floor(v / patch) - 1 for v in low] + [math.ceil(v / patch) + 1 for v in high]
        left, bottom = (v // PATCH for v in self.corner)
        _, rows, cols = self.tables.shape
        if not (rows and cols):
            left, bottom = wanted[0], wanted[1]
        new = (
            min(left, wanted[0]),
            min(bottom, wanted[1]),
            max(left + cols, wanted[2]),
            max(bottom + rows, wanted[3]),
        )
        if max(new[2] - new[0], new[3] - new[1]) > MAX_SIDE:
            if not self.tables.any() and max(wanted[2] - wanted[0], wanted[3] - wanted[1]) <= MAX_SIDE:
                raise MapTooLargeError(
                    f"odometry begins far from where the map is, between ({low[0]:.6g}, {low[1]:.6g}) and "
                    f"({high[0]:.6g}, {high[1]:.6g}) m; set xmin, ymin, xmax and ymax to lie around it"
                )
            raise MapTooLargeError(
                f"the map would have to reach from ({low[0]:.6g}, {low[1]:.6g}) to "
                f"({high[0]:.6g}, {high[1]:.6g}) m, more than {MAX_SIDE * PATCH} cells: the odometry jumps, "
                "a range is wrong, or delta is too small"
            )
        pad = ((0, 0), (bottom - new[1], new[3] - bottom - rows), (left - new[0], new[2] - left - cols))
        if any(max(p) for p in pad):
            self.tables = np.pad(self.tables, pad)
            self.corner = (new[0] * PATCH, new[1] * PATCH)

    def _make_spares(self, wanted: int) -> None:
        """Have at least `wanted` patches that nobody uses."""
        if self._spares >= wanted:
            return
        there = len(self.cells)
        more = max(there, wanted)
        # Not np.pad, which writes its zeros: what is not used yet shall not take memory yet.
        cells = np.zeros((there + more, PATCH * PATCH, 4), np.float32)
        cells[:there] = self.cells
        self.cells = cells
        self.walls = np.pad(self.walls, ((0, more), (0, 0)))
        self._references = np.pad(self._references, (0, more))
        new = np.arange(there + more - 1, there - 1, -1, dtype=np.int32)
        self._spare = np.concatenate([new, self._spare[: self._spares], np.zeros(there, np.int32)])
        self._spares += more

    # ------------------------------------------------------------------ changes
    def enter(self, number: int, pose: Floats, start: Floats, ends: Floats, hits: NDArray[np.bool_]) -> None:
        """Enter a scan into one map.

        Parameters
        ----------
        number
            Which map.
        pose
            (3,) of the robot [m, m, rad]; all that the scan shows must be within reach.
        start, ends
            (2,) the laser, (n, 2) ends of the beams, in the robot's frame [cells].
        hits
            (n,) whether there was something where the beam ends.
        """
        if not len(ends):
            return
        span = 2 * float(np.abs(ends).max() + np.abs(start).max()) / PATCH + 2
        self._make_spares(min(math.ceil(span) ** 2, self.tables[number].size))
        x, y, theta = self.lattice(pose[None])[0]
        self._spares = register(
            self.cells,
            self.walls,
            self._references,
            self._spare,
            self._spares,
            self.tables[number],
            x,
            y,
            theta,
            start[0],
            start[1],
            ends,
            hits,
        )

    def keep(self, numbers: NDArray[np.intp]) -> None:
        """Let map i become what map ``numbers[i]`` was; no cell is copied."""
        self.tables = self.tables[numbers]
        self._references = np.bincount(self.tables.ravel(), minlength=len(self.cells)).astype(np.int32)
        unused = np.flatnonzero(self._references[1:] == 0)[::-1].astype(np.int32) + 1
        self._spares = len(unused)
        self._spare[: self._spares] = unused

    # ------------------------------------------------------------------ answers
    @property
    def patches(self) -> int:
        """How many patches all maps together use."""
        return int(np.count_nonzero(np.unique(self.tables)))

    def counts(self, number: int) -> tuple[NDArray[np.int64], NDArray[np.int64], tuple[int, int]]:
        """Return hits and visits (rows, cols) of a map where it has patches, and their corner (col, row)."""
        table = self.tables[number]
        rows, cols = np.flatnonzero(table.any(axis=1)), np.flatnonzero(table.any(axis=0))
        if not rows.size:
            none = np.zeros((0, 0), np.int64)
            return none, none, self.corner
        part = table[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1]
        shape = (part.shape[0] * PATCH, part.shape[1] * PATCH)
        hits, visits = (
            self.cells[part, :, layer].reshape(*part.shape, PATCH, PATCH).swapaxes(1, 2).reshape(shape)
            for layer in (2, 3)
        )
        corner = (self.corner[0] + int(cols[0]) * PATCH, self.corner[1] + int(rows[0]) * PATCH)
        return hits.astype(np.int64), visits.astype(np.int64), corner

    def grid(self, number: int, occ_thresh: float, stamp: float | None = None) -> OccupancyGrid:
        """Return a map, cut to what is known: occupied where more than `occ_thresh` of the visits are hits.

        Raises
        ------
        ValueError
            Nothing was entered yet.
        """
        hits, visits, (col, row) = self.counts(number)
        if not visits.any():
            raise ValueError("nothing was entered into the map yet")
        cells = np.full(hits.shape, UNKNOWN, np.int8)
        cells[visits > 0] = FREE
        cells[hits > occ_thresh * visits] = OCCUPIED
        return OccupancyGrid(cells, self.delta, Pose2(col * self.delta, row * self.delta), stamp).cropped()
