"""Tiny worlds of walls, and a robot that drives through them with wheels that slip."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mapmeld.recording import Laser, Scan
from mapmeld.se2 import Pose2

Floats = NDArray[np.float64]
Segments = Sequence[tuple[float, float, float, float]]

# A room of 6 m x 4 m that looks the same from nowhere else: a niche, a column, a slanted wall.
ROOM: Segments = (
    (0, 0, 6, 0), (6, 0, 6, 2.5), (6, 2.5, 5, 4), (5, 4, 2, 4), (2, 4, 2, 3.2), (2, 3.2, 0, 3.2),
    (0, 3.2, 0, 0),
    (3.6, 1.2, 4.0, 1.2), (4.0, 1.2, 4.0, 1.7), (4.0, 1.7, 3.6, 1.7), (3.6, 1.7, 3.6, 1.2),
)  # fmt: skip

LASER = Laser(121, math.radians(-120), math.radians(2), 5.0)


def ranges_from(pose: Pose2, laser: Laser = LASER, walls: Segments = ROOM) -> Floats:
    """The exact distance along every beam to the first wall; inf where there is none in range."""
    at = pose @ laser.T_base_laser
    angles = at.theta + laser.bearings()
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    best = np.full(laser.beams, np.inf)
    for x0, y0, x1, y1 in walls:
        along = np.array([x1 - x0, y1 - y0])
        off = np.array([x0 - at.x, y0 - at.y])
        across = directions[:, 0] * along[1] - directions[:, 1] * along[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (off[0] * along[1] - off[1] * along[0]) / across
            share = (off[0] * directions[:, 1] - off[1] * directions[:, 0]) / across
        met = (distance > 0) & (share >= 0) & (share <= 1)
        best = np.where(met, np.minimum(best, distance), best)
    return np.where(best <= laser.max_range, best, np.inf)


def drive(
    steps: int = 120, seed: int = 0, laser: Laser = LASER, slip: float = 0.06
) -> tuple[list[Scan], Floats]:
    """A round about the column at 10 Hz: the scans with drifting odometry, and the true poses (n, 3)."""
    rng = np.random.default_rng(seed)
    phase = np.linspace(0.0, 2 * math.pi, steps)
    x, y = 3.0 + 1.9 * np.cos(phase), 1.6 + 0.9 * np.sin(phase)
    heading = np.unwrap(np.arctan2(np.gradient(y), np.gradient(x)))
    true = np.column_stack([x, y, heading])
    believed = Pose2()
    scans = []
    for number, pose in enumerate(true):
        if number:
            step = Pose2(*true[number - 1]).inverse() @ Pose2(*pose)
            turn = step.theta * (1 + slip) + rng.normal(0, 0.004)
            believed = believed @ Pose2(step.x * (1 + slip + rng.normal(0, 0.05)), step.y, turn)
        ranges = ranges_from(Pose2(*pose), laser) + rng.normal(0, 0.01, laser.beams)
        scans.append(Scan(0.1 * number, believed, ranges.astype(np.float32)))
    return scans, true


def pose_rms(poses: Floats, true: Floats) -> float:
    """How far poses (n, 3) are from the true ones, with the first laid on the first [m]."""
    T_true_map = Pose2(*true[0]) @ Pose2(*poses[0]).inverse()
    error = T_true_map.apply(poses[:, :2]) - true[:, :2]
    return math.sqrt(float(np.square(error).sum(axis=1).mean()))
