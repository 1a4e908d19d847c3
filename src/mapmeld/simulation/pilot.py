"""Driving to a place: along a planned way, around what was not expected, and free again when stuck."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from mapmeld.se2 import Pose2, wrap_angle
from mapmeld.simulation.driving import STOP, Command, Sight
from mapmeld.simulation.planning import Points
from mapmeld.simulation.robot import Robot

MARGIN = 0.06
"""What ways keep clear of obstacles beyond the robot's radius [m]."""

_LOOK_AHEAD = 0.35  # [m]
_TURN_FIRST, _TURNED = 0.8, 0.25  # heading errors [rad] from which it turns on the spot, and up to which
_BRAKING = 1.0  # [m/s^2] that it slows down with towards the end
_ARRIVED = 0.15  # [m]
_STUCK_AFTER = 1.5  # [s] without moving 5 cm or turning 0.1 rad
_GIVE_WAY = 0.9  # distance of another robot ahead that it stops at [m]

Plan = Callable[[tuple[float, float], tuple[float, float], tuple[tuple[float, float], ...]], Points | None]
"""Takes start, goal and other robots' places [m]; gives a way or None."""


class Pilot:
    """Takes one robot from place to place: pure pursuit (Coulter 1992), turning on the spot first.

    Parameters
    ----------
    plan
        Finds ways.
    robot
        Whose limits hold.
    rng
        Makes recoveries differ, or two robots would block each other for ever.
    """

    def __init__(self, plan: Plan, robot: Robot, rng: np.random.Generator) -> None:
        self._plan, self._robot, self._rng = plan, robot, rng
        self._goal: tuple[float, float] | None = None
        self._path: Points | None = None
        self._next = 0
        self._turning = False
        self._recovery: tuple[float, Command] | None = None
        self._recoveries = 0
        self._waiting_since: float | None = None
        self._patience = 2.0
        self._held: tuple[float, Pose2] | None = None

    @property
    def recoveries(self) -> int:
        """How often it had to free itself on the way to the present goal."""
        return self._recoveries

    def go(self, goal: tuple[float, float]) -> None:
        """Set out for another goal."""
        self._goal, self._path = goal, None
        self._recoveries = 0

    def command(self, sight: Sight, pose: Pose2 | None = None) -> Command | None:
        """Return what to do; None once the goal is reached, cannot be reached, or is not set.

        Parameters
        ----------
        sight
            The present moment.
        pose
            The robot in the frame that ways are planned in, where that is not the world's.
        """
        at = pose or sight.T_world_base
        if self._goal is None:
            return None
        if self._recovery is not None:
            until, action = self._recovery
            if sight.stamp < until:
                return action
            self._recovery = self._path = self._held = None
        if self._path is None:
            # Others only count when planning anew after a recovery: they move.
            others = sight.others if self._recoveries else ()
            here = (at.x, at.y)
            self._path = self._plan(here, self._goal, others)
            if self._path is None and others:
                self._path = self._plan(here, self._goal, ())
            if self._path is None:
                self._goal = None
                return None
            self._next, self._turning = 0, True
        if self._must_wait(sight):
            return STOP if self._recovery is None else self._recovery[1]
        command = self._pursue(at)
        if command is None:
            self._goal = self._path = self._held = None
            return None
        if self._is_stuck(sight.stamp, at):
            self._free_itself(sight.stamp)
            return STOP
        return command

    def _pursue(self, at: Pose2) -> Command | None:
        path = self._path
        assert path is not None
        # Only onwards along the way: where it comes back past itself it must not jump ahead.
        near = path[self._next : self._next + 15]
        self._next += int(np.hypot(near[:, 0] - at.x, near[:, 1] - at.y).argmin())
        rest = math.hypot(path[-1, 0] - at.x, path[-1, 1] - at.y)
        if self._next >= len(path) - 3 and rest < _ARRIVED:
            return None
        ahead = path[self._next :]
        beyond = np.flatnonzero(np.hypot(ahead[:, 0] - at.x, ahead[:, 1] - at.y) > _LOOK_AHEAD)
        x, y = ahead[beyond[0]] if len(beyond) else ahead[-1]
        error = wrap_angle(math.atan2(y - at.y, x - at.x) - at.theta)
        self._turning = abs(error) > (_TURNED if self._turning else _TURN_FIRST)
        top_w = self._robot.max_w
        if self._turning:
            return Command(0.0, max(-top_w, min(top_w, 3.0 * error)))
        distance = max(math.hypot(x - at.x, y - at.y), 0.05)
        curvature = 2.0 * math.sin(error) / distance
        to_go = rest if self._next >= len(path) - 15 else math.inf
        v = min(self._robot.max_v, math.sqrt(2 * _BRAKING * max(to_go - _ARRIVED / 2, 0.01)))
        v = min(v, top_w / abs(curvature)) if curvature else v
        return Command(v, v * curvature)

    # ------------------------------------------------------------------ what can go wrong
    def _must_wait(self, sight: Sight) -> bool:
        """Whether another robot is ahead; who has waited long enough backs off."""
        at = sight.T_world_base
        in_the_way = any(
            math.hypot(x - at.x, y - at.y) < _GIVE_WAY
            and abs(wrap_angle(math.atan2(y - at.y, x - at.x) - at.theta)) < 1.0
            for x, y in sight.others
        )
        if not in_the_way:
            self._waiting_since = None
            return False
        if self._waiting_since is None:
            self._waiting_since, self._patience = sight.stamp, self._rng.uniform(0.5, 3.0)
        elif sight.stamp - self._waiting_since > self._patience:
            self._waiting_since = None
            self._free_itself(sight.stamp)
        self._held = None  # it stands because it waits
        return True

    def _is_stuck(self, stamp: float, at: Pose2) -> bool:
        if self._held is None:
            self._held = stamp, at
        since, held = self._held
        metres, radians = held.distance_to(at)
        if metres > 0.05 or radians > 0.1:
            self._held = stamp, at
        return stamp - since > _STUCK_AFTER

    def _free_itself(self, stamp: float) -> None:
        """Go back a little in a random curve, then plan anew."""
        self._recoveries += 1
        turn = float(self._rng.uniform(-0.8, 0.8))
        # Something may be behind it too: every other time it goes ahead.
        v = -0.25 if self._recoveries % 2 else 0.2
        self._recovery = stamp + float(self._rng.uniform(0.8, 1.8)), Command(v, turn)
