"""What a robot believes of its way from the turns of its wheels."""

from __future__ import annotations

import math

from mapmeld.se2 import Pose2
from mapmeld.simulation.robot import Robot


class WheelOdometry:
    """Dead reckoning of a differential drive from its two encoders.

    Between two readings the robot moves on an arc (Siegwart, Nourbakhsh, Scaramuzza,
    Introduction to Autonomous Mobile Robots, 5.2.4).
    """

    def __init__(self, robot: Robot) -> None:
        self.pose = Pose2()
        self._track = robot.track
        self._metres = math.tau * robot.wheel_radius / robot.encoder_ticks
        self._ticks_per_radian = robot.encoder_ticks / math.tau
        self._left = self._right = 0

    def begin(self, left: float, right: float) -> None:
        """Take the wheels' present angles [rad] as zero."""
        self._left, self._right = self._ticks(left), self._ticks(right)

    def read(self, left: float, right: float) -> None:
        """Go on to the wheels' present angles [rad]."""
        now_left, now_right = self._ticks(left), self._ticks(right)
        way_left, way_right = (
            (now_left - self._left) * self._metres,
            (now_right - self._right) * self._metres,
        )
        self._left, self._right = now_left, now_right
        way, turn = (way_left + way_right) / 2, (way_right - way_left) / self._track
        chord = way * (math.sin(turn / 2) / (turn / 2) if turn else 1.0)
        middle = turn / 2
        self.pose = self.pose @ Pose2(chord * math.cos(middle), chord * math.sin(middle), turn)

    def _ticks(self, angle: float) -> int:
        return math.floor(angle * self._ticks_per_radian)
