"""Rigid motions of the plane, SE(2).

Names carry both frames: ``T_a_b`` takes a point of frame b into frame a, so that
``T_a_c = T_a_b @ T_b_c`` reads by cancelling the inner letters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


def wrap_angle(angle: float) -> float:
    """Return the same direction as `angle` [rad] in the interval (-pi, pi]."""
    wrapped = math.remainder(angle, math.tau)
    return math.pi if wrapped == -math.pi else wrapped


@dataclass(frozen=True, slots=True)
class Pose2:
    """A position and heading in the plane, equally a rigid transform.

    Attributes
    ----------
    x, y
        Translation [m].
    theta
        Counter-clockwise rotation [rad]; kept as given, compare with :func:`wrap_angle`.
    """

    x: float = 0.0
    y: float = 0.0
    theta: float = 0.0

    def __matmul__(self, other: Pose2) -> Pose2:
        """Compose: ``(T_a_b @ T_b_c).apply(p) == T_a_b.apply(T_b_c.apply(p))``."""
        # As `apply`, without an array: poses are composed by the dozen.
        c, s = math.cos(self.theta), math.sin(self.theta)
        x, y = c * other.x - s * other.y + self.x, s * other.x + c * other.y + self.y
        return Pose2(x, y, wrap_angle(self.theta + other.theta))

    def inverse(self) -> Pose2:
        """Return ``T_b_a`` for ``T_a_b``."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        return Pose2(-c * self.x - s * self.y, s * self.x - c * self.y, wrap_angle(-self.theta))

    def apply(self, points: ArrayLike) -> NDArray[np.float64]:
        """Transform points [m] of shape (..., 2); the shape is kept."""
        p = np.asarray(points, dtype=np.float64)
        c, s = math.cos(self.theta), math.sin(self.theta)
        x, y = p[..., 0], p[..., 1]
        return np.stack([c * x - s * y + self.x, s * x + c * y + self.y], axis=-1)

    def matrix(self) -> NDArray[np.float64]:
        """Return the homogeneous 3 x 3 matrix."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        return np.array([[c, -s, self.x], [s, c, self.y], [0.0, 0.0, 1.0]])

    @classmethod
    def from_matrix(cls, matrix: ArrayLike) -> Pose2:
        """Read a homogeneous 3 x 3 matrix.

        Raises
        ------
        ValueError
            The matrix is not a rigid motion (scale, shear or mirror in it).
        """
        m = np.asarray(matrix, dtype=np.float64)
        if m.shape != (3, 3):
            raise ValueError(f"a 3 x 3 matrix is needed, not {m.shape}")
        pose = cls(float(m[0, 2]), float(m[1, 2]), math.atan2(m[1, 0], m[0, 0]))
        if not (np.isfinite(m).all() and np.allclose(pose.matrix(), m, rtol=0.0, atol=1e-9)):
            raise ValueError("the matrix is not a rigid motion of the plane")
        return pose

    def distance_to(self, other: Pose2) -> tuple[float, float]:
        """Return (metres, radians >= 0) between two poses given in the same frame."""
        return math.hypot(other.x - self.x, other.y - self.y), abs(wrap_angle(other.theta - self.theta))

    def __str__(self) -> str:
        return f"x {self.x:.3f} m, y {self.y:.3f} m, theta {math.degrees(self.theta):.2f} deg"


def rigid_through(a_from: ArrayLike, b_from: ArrayLike, a_to: ArrayLike, b_to: ArrayLike) -> Pose2:
    """Return the rigid motion that lays segment a_from->b_from onto a_to->b_to.

    The directions are made equal and the midpoints coincide (the least-squares answer
    when the two lengths differ a little). Points are (2,) arrays.
    """
    af, bf, at, bt = (np.asarray(p, dtype=np.float64) for p in (a_from, b_from, a_to, b_to))
    df, dt = bf - af, bt - at
    theta = math.atan2(df[0] * dt[1] - df[1] * dt[0], float(df @ dt))
    x, y = (at + bt) / 2 - Pose2(0.0, 0.0, theta).apply((af + bf) / 2)
    return Pose2(float(x), float(y), theta)
