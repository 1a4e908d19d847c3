"""Upright boxes, the one shape that environments are made of."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mapmeld.se2 import Pose2


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle of the plan.

    Attributes
    ----------
    x, y
        Centre [m].
    length, width
        Sides along its own x and y [m].
    theta
        How it is turned [rad].
    """

    x: float
    y: float
    length: float
    width: float
    theta: float = 0.0

    @property
    def pose(self) -> Pose2:
        """Its centre and direction."""
        return Pose2(self.x, self.y, self.theta)

    def part(self, x: float, y: float, length: float, width: float) -> Box:
        """Return a box of another size placed in this one's frame (x, y from its centre)."""
        centre = self.pose.apply((x, y))
        return Box(float(centre[0]), float(centre[1]), length, width, self.theta)

    def grown(self, margin: float) -> Box:
        """Return the box with `margin` [m] more on every side."""
        return Box(self.x, self.y, self.length + 2 * margin, self.width + 2 * margin, self.theta)

    def reach(self) -> tuple[float, float]:
        """Return half the sides of the smallest rectangle along x and y around it."""
        c, s = abs(math.cos(self.theta)), abs(math.sin(self.theta))
        return (c * self.length + s * self.width) / 2, (s * self.length + c * self.width) / 2
