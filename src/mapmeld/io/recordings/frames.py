"""Where frames are to one another, out of tf messages."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapmeld.io.recordings.messages import BadMessageError
from mapmeld.se2 import Pose2

Matrix = NDArray[np.float64]

# How far from level something may be, as the cosine of its tilt, for its heading to say all about it.
_LEVEL = 0.95


def frame_name(name: object) -> str:
    """Return the name of a frame without the slash that ROS 1 puts before it at times."""
    return str(name).removeprefix("/")


def matrix_of(position: Any, turn: Any) -> Matrix:
    """Return the 4 x 4 matrix of a position and a quaternion (all zeros: no turn).

    Raises
    ------
    BadMessageError
        They are not finite.
    """
    x, y, z, w = (float(part) for part in (turn.x, turn.y, turn.z, turn.w))
    at = [float(position.x), float(position.y), float(position.z)]
    length = math.hypot(x, y, z, w)
    if not (math.isfinite(length) and all(map(math.isfinite, at))):
        raise BadMessageError("a pose that is not finite")
    x, y, z, w = (x / length, y / length, z / length, w / length) if length else (0.0, 0.0, 0.0, 1.0)
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, 3] = at
    return matrix


def level_pose(matrix: Matrix) -> tuple[Pose2, bool]:
    """Return the pose in the plane that a matrix comes to, and whether it is upside down.

    Raises
    ------
    BadMessageError
        It is tilted, neither level nor upside down.
    """
    up = float(matrix[2, 2])
    if abs(up) < _LEVEL:
        raise BadMessageError("a frame that is neither level nor upside down")
    return Pose2(float(matrix[0, 3]), float(matrix[1, 3]), math.atan2(matrix[1, 0], matrix[0, 0])), up < 0


class Frames:
    """The tree of frames, each at its last known place."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Matrix]] = {}

    def add(self, message: Any) -> None:
        """Take in a TFMessage."""
        for found in message.transforms:
            matrix = matrix_of(found.transform.translation, found.transform.rotation)
            self._parents[frame_name(found.child_frame_id)] = frame_name(found.header.frame_id), matrix

    def parent(self, child: str) -> str | None:
        """Return the frame in which another one has its place."""
        found = self._parents.get(child)
        return found[0] if found else None

    def child(self, parent: str) -> str | None:
        """Return the frame, or one of those, that has its place in another one."""
        return next((child for child, (above, _) in self._parents.items() if above == parent), None)

    def between(self, a: str, b: str) -> Matrix | None:
        """Return the 4 x 4 matrix that takes a point of frame b into frame a; None if nothing joins them."""
        from_a, from_b = self._upwards(a), self._upwards(b)
        for frame, T_frame_a in from_a.items():
            if frame in from_b:
                return np.asarray(np.linalg.inv(T_frame_a) @ from_b[frame], np.float64)
        return None

    def _upwards(self, frame: str) -> dict[str, Matrix]:
        """Return all frames above one, itself first, each with what takes a point of it there."""
        found = {frame: np.eye(4)}
        while frame in self._parents:
            above, matrix = self._parents[frame]
            if above in found:  # a ring
                break
            found[above] = matrix @ found[frame]
            frame = above
        return found
