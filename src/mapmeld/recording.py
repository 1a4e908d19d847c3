"""What a robot with a laser records while it drives: scans and odometry, in time order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmeld.se2 import Pose2

AT_BASE = Pose2(0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Laser:
    """A planar laser range finder.

    Attributes
    ----------
    beams
        Beams of one scan.
    first_angle, step
        Bearing of the first beam and from beam to beam [rad], counterclockwise in the laser's frame.
    max_range
        Longest range that it measures [m].
    T_base_laser
        Where it sits on the robot.
    """

    beams: int
    first_angle: float
    step: float
    max_range: float
    T_base_laser: Pose2 = AT_BASE

    def bearings(self) -> NDArray[np.float64]:
        """Bearings of the beams (beams,) [rad]."""
        return np.asarray(self.first_angle + self.step * np.arange(self.beams), np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """One scan and where odometry believed the robot to be.

    Attributes
    ----------
    stamp
        [s]
    T_odom_base
        Odometry at that moment.
    ranges
        (beams,) [m] float32; above `Laser.max_range` (inf included) where nothing was met, NaN or 0
        where the beam is invalid.
    """

    stamp: float
    T_odom_base: Pose2
    ranges: NDArray[np.float32]
