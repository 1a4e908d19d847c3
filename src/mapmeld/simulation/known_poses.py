"""A map from scans whose true poses are known: what a frontier driver explores with when no SLAM runs."""

from __future__ import annotations

import math

import numpy as np

from mapmeld.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mapmeld.recording import Laser, Scan
from mapmeld.se2 import Pose2

_HIT, _MISS = 0.9, -0.35  # log-odds of a cell that a beam ends in, passes through
_LIMIT = 4.0
_MOVED, _TURNED = 0.1, math.radians(6)  # scans from nearly the same place say nothing new


class KnownPoseMapper:
    """Occupancy grid mapping with known poses (Moravec and Elfes 1985, in log-odds).

    Parameters
    ----------
    size
        Width and height of the ground [m]; the map's frame is the environment's.
    laser
        That takes the scans.
    resolution
        Side of a cell [m].
    """

    def __init__(self, size: tuple[float, float], laser: Laser, resolution: float = 0.05) -> None:
        self._laser, self._resolution = laser, resolution
        margin = math.ceil(laser.max_range / resolution) + 2  # beams may leave by an open door
        cols, rows = (math.ceil(side / resolution) + 2 * margin for side in size)
        self._origin = Pose2(-margin * resolution, -margin * resolution)
        self._log_odds = np.zeros((rows, cols), np.float32)
        self._along = np.arange(0.0, laser.max_range / resolution, 0.7)
        self._pose = Pose2()
        self._last: Pose2 | None = None

    def add(self, scan: Scan, T_world_base: Pose2) -> None:
        """Take in a scan made at a pose in the environment's frame."""
        self._pose = T_world_base
        if self._last is not None:
            metres, radians = self._last.distance_to(T_world_base)
            if metres < _MOVED and radians < _TURNED:
                return
        self._last = T_world_base
        at = self._origin.inverse() @ T_world_base @ self._laser.T_base_laser
        angles = at.theta + self._laser.bearings()
        # An invalid range (0 or NaN) says nothing; a beam that met nothing sees free floor all the way.
        ranges = np.nan_to_num(scan.ranges.astype(np.float64), nan=0.0, posinf=np.inf) / self._resolution
        position = np.array((at.x, at.y)) / self._resolution
        direction = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        cells = (position + direction[:, None] * self._along[:, None]).astype(np.intp)
        cols, rows = cells[self._along < ranges[:, None] - 0.7].T
        hits = np.isfinite(ranges) & (ranges > 0)
        hit_cols, hit_rows = (position + direction[hits] * ranges[hits, None]).astype(np.intp).T
        # Assigned, not added: a cell counts once however many beams pass it, and a hit outweighs a miss.
        change = np.zeros_like(self._log_odds)
        change[rows, cols] = _MISS
        change[hit_rows, hit_cols] = _HIT
        self._log_odds += change
        np.clip(self._log_odds, -_LIMIT, _LIMIT, out=self._log_odds)

    def grid(self) -> OccupancyGrid:
        """Return the map so far, in the environment's frame."""
        cells = np.full(self._log_odds.shape, UNKNOWN, np.int8)
        cells[self._log_odds < 0] = FREE
        cells[self._log_odds > 0] = OCCUPIED
        return OccupancyGrid(cells, self._resolution, self._origin)

    def pose(self) -> Pose2:
        """Return where the robot is in the map's frame."""
        return self._pose
