"""Ways for a robot across a floor: shortest with room to spare (Dijkstra 1959, on a lattice)."""

from __future__ import annotations

import math
from collections.abc import Iterable

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from mapmeld.grid import Mask, OccupancyGrid

Points = NDArray[np.float64]
"""(n, 2) [m], in the frame of the map that was planned on."""

_COMFORT = 0.5  # clearance [m] below which a step begins to cost more
_NEIGHBOURS = ((0, 1), (1, 0), (1, 1), (1, -1))


class Planner:
    """Shortest ways on a floor for a round robot.

    Steps cost their length, and more near obstacles, so that ways run through the middle of doors.

    Parameters
    ----------
    floor
        Gives the lattice.
    blocked
        (rows, cols) where the robot must not touch anything.
    radius
        Of the robot, with what it shall keep away [m].
    passable
        (rows, cols) where its centre may be; everywhere if not given.
    spacing
        About how far apart nodes are [m].
    """

    def __init__(
        self,
        floor: OccupancyGrid,
        blocked: Mask,
        radius: float,
        passable: Mask | None = None,
        spacing: float = 0.1,
    ) -> None:
        self._floor = floor
        self._stride = stride = max(1, round(spacing / floor.resolution))
        room = cv2.distanceTransform((~blocked).astype(np.uint8), cv2.DIST_L2, 5) * floor.resolution
        # Every stride-th cell is a node, the middle one of its block.
        nodes = np.s_[stride // 2 :: stride, stride // 2 :: stride]
        self.clearance: NDArray[np.float64] = room[nodes].astype(np.float64)
        ok = self.clearance > radius
        if passable is not None:
            ok &= passable[nodes]
        self._ok: Mask = ok
        self._graph = self._joined(ok)
        self._cells = np.argwhere(ok)

    def _joined(self, ok: Mask) -> csr_matrix:
        cost = 1.0 + np.maximum(0.0, _COMFORT / np.maximum(self.clearance, 0.05) - 1.0)
        node = np.arange(ok.size).reshape(ok.shape)
        rows, cols = ok.shape
        length = self._stride * self._floor.resolution
        parts: list[tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]] = []
        for dr, dc in _NEIGHBOURS:
            here = np.s_[: rows - dr, max(0, -dc) : cols - max(0, dc)]
            there = np.s_[dr:, max(0, dc) : cols + min(0, dc)]
            both = ok[here] & ok[there]
            weight = (cost[here] + cost[there])[both] * (length * math.hypot(dr, dc) / 2)
            parts.append((weight, node[here][both], node[there][both]))
        weights, tails, heads = (np.concatenate(part) for part in zip(*parts, strict=True))
        return csr_matrix(coo_matrix((weights, (tails, heads)), shape=(ok.size, ok.size)))

    # ------------------------------------------------------------------ nodes and metres
    @property
    def any_floor(self) -> bool:
        """Whether there is a place for the robot at all."""
        return bool(len(self._cells))

    def nodes(self) -> Points:
        """Return all places where the robot may be."""
        return self._metres(self._cells)

    def main_floor(self) -> Points:
        """Return the places of the largest part of the floor that hangs together; there must be floor."""
        _, parts = connected_components(self._graph, directed=False)
        mine = parts[self._cells[:, 0] * self._ok.shape[1] + self._cells[:, 1]]
        return self._metres(self._cells[mine == np.bincount(mine).argmax()])

    def _metres(self, cells: NDArray[np.int64]) -> Points:
        lattice = cells[:, ::-1] * self._stride + self._stride // 2 + 0.5
        return self._floor.lattice_to_metres(lattice)

    def nearest(self, points: ArrayLike) -> NDArray[np.int64]:
        """Return the number of the node nearest to each of (n, 2) points [m]; there must be floor."""
        lattice = self._floor.metres_to_lattice(np.asarray(points, np.float64).reshape(-1, 2))
        wanted = (lattice[:, ::-1] - 0.5 - self._stride // 2) / self._stride
        cells = np.rint(wanted).astype(np.int64)
        inside = ((cells >= 0) & (cells < self._ok.shape)).all(axis=1)
        cells = np.clip(cells, 0, np.array(self._ok.shape) - 1)
        for index in np.flatnonzero(~inside | ~self._ok[tuple(cells.T)]):
            cells[index] = self._cells[((self._cells - wanted[index]) ** 2).sum(axis=1).argmin()]
        numbers: NDArray[np.int64] = cells[:, 0] * self._ok.shape[1] + cells[:, 1]
        return numbers

    # ------------------------------------------------------------------ ways
    def costs(self, start: ArrayLike, points: ArrayLike) -> NDArray[np.float64]:
        """Return what the way from `start` (2,) to each of (n, 2) points costs; inf where there is none."""
        costs = dijkstra(self._graph, directed=False, indices=self.nearest(start)[:1])
        found: NDArray[np.float64] = costs[0, self.nearest(points)]
        return found

    def path(self, start: ArrayLike, goal: ArrayLike) -> Points | None:
        """Return the way between two points [m], ends included; None if there is none."""
        if not self.any_floor:
            return None
        first, last = int(self.nearest(start)[0]), int(self.nearest(goal)[0])
        # From the goal, so that the predecessors are already in the order of driving.
        goals = np.array([last])
        costs, following = dijkstra(self._graph, directed=False, indices=goals, return_predecessors=True)
        if not math.isfinite(costs[0, first]):
            return None
        path = [first]
        while path[-1] != last:
            path.append(int(following[0, path[-1]]))
        cells = np.stack(np.divmod(np.array(path), self._ok.shape[1]), axis=-1)
        return self._metres(cells)


def discs(floor: OccupancyGrid, centres: Iterable[tuple[float, float]], radius: float) -> Mask:
    """Return the cells (rows, cols) within `radius` [m] of points of the map's frame."""
    mask = np.zeros(floor.shape, np.uint8)
    for centre in centres:
        col, row = np.floor(floor.metres_to_lattice(centre)).astype(int)
        cv2.circle(mask, (int(col), int(row)), round(radius / floor.resolution), 1, cv2.FILLED)
    return mask > 0
