"""What simulated robots call their topics and frames, and what their odometry says, recorded or live."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mapmeld.se2 import Pose2

WORLD, MAP, ODOM, BASE, LASER = "world", "map", "odom", "base_link", "laser"
"""Frames. Those of several robots have the robot's name and a slash before them, the world has not."""

# Of what odometry says, as its publishers usually state it; a simulated robot does not know its slip either.
_VARIANCES = (1e-3, 1e-3, 1e-2)  # x, y [m^2], yaw [rad^2]; of speeds, the same [1/s^2]
_UNUSED_VARIANCE = 1e6  # of z, roll and pitch


def robot_names(count: int) -> tuple[str, ...]:
    """Return the names of the robots: none for a single one."""
    return ("",) if count == 1 else tuple(f"robot_{i + 1}" for i in range(count))


def odometry_covariance() -> NDArray[np.float64]:
    """Return the covariance (36,) of odometry's poses, and of its speeds, as ROS lays it out."""
    x, y, yaw = _VARIANCES
    diagonal = (x, y, _UNUSED_VARIANCE, _UNUSED_VARIANCE, _UNUSED_VARIANCE, yaw)
    return np.diag(diagonal).reshape(-1)


class RobotTopics:
    """Names by robot, and speeds by odometry.

    Parameters
    ----------
    names
        Of the robots, as `robot_names` has them.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        self._before: dict[int, tuple[float, Pose2]] = {}

    def topic(self, robot: int, name: str) -> str:
        """Return the whole name of a topic of a robot."""
        return "/" + "/".join(part for part in (self.names[robot], name) if part)

    def frame(self, robot: int, name: str) -> str:
        """Return the whole name of a frame of a robot."""
        return "/".join(part for part in (self.names[robot], name) if part)

    def speed(self, robot: int, stamp: float, pose: Pose2) -> tuple[float, float]:
        """Return speed [m/s] and turn rate [rad/s] by odometry since this was asked before."""
        then, before = self._before.get(robot, (stamp, pose))
        self._before[robot] = stamp, pose
        if stamp <= then:
            return 0.0, 0.0
        moved = before.inverse() @ pose
        return moved.x / (stamp - then), moved.theta / (stamp - then)
