"""Exploration of the frontiers between known and unknown floor (Yamauchi 1997): near and large ones first."""

from __future__ import annotations

import math
from typing import Protocol

import cv2
import numpy as np

from mapmeld.grid import Mask, OccupancyGrid
from mapmeld.recording import Scan
from mapmeld.se2 import Pose2
from mapmeld.simulation.driving import STOP, Command, Sight
from mapmeld.simulation.pilot import MARGIN, Pilot
from mapmeld.simulation.planning import Planner, Points, discs
from mapmeld.simulation.robot import MECABOT, Robot

_PERIOD = 1.5  # between two looks at the map [s]
_SMALLEST = 0.4  # length of a frontier that is worth a visit [m]
_GAIN = 0.3  # what a metre of frontier is worth in metres of way
_WAIT = 1.0  # for the first scans to make a map [s]
_VAIN = 3.0  # a frontier that stays though the robot was that near [s] there is left alone
_REACH = 0.5  # [m]


class Mapper(Protocol):
    """What a frontier driver explores with: SLAM, or `KnownPoseMapper`."""

    def add(self, scan: Scan, T_world_base: Pose2) -> None:
        """Take in a scan; SLAM uses the odometry in it and leaves the true pose alone."""

    def grid(self) -> OccupancyGrid:
        """Return the map so far."""

    def pose(self) -> Pose2:
        """Return where the robot is in the map's frame."""


class FrontierDriver:
    """Drives to frontiers, the nearest first, until there is none left that it can reach.

    A large frontier counts as nearer than it is.

    Parameters
    ----------
    mapper
        Makes the map; it is fed every scan.
    robot
        That is driven.
    seed
        Of the recoveries.
    """

    def __init__(self, mapper: Mapper, robot: Robot = MECABOT, seed: int = 0) -> None:
        self._mapper, self._robot = mapper, robot
        self._pilot = Pilot(self._path, robot, np.random.default_rng((seed, 5)))
        self._radius = robot.radius + MARGIN
        self._grid: OccupancyGrid | None = None
        self._blocked: Mask | None = None
        self._planner: Planner | None = None
        self._looked = -math.inf
        self._given_up: list[tuple[float, float]] = []
        self._target: tuple[float, float] | None = None
        self._near_since: float | None = None
        self._begun: float | None = None
        self._T_map_world = Pose2()

    def command(self, sight: Sight) -> Command | None:
        """Return what to do; None when nothing is left to explore."""
        if self._begun is None:
            self._begun = sight.stamp
        if sight.scan is not None:
            self._mapper.add(sight.scan, sight.T_world_base)
        if sight.stamp - self._begun < _WAIT:
            return STOP
        at = self._mapper.pose()
        # Others are seen relative to the robot; on its map they are so relative to where it believes to be.
        self._T_map_world = at @ sight.T_world_base.inverse()
        self._mind_vain(sight.stamp, at)
        if sight.stamp - self._looked >= _PERIOD or self._target is None:
            self._look(sight, at)
        for _ in range(20):
            if self._target is None:
                return None
            command = self._pilot.command(sight, at)
            if command is not None and self._pilot.recoveries < 4:
                return command
            # Reached, or out of reach: the map tells which, but this very place is done with.
            self._given_up.append(self._target)
            self._look(sight, at)
        return None

    def _mind_vain(self, stamp: float, at: Pose2) -> None:
        """Give up a frontier that does not go away from close by."""
        if self._target is None or math.dist(self._target, (at.x, at.y)) > _REACH:
            self._near_since = None
        elif self._near_since is None:
            self._near_since = stamp
        elif stamp - self._near_since > _VAIN:
            self._given_up.append(self._target)
            self._target = self._near_since = None

    def _look(self, sight: Sight, at: Pose2) -> None:
        """Choose where to go on the map as it is now."""
        self._looked = sight.stamp
        self._grid = grid = self._mapper.grid()
        self._blocked = grid.occupied
        self._planner = Planner(grid, self._blocked, self._radius, passable=grid.free)
        before, self._target = self._target, None
        if not self._planner.any_floor:
            return
        places, sizes = frontiers(grid)
        keep = np.array(
            [all(math.dist(p, gone) > _REACH for gone in self._given_up) for p in places], np.bool_
        )
        places, sizes = places[keep], sizes[keep]
        if not len(places):
            return
        costs = self._planner.costs((at.x, at.y), places)
        # A frontier with no room for the robot anywhere near is not reached by going to the next node.
        nodes = self._planner.nodes()
        gaps = np.array([np.hypot(*(nodes - p).T).min() for p in places])
        costs[gaps > _REACH + self._radius] = np.inf
        score = costs - _GAIN * sizes
        if before is not None:
            score[np.hypot(*(places - before).T) < _REACH] -= 1.0  # no dithering between two of equal worth
        best = int(score.argmin())
        if math.isfinite(score[best]):
            target = (float(places[best, 0]), float(places[best, 1]))
            if before is None or math.dist(target, before) > 0.2 or self._pilot.recoveries:
                self._pilot.go(target)
            self._target = target

    def _path(
        self,
        start: tuple[float, float],
        goal: tuple[float, float],
        others: tuple[tuple[float, float], ...],
    ) -> Points | None:
        grid, blocked, planner = self._grid, self._blocked, self._planner
        assert grid is not None
        assert blocked is not None
        assert planner is not None
        if others:
            # Known in the world's frame only: of use where the map has that frame too.
            blocked = blocked | discs(grid, self._on_map(others), 2 * self._radius - MARGIN)
            planner = Planner(grid, blocked, self._radius, passable=grid.free)
        return planner.path(start, goal)

    def _on_map(self, others: tuple[tuple[float, float], ...]) -> list[tuple[float, float]]:
        return [(float(x), float(y)) for x, y in self._T_map_world.apply(others)]


def frontiers(grid: OccupancyGrid) -> tuple[Points, np.ndarray]:
    """Return the frontiers of a map: a middle cell of each (n, 2) [m], and their lengths (n,) [m].

    A frontier is a string of floor cells that touch unknown ones; short ones are left out.
    """
    unknown = (~grid.known).astype(np.uint8)
    beside = cv2.dilate(unknown, np.ones((3, 3), np.uint8), borderType=cv2.BORDER_CONSTANT, borderValue=0)
    # Walls are not mapped without gaps: what is unknown right behind them is no frontier.
    near_wall = cv2.dilate(grid.occupied.astype(np.uint8), np.ones((3, 3), np.uint8))
    edge = (grid.free & (beside > 0) & (near_wall == 0)).astype(np.uint8)
    count, labels, stats, centres = cv2.connectedComponentsWithStats(edge, connectivity=8)
    places, sizes = [], []
    for number in range(1, count):
        size = stats[number, cv2.CC_STAT_AREA] * grid.resolution
        if size < _SMALLEST:
            continue
        cells = np.argwhere(labels == number)[:, ::-1]
        middle = cells[((cells - centres[number]) ** 2).sum(axis=1).argmin()]
        places.append(middle + 0.5)
        sizes.append(size)
    return grid.lattice_to_metres(np.array(places).reshape(-1, 2)), np.array(sizes)
