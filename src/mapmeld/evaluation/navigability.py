"""What a round robot can drive on a map, and what of that is true: the question that the paper left open.

Ways are planned as a robot would: the shortest on the map, its obstacles grown by the robot's radius, on
floor that is known to be free (Dijkstra on 8 neighbours, scikit-image's MCP_Geometric; on 4 where a robot
is as thin as a cell, which could slip between the cells of a diagonal wall). What truth allows is
asked on the same lattice, so neither half a cell between two maps nor the turn of one against the other shows
as a difference of lengths.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from statistics import median

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, map_coordinates

from mapmeld.errors import MapmeldError
from mapmeld.extras import required
from mapmeld.grid import Mask, OccupancyGrid
from mapmeld.se2 import Pose2

MAX_CELLS = 50_000_000

_GOALS_PER_START = 10  # one search from a start finds the ways to all its goals
_THIN = 1.5  # radius [cells] below which a diagonal step might cross a wall of cells that meet at corners
_TOUCH = 1e-6  # of a cell: who only touches an obstacle does not hit it


class NavigabilityError(MapmeldError):
    """A map on which, or a place at which, nothing can be planned."""


@dataclass(frozen=True, slots=True)
class Reach:
    """Where a robot gets on a map, by the map's own word.

    Attributes
    ----------
    free_area
        Floor [m^2].
    drivable_area
        Floor on which the robot's centre can be [m^2].
    reachable_area
        Of that, what hangs together with a start [m^2]; without starts, the largest part that hangs together.
    components
        Parts that the drivable floor falls into; specks smaller than the robot itself are left out.
    pairs
        Pairs of random poses that were tried.
    reachable
        Pairs with a way between them.
    """

    free_area: float
    drivable_area: float
    reachable_area: float
    components: int
    pairs: int
    reachable: int


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """A pair of poses, and how a robot gets from the one to the other.

    Attributes
    ----------
    start, goal
        (x, y) in the map's frame [m].
    path
        Planned on the map, (n, 2) [m] in the map's frame, ends included; None if the map has no way.
    length
        Of that path [m]; None if the map has no way.
    true_length
        Of the shortest way in truth [m]; None if there is none.
    drivable
        Whether the planned path can be driven in truth (False if there is none).
    """

    start: tuple[float, float]
    goal: tuple[float, float]
    path: NDArray[np.float64] | None
    length: float | None
    true_length: float | None
    drivable: bool

    @property
    def false_passage(self) -> bool:
        """Whether it was planned through what is an obstacle in truth."""
        return self.path is not None and not self.drivable

    @property
    def false_block(self) -> bool:
        """Whether there is a way in truth, but not on the map."""
        return self.path is None and self.true_length is not None


@dataclass(frozen=True, eq=False)
class Navigability:
    """How true it is what a map says of ways.

    Attributes
    ----------
    ways
        One for each pair of poses.
    """

    ways: tuple[Way, ...] = field(repr=False)

    @property
    def pairs(self) -> int:
        """Pairs of poses that were tried, all free on the map and in truth."""
        return len(self.ways)

    @property
    def reachable_map(self) -> int:
        """Pairs with a way on the map."""
        return sum(way.path is not None for way in self.ways)

    @property
    def reachable_truth(self) -> int:
        """Pairs with a way in truth."""
        return sum(way.true_length is not None for way in self.ways)

    @property
    def reachable_both(self) -> int:
        """Pairs with a way on the map and a way, this or another, in truth."""
        return sum(way.path is not None and way.true_length is not None for way in self.ways)

    @property
    def false_passages(self) -> int:
        """Ways planned on the map that cannot be driven in truth."""
        return sum(way.false_passage for way in self.ways)

    @property
    def false_blocks(self) -> int:
        """Pairs with a way in truth and none on the map."""
        return sum(way.false_block for way in self.ways)

    @cached_property
    def length_ratios(self) -> tuple[float, ...]:
        """Length of the planned way / of the shortest in truth, for all that can be driven as planned."""
        return tuple(
            way.length / way.true_length
            for way in self.ways
            if way.drivable and way.length and way.true_length
        )

    @property
    def length_ratio(self) -> float | None:
        """Median of `length_ratios`; None if there are none."""
        return median(self.length_ratios) if self.length_ratios else None


def reach(
    grid: OccupancyGrid,
    *,
    radius: float = 0.2,
    starts: Sequence[Pose2] | None = None,
    pairs: int = 200,
    seed: int = 0,
) -> Reach:
    """Find out where a robot gets on a map, with no truth to compare with.

    Parameters
    ----------
    grid
        The map.
    radius
        Of the robot [m]; its centre stays on free cells, at least so far from obstacles, centre to centre.
    starts
        Where robots stand, in the map's frame; poses are drawn from what they reach, together. Without, from
        all floor on which the robot can be.
    pairs
        How many pairs of random poses to try.
    seed
        Of the drawing.

    Raises
    ------
    NavigabilityError
        A radius that is no length, or a start without drivable floor within a metre of it.
    """
    floor = _Floor.of(_checked(grid, radius), radius)
    labels = floor.labels
    sizes = np.bincount(labels.ravel(), minlength=1)[1:]
    if starts is None:
        drawn_from = floor.drivable
        reached = int(sizes.max()) if sizes.size else 0
    else:
        drawn_from = np.isin(labels, _labels_at(floor, starts))
        reached = int(np.count_nonzero(drawn_from))
    chosen = _draw(drawn_from, pairs, seed)
    area = grid.resolution**2
    enough = max(1.0, math.pi * radius**2 / area)
    return Reach(
        free_area=float(np.count_nonzero(grid.free)) * area,
        drivable_area=float(sizes.sum()) * area,
        reachable_area=reached * area,
        components=int(np.count_nonzero(sizes >= enough)),
        pairs=sum(len(goals) for _, goals in chosen),
        reachable=sum(int(labels[start] == labels[goal]) for start, goals in chosen for goal in goals),
    )


def navigability(
    grid: OccupancyGrid,
    truth: OccupancyGrid,
    T_truth_grid: Pose2,
    *,
    radius: float = 0.2,
    tolerance: float = 0.2,
    starts: Sequence[Pose2] | None = None,
    pairs: int = 200,
    seed: int = 0,
) -> Navigability:
    """Plan ways on a map and see which of them are there in truth.

    Pairs of poses are drawn from floor where the robot can be on the map and in truth. A planned way can be
    driven if the true floor, the robot's radius kept, has a way from within `tolerance` of its start to
    within `tolerance` of its goal that never leaves the planned one by more than `tolerance`: a map that lies
    a little off makes no false passage, as a robot that sees the walls gives way by as much; a wall that the
    map lacks does.

    Parameters
    ----------
    grid
        The map, merged or not.
    truth
        The true environment.
    T_truth_grid
        Takes a point of the map's frame into the truth's.
    radius
        Of the robot [m]; see `reach`.
    tolerance
        See above [m].
    starts
        Where robots stood, in the map's frame. Poses are drawn from what they reach in truth, together;
        without, from all floor.
    pairs, seed
        See `reach`.

    Raises
    ------
    NavigabilityError
        A radius or tolerance that is no length, a start without true floor within a metre of it, or maps so
        far apart that no lattice holds both.
    """
    if not (math.isfinite(tolerance) and tolerance >= 0):
        raise NavigabilityError(f"a tolerance is a number of metres, not {tolerance:g}")
    common = _reaching(_checked(grid, radius), truth, T_truth_grid)
    floor = _Floor.of(common, radius)
    true_floor = _sampled(_Floor.of(truth, radius), common, T_truth_grid)
    floor = replace(floor, diagonals=true_floor.diagonals)  # lengths are of one kind
    drawn_from = floor.drivable & true_floor.drivable
    if starts is not None:
        drawn_from &= np.isin(true_floor.labels, _labels_at(true_floor, starts))
    ways: list[Way] = []
    for start, goals in _draw(drawn_from, pairs, seed):
        planned = _Plans(floor, start, goals)
        true = _Plans(true_floor, start, goals)
        for goal in goals:
            path = planned.path(goal)
            ways.append(
                Way(
                    start=_place(common, start),
                    goal=_place(common, goal),
                    path=None if path is None else common.lattice_to_metres(path[:, ::-1] + 0.5),
                    length=planned.length(goal),
                    true_length=true.length(goal),
                    drivable=path is not None and _can_follow(true_floor, path, tolerance),
                )
            )
    return Navigability(tuple(ways))


def drivable(grid: OccupancyGrid, radius: float) -> Mask:
    """Return the cells (rows, cols) on which the centre of a round robot can be; see `reach`."""
    return _Floor.of(_checked(grid, radius), radius).drivable


Cell = tuple[int, int]


@dataclass(frozen=True, eq=False)
class _Floor:
    """Where a robot's centre can be, on a lattice."""

    grid: OccupancyGrid
    radius: float
    clearance: NDArray[np.float64]  # from cell centre to the nearest obstacle's [m]; inf without obstacles
    drivable: Mask
    diagonals: bool  # whether steps go to all 8 neighbours

    @classmethod
    def of(cls, grid: OccupancyGrid, radius: float) -> _Floor:
        if not grid.occupied.any():
            clearance = np.full(grid.shape, np.inf)
        else:
            # Between centres: where in its cell a wall was met is not known, the middle is the fair guess.
            clearance = distance_transform_edt(~grid.occupied) * grid.resolution
        drivable = cls._wide(grid.free, clearance, grid, radius)
        return cls(grid, radius, clearance, drivable, radius >= _THIN * grid.resolution)

    @staticmethod
    def _wide(free: Mask, clearance: NDArray[np.float64], grid: OccupancyGrid, radius: float) -> Mask:
        wide: Mask = free & (clearance >= radius - _TOUCH * grid.resolution)
        return wide

    @cached_property
    def labels(self) -> NDArray[np.int32]:
        """The number of each cell's part of the floor, from 1; 0 where it cannot be driven."""
        return self.parts(self.drivable)

    def parts(self, mask: Mask) -> NDArray[np.int32]:
        """Return the number of the part of a mask to which each cell belongs, from 1; 0 beyond the mask."""
        _, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8 if self.diagonals else 4)
        return np.asarray(labels, np.int32)


def _checked(grid: OccupancyGrid, radius: float) -> OccupancyGrid:
    if not (math.isfinite(radius) and 0 <= radius <= 100):
        raise NavigabilityError(f"the radius of a robot is 0 to 100 metres, not {radius:g}")
    return grid


def _reaching(grid: OccupancyGrid, truth: OccupancyGrid, T_truth_grid: Pose2) -> OccupancyGrid:
    """Return the map on a lattice that reaches as far as what is known in truth."""
    known = truth.cropped()
    rows, cols = known.shape
    corners = known.lattice_to_metres([(0, 0), (cols, 0), (0, rows), (cols, rows)])
    there = grid.metres_to_lattice(T_truth_grid.inverse().apply(corners))
    rows, cols = grid.shape
    left, bottom = np.maximum(0, np.ceil(-there.min(axis=0)))
    right, top = np.maximum(0, np.ceil(there.max(axis=0) - (cols, rows)))
    if not (left + cols + right) * (bottom + rows + top) <= MAX_CELLS:
        raise NavigabilityError(
            f"a lattice with the map and the truth on it would have more than {MAX_CELLS:,} cells; "
            "check how they lie"
        )
    return grid.extended(int(left), int(bottom), int(right), int(top))


def _sampled(floor: _Floor, lattice: OccupancyGrid, T_floor_lattice: Pose2) -> _Floor:
    """Return a floor on another lattice: its clearance there, between its cells in proportion."""
    rows, cols = lattice.shape
    drivable = np.zeros(lattice.shape, np.bool_)
    clearance = np.zeros(lattice.shape)
    x = np.arange(cols) + 0.5
    for row in range(rows):  # one at a time: coordinates of all would be many times the map
        metres = lattice.lattice_to_metres(np.stack([x, np.full(cols, row + 0.5)], axis=-1))
        at = floor.grid.metres_to_lattice(T_floor_lattice.apply(metres))
        cell = np.floor(at).astype(np.int64)
        inside = ((cell >= 0) & (cell < floor.grid.shape[::-1])).all(axis=1)
        if not inside.any():
            continue
        free = floor.grid.free[cell[inside, 1], cell[inside, 0]]
        room = np.full(int(inside.sum()), np.inf)
        if np.isfinite(floor.clearance[0, 0]):
            room = map_coordinates(floor.clearance, (at[inside] - 0.5).T[::-1], order=1, mode="nearest")
        clearance[row, inside] = room
        drivable[row, inside] = floor._wide(free, room, floor.grid, floor.radius)
    diagonals = floor.diagonals and floor.radius >= _THIN * lattice.resolution
    return _Floor(lattice, floor.radius, clearance, drivable, diagonals)


def _labels_at(floor: _Floor, starts: Sequence[Pose2]) -> list[int]:
    """Return the parts of the floor on which robots stand."""
    if not starts:
        raise NavigabilityError("where the robots stand is an empty list; leave it out to use all floor")
    cells = np.argwhere(floor.drivable)
    found = []
    for start in starts:
        col, row = floor.grid.metres_to_lattice((start.x, start.y)) - 0.5
        distances = np.hypot(*(cells - (row, col)).T) * floor.grid.resolution
        # A metre: maps are off by so much at most, and a start may lie in the shadow of an obstacle.
        if not len(cells) or not distances.min() <= 1.0:
            raise NavigabilityError(
                f"no floor for a robot of radius {floor.radius:g} m within a metre of the start "
                f"({start.x:.2f}, {start.y:.2f})"
            )
        found.append(int(floor.labels[tuple(cells[distances.argmin()])]))
    return found


def _draw(mask: Mask, pairs: int, seed: int) -> list[tuple[Cell, list[Cell]]]:
    """Return starts and their goals, cells drawn evenly from a mask; none if it has fewer than two cells."""
    if pairs < 1:
        raise NavigabilityError(f"the number of pairs is at least 1, not {pairs}")
    cells = np.argwhere(mask)
    if len(cells) < 2:
        return []
    random = np.random.default_rng(seed)
    drawn: list[tuple[Cell, list[Cell]]] = []
    for first in range(0, pairs, _GOALS_PER_START):
        count = min(_GOALS_PER_START, pairs - first)
        start = int(random.integers(len(cells)))
        # Any but the start: one further by 1 to n - 1.
        others = (start + random.integers(1, len(cells), count)) % len(cells)
        drawn.append((_cell(cells[start]), [_cell(cells[other]) for other in others]))
    return drawn


def _cell(indices: NDArray[np.int64]) -> Cell:
    return int(indices[0]), int(indices[1])


def _place(grid: OccupancyGrid, cell: Cell) -> tuple[float, float]:
    x, y = grid.lattice_to_metres((cell[1] + 0.5, cell[0] + 0.5))
    return float(x), float(y)


class _Plans:
    """The shortest ways from a cell to others of a floor."""

    def __init__(self, floor: _Floor, start: Cell, goals: Sequence[Cell]) -> None:
        self._resolution = floor.grid.resolution
        labels = floor.labels
        self._reached = {goal for goal in goals if labels[goal] and labels[goal] == labels[start]}
        if not self._reached:
            return
        # Only the part in which the start lies; -1 is no way for MCP.
        costs = np.where(labels == labels[start], 1.0, -1.0)
        searches = required("skimage.graph", "navigation")
        self._search = searches.MCP_Geometric(costs, fully_connected=floor.diagonals)
        self._costs, _ = self._search.find_costs([start], sorted(self._reached))

    def length(self, goal: Cell) -> float | None:
        """Return the length of the way [m]; None if there is none."""
        return float(self._costs[goal]) * self._resolution if goal in self._reached else None

    def path(self, goal: Cell) -> NDArray[np.int64] | None:
        """Return the way's cells (n, 2) as (row, col), ends included; None if there is none."""
        if goal not in self._reached:
            return None
        return np.array(self._search.traceback(goal), np.int64).reshape(-1, 2)


def _can_follow(floor: _Floor, path: NDArray[np.int64], tolerance: float) -> bool:
    """Whether a floor has a way along a path (n, 2) of cells, nowhere further off than the tolerance [m]."""
    margin = math.ceil(tolerance / floor.grid.resolution) + 1
    low = np.maximum(path.min(axis=0) - margin, 0)
    high = path.max(axis=0) + margin + 1
    floor_here = floor.drivable[low[0] : high[0], low[1] : high[1]]
    at = path - low
    within = tolerance / floor.grid.resolution + _TOUCH

    def near(cells: NDArray[np.int64]) -> Mask:
        off = np.ones(floor_here.shape, np.uint8)
        off[cells[:, 0], cells[:, 1]] = 0
        found: Mask = cv2.distanceTransform(off, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) <= within
        return found

    parts = floor.parts(floor_here & near(at))
    begun, ended = parts[near(at[:1])], parts[near(at[-1:])]
    return bool(np.intersect1d(begun[begun > 0], ended[ended > 0]).size)
