"""Tours: a robot is driven through chosen rooms, such that all mappings of a place share some of it."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmeld.grid import OccupancyGrid
from mapmeld.se2 import Pose2
from mapmeld.simulation.driving import Command, Sight
from mapmeld.simulation.environment import Environment
from mapmeld.simulation.errors import SimulationError
from mapmeld.simulation.fields import DOOR, arms_of, rooms_of, sides_of_door
from mapmeld.simulation.pilot import MARGIN, Pilot
from mapmeld.simulation.planning import Planner, Points, discs
from mapmeld.simulation.robot import MECABOT, Robot
from mapmeld.simulation.true_map import covered, true_map

COMMON, SHARE = 0.35, 0.65
"""Parts of the floor that all mappings, and that each single one, drive through at least."""

_VIEW = 2.2  # every place of a room is that near to a stop [m]
_STOP_CLEARANCE = 0.3  # [m]
_APART = 2.0  # starts of two mappings, where possible [m]
_PATIENCE = 4  # recoveries on the way to one stop


@dataclass(frozen=True, slots=True)
class Tour:
    """One drive.

    Attributes
    ----------
    start
        Where the robot is set down, in the environment's frame.
    stops
        Where it goes, in this order (x, y) [m].
    rooms
        Numbers of the rooms that it visits (see `fields.rooms_of`).
    """

    start: Pose2
    stops: tuple[tuple[float, float], ...]
    rooms: tuple[int, ...]


class FloorPlan:
    """What one who knows the environment plans on: its floor, rooms and the ways between them."""

    def __init__(self, environment: Environment, robot: Robot = MECABOT) -> None:
        self._floor: OccupancyGrid = true_map(environment)
        self._radius = robot.radius + MARGIN
        self._blocked = covered(environment, environment.footprints(), self._floor.resolution)
        self._blocked |= ~self._floor.known
        self.planner = Planner(self._floor, self._blocked, self._radius)
        self.rooms = rooms_of(environment.fields)
        self.areas = np.bincount(self.rooms.ravel(), minlength=1).astype(np.float64)
        self.neighbours = _neighbours(environment, self.rooms)

    def path(
        self,
        start: tuple[float, float],
        goal: tuple[float, float],
        others: tuple[tuple[float, float], ...] = (),
    ) -> Points | None:
        """Return a way that keeps clear of everything, and of other robots where they are now."""
        planner = self.planner
        if others:
            blocked = self._blocked | discs(self._floor, others, 2 * self._radius - MARGIN)
            planner = Planner(self._floor, blocked, self._radius)
        return planner.path(start, goal)

    def room_at(self, points: Points) -> NDArray[np.int32]:
        """Return the room of each point (n, 2) [m]; 0 for outside."""
        col, row = np.floor(points - 0.5).astype(int).T
        rows, cols = self.rooms.shape
        inside = (row >= 0) & (row < rows) & (col >= 0) & (col < cols)
        found = np.zeros(len(points), np.int32)
        found[inside] = self.rooms[row[inside], col[inside]]
        return found


def plan_tours(
    environment: Environment,
    count: int,
    seed: int = 0,
    *,
    common: float = COMMON,
    share: float = SHARE,
    robot: Robot = MECABOT,
    plan: FloorPlan | None = None,
) -> tuple[Tour, ...]:
    """Plan the mappings of one environment.

    All of them visit the same connected rooms, at least `common` of the floor; each visits further
    rooms, its own choice, up to at least `share` of it and that share of all rooms, or half of them. Starts
    differ in place and heading. The same seed gives the same tours; more of them begin with the same ones.

    Parameters
    ----------
    environment
        Where to drive.
    count
        How many tours.
    seed
        0 or more.
    common, share
        Parts of the floor, 0 to 1, common <= share.
    robot
        That is driven.
    plan
        The floor plan of `environment` for `robot`, if it is there already.

    Raises
    ------
    SimulationError
        No floor is wide enough for the robot, or shares are out of range.
    """
    if not 0 <= common <= share <= 1:
        raise SimulationError(f"0 <= common <= share <= 1 is needed, not {common:g} and {share:g}")
    plan = plan or FloorPlan(environment, robot)
    nodes = plan.planner.main_floor() if plan.planner.any_floor else np.empty((0, 2))
    rooms = plan.room_at(nodes)
    # A robot may get around outside; it is to map what is inside.
    nodes, rooms = nodes[rooms > 0], rooms[rooms > 0]
    if not len(nodes):
        raise SimulationError("no floor is wide enough for the robot")
    views = {int(room): _views(nodes[rooms == room]) for room in np.unique(rooms)}
    rng = np.random.default_rng((seed, 2))
    shared = _grown(plan, set(), set(views), common, 1, rng)
    tours: list[Tour] = []
    for index in range(count):
        rng = np.random.default_rng((seed, 3, index))
        # Few large rooms may be much of the floor already: half of all rooms, where as much is asked for.
        chosen = _grown(plan, shared, set(views), share, math.ceil(len(views) * min(share, 0.5)), rng)
        here = nodes[np.isin(rooms, sorted(chosen))]
        start = _start(here, [tour.start for tour in tours], rng)
        stops = np.concatenate([views[room] for room in sorted(chosen)])
        order = _order(plan.planner, (start.x, start.y), stops)
        tours.append(Tour(start, tuple((float(x), float(y)) for x, y in stops[order]), tuple(sorted(chosen))))
    return tuple(tours)


def _neighbours(environment: Environment, rooms: NDArray[np.int32]) -> dict[int, set[int]]:
    arms = arms_of(environment.fields)
    joined: dict[int, set[int]] = {}
    for row, col in zip(*np.nonzero(environment.fields == DOOR), strict=True):
        a, b = sides_of_door(rooms, row, col, int(arms[row, col]))
        joined.setdefault(a, set()).add(b)
        joined.setdefault(b, set()).add(a)
    return joined


def _grown(
    plan: FloorPlan, chosen: set[int], possible: set[int], share: float, count: int, rng: np.random.Generator
) -> set[int]:
    """Add random neighbouring rooms until share of the floor and count are reached; first the largest."""
    total = sum(plan.areas[room] for room in possible)
    found = chosen or {max(sorted(possible), key=lambda room: float(plan.areas[room]))}
    while len(found) < count or sum(plan.areas[room] for room in found) < share * total - 1e-9:
        beside = {n for room in found for n in plan.neighbours.get(room, ())} & possible - found
        # The rest may hang on by a wide gap instead of a door: then anything goes.
        options = sorted(beside or possible - found)
        if not options:
            break
        found = found | {options[rng.integers(len(options))]}
    return found


def _views(places: Points) -> Points:
    """Return few of the places such that every one is near to one of them (greedy cover)."""
    coarse = places[(np.rint(places * 10) % 4 == 0).all(axis=1)] if len(places) > 40 else places
    if not len(coarse):
        coarse = places
    near = np.hypot(*(coarse[:, None] - coarse[None]).transpose(2, 0, 1)) < _VIEW
    chosen: list[int] = []
    left = np.ones(len(coarse), np.bool_)
    while left.mean() > 0.03:
        gain = (near & left).sum(axis=1)
        chosen.append(int(gain.argmax()))
        left &= ~near[chosen[-1]]
    return coarse[chosen]


def _start(places: Points, others: list[Pose2], rng: np.random.Generator) -> Pose2:
    far = np.ones(len(places), np.bool_)
    for other in others:
        far &= np.hypot(places[:, 0] - other.x, places[:, 1] - other.y) > _APART
    if far.any():
        places = places[far]
    x, y = places[rng.integers(len(places))]
    return Pose2(float(x), float(y), float(rng.uniform(-math.pi, math.pi)))


def _order(planner: Planner, start: tuple[float, float], stops: Points) -> list[int]:
    """Return the stops in the order nearest first, untangled by exchanging ends (2-opt, Croes 1958)."""
    points = np.vstack([start, stops])
    cost = np.array([planner.costs(point, points) for point in points])
    order, left = [0], set(range(1, len(points)))
    while left:
        order.append(min(left, key=lambda stop: cost[order[-1], stop]))
        left.remove(order[-1])
    improved = True
    while improved:
        improved = False
        for i in range(1, len(order) - 1):
            for j in range(i + 1, len(order)):
                before, a, b = order[i - 1], order[i], order[j]
                gain = cost[before, a] - cost[before, b]
                if j + 1 < len(order):
                    gain += cost[b, order[j + 1]] - cost[a, order[j + 1]]
                if gain > 1e-9:
                    order[i : j + 1] = order[i : j + 1][::-1]
                    improved = True
    return [stop - 1 for stop in order[1:]]


class TourDriver:
    """Drives through all stops in order, then stops.

    A stop that it cannot reach (another robot may stand there) is tried once more at the end; what it
    cannot reach then either is in `left_out`.
    """

    def __init__(
        self, plan: FloorPlan, stops: tuple[tuple[float, float], ...], robot: Robot = MECABOT, seed: int = 0
    ) -> None:
        self._pilot = Pilot(plan.path, robot, np.random.default_rng((seed, 4)))
        self._first, self._again = deque(stops), deque[tuple[float, float]]()
        self._stop: tuple[float, float] | None = None
        self._is_second = False
        self.left_out: list[tuple[float, float]] = []

    def command(self, sight: Sight) -> Command | None:
        """Return what to do; None after the last stop."""
        while True:
            if self._stop is not None:
                if self._pilot.recoveries < _PATIENCE:
                    command = self._pilot.command(sight)
                    if command is not None:
                        return command
                if math.dist(self._stop, (sight.T_world_base.x, sight.T_world_base.y)) > 0.5:
                    (self.left_out if self._is_second else self._again).append(self._stop)
            self._is_second = not self._first
            waiting = self._first or self._again
            self._stop = waiting.popleft() if waiting else None
            if self._stop is None:
                return None
            self._pilot.go(self._stop)
