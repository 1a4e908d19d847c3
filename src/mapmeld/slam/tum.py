"""Trajectories as text, in the form of the TUM RGB-D benchmark, which evo and others read."""

from __future__ import annotations

import math

from mapmeld.io import AnyPath
from mapmeld.io.atomic import write_files
from mapmeld.slam.gmapping import Trajectory


def write_trajectory(trajectory: Trajectory, path: AnyPath, *, force: bool = False) -> None:
    """Write lines ``t x y z qx qy qz qw`` [s, m, quaternion]; z is 0 and the turn about it.

    Raises
    ------
    MapFileError
        The file exists (and `force` is not set), or cannot be written.
    """
    lines = ["# t x y z qx qy qz qw"]
    for stamp, (x, y, theta) in zip(trajectory.stamps, trajectory.poses, strict=True):
        lines.append(f"{stamp:.6f} {x:.6f} {y:.6f} 0 0 0 {math.sin(theta / 2):.9f} {math.cos(theta / 2):.9f}")
    write_files([(path, ["\n".join([*lines, ""]).encode()])], force=force)
