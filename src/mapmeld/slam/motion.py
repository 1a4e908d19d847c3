"""Odometry's motion model."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mapmeld.se2 import Pose2
from mapmeld.slam.parameters import GMappingParameters

Floats = NDArray[np.float64]

# How much of the translation along one axis is noise along the other one, as a part of srr.
_ACROSS = 0.3


def motion_noise(T_old_new: Pose2, parameters: GMappingParameters) -> Floats:
    """Return standard deviations (3,) [m, m, rad] of a motion, along the axes of the old pose.

    In proportion to the motion, as GMapping has it: translation adds to all three, rotation as well.
    """
    p = parameters
    along, across, turn = abs(T_old_new.x), abs(T_old_new.y), abs(T_old_new.theta)
    return np.array(
        [
            p.srr * along + _ACROSS * p.srr * across + p.str * turn,
            p.srr * across + _ACROSS * p.srr * along + p.str * turn,
            p.stt * turn + p.srt * math.hypot(along, across),
        ]
    )


def moved(poses: Floats, motions: Floats) -> Floats:
    """Return the poses (n, 3) after motions (n, 3) or (3,) [m, m, rad] in their own frames."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x, y, turn = np.broadcast_to(motions, poses.shape).T
    return np.column_stack([poses[:, 0] + c * x - s * y, poses[:, 1] + s * x + c * y, poses[:, 2] + turn])


def sample_motion(
    poses: Floats, T_old_new: Pose2, parameters: GMappingParameters, rng: np.random.Generator
) -> Floats:
    """Return the poses (n, 3) [m, m, rad] after a motion that odometry reports, with noise for each."""
    mean = np.array([T_old_new.x, T_old_new.y, T_old_new.theta])
    noise = motion_noise(T_old_new, parameters)
    return moved(poses, mean + noise * rng.standard_normal(poses.shape))
