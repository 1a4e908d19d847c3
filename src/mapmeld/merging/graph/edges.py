"""Measurements between maps, as arrays, and how far right ones may contradict one another.

Poses are rows (x, y, theta) [m, m, rad]; covariances are those of these three numbers, as in
`mapmeld.MatchResult`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mapmeld.grid import OccupancyGrid
from mapmeld.se2 import Pose2

Doubles = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

# A recorded map is bent: no rigid motion is right everywhere in it, so right answers disagree by more than
# the walls of any one pair can tell. Drift that is left in a map grows with its size. One map's share [one
# standard deviation]; that of a pair is both together. Two small maps may then disagree by 0.5 m and 5
# degrees at 3.5 standard deviations, which is where two answers count as two everywhere in mapmeld.
BENT_METRES = 0.1
BENT_SHARE = 0.01
BENT_TURN = math.radians(1.0)

# What an answer's probability can count for: even a calibrated one was fitted on pairs of which about half
# were of one place. An accepted answer of a method that states none counts as much as the next figure.
MOST_SURE = 0.99
UNSTATED = 0.9


@dataclass(frozen=True, slots=True)
class Extent:
    """Where a map lies in its own frame, and how large it is.

    Attributes
    ----------
    x, y
        Middle of what is known [m].
    size
        Diagonal [m] of the rectangle that spreads as what is known does; the same however the map
        is turned.
    """

    x: float = 0.0
    y: float = 0.0
    size: float = 0.0

    @classmethod
    def of(cls, grid: OccupancyGrid) -> Extent:
        """Measure a map; one in which nothing is known has no size."""
        rows, cols = np.nonzero(grid.known)
        if not rows.size:
            return cls()
        middle = np.array([cols.mean(), rows.mean()])
        spread = float(cols.var() + rows.var())
        x, y = grid.lattice_to_metres(middle + 0.5)
        return cls(float(x), float(y), math.sqrt(12 * spread) * grid.resolution)


def bending(T_a_b: Pose2, a: Extent, b: Extent) -> Doubles:
    """Return the covariance (3, 3) of T_a_b that the bending of the two maps adds.

    A shift and a turn about the middle of the smaller map, near which the two overlap.
    """
    xy = sum(BENT_METRES**2 + (BENT_SHARE * extent.size) ** 2 for extent in (a, b))
    about = (a.x, a.y) if a.size < b.size else tuple(map(float, T_a_b.apply((b.x, b.y))))
    A = _about(T_a_b, about)
    return np.asarray(A @ np.diag([xy, xy, 2 * BENT_TURN**2]) @ A.T)


def of_another_mode(T_a_b: Pose2, covariance: Doubles, other_a_b: Pose2, b: Extent) -> Doubles:
    """Return the covariance of another mode of a match: as exact as the best one in its worst direction."""
    A = _about(T_a_b, T_a_b.apply((b.x, b.y)))
    back = np.linalg.inv(A)
    local = back @ covariance @ back.T
    xy = float(np.linalg.eigvalsh(local[:2, :2])[-1])
    B = _about(other_a_b, other_a_b.apply((b.x, b.y)))
    return np.asarray(B @ np.diag([xy, xy, float(local[2, 2])]) @ B.T)


def _about(T: Pose2, point: ArrayLike) -> Doubles:
    """Return what a shift and a turn about `point` do to the numbers (x, y, theta) of T."""
    x, y = np.asarray(point, np.float64)
    return np.array([[1.0, 0.0, y - T.y], [0.0, 1.0, T.x - x], [0.0, 0.0, 1.0]])


def log_odds(probability: float | None) -> float:
    """Return what an answer's probability counts for, above 0."""
    p = UNSTATED if probability is None else min(probability, MOST_SURE)
    return max(math.log(p / (1 - p)), 0.1) if p > 0 else 0.1


# ---------------------------------------------------------------------- arrays
@dataclass(frozen=True, slots=True, eq=False)
class Edges:
    """Measured transforms between nodes, m of them.

    Attributes
    ----------
    i, j
        (m,) nodes; edge k says where the frame of j[k] lies in that of i[k].
    z
        (m, 3) measured T_i_j.
    covariance
        (m, 3, 3) of z.
    weight
        (m,) log odds that it is right; infinite for what is given and not in question.
    """

    i: Index
    j: Index
    z: Doubles
    covariance: Doubles
    weight: Doubles

    @classmethod
    def of(cls, rows: Sequence[tuple[int, int, Pose2, ArrayLike, float]]) -> Edges:
        """Put together (i, j, T_i_j, covariance, weight) of every edge."""
        i, j = (np.array([row[k] for row in rows], np.intp) for k in (0, 1))
        z = np.array([row_of(row[2]) for row in rows]).reshape(-1, 3)
        covariance = np.array([np.asarray(row[3], np.float64) for row in rows]).reshape(-1, 3, 3)
        return cls(i, j, z, covariance, np.array([row[4] for row in rows], np.float64))

    def __len__(self) -> int:
        """How many there are."""
        return len(self.i)

    def __getitem__(self, which: Flags | Index) -> Edges:
        """Return some of them, by a mask or by their numbers."""
        return Edges(self.i[which], self.j[which], self.z[which], self.covariance[which], self.weight[which])

    @property
    def given(self) -> Flags:
        """(m,) which are not in question."""
        return np.isinf(self.weight)


def row_of(pose: Pose2) -> tuple[float, float, float]:
    """Return a pose as (x, y, theta)."""
    return pose.x, pose.y, pose.theta


def pose_of(row: ArrayLike) -> Pose2:
    """Return (x, y, theta) as a pose."""
    x, y, theta = np.asarray(row, np.float64)
    return Pose2(float(x), float(y), float(theta))


def wrapped(angles: Doubles) -> Doubles:
    """Return the same directions in [-pi, pi]; those that are there already are not touched."""
    turned = (angles + math.pi) % math.tau - math.pi
    return np.where(np.abs(angles) <= math.pi, angles, turned)


def composed(one: Doubles, two: Doubles) -> Doubles:
    """Return T_a_c (m, 3) of T_a_b (m, 3) and T_b_c (m, 3)."""
    c, s = np.cos(one[..., 2]), np.sin(one[..., 2])
    x = one[..., 0] + c * two[..., 0] - s * two[..., 1]
    y = one[..., 1] + s * two[..., 0] + c * two[..., 1]
    return np.stack([x, y, wrapped(one[..., 2] + two[..., 2])], axis=-1)


def inverted(T: Doubles) -> Doubles:
    """Return T_b_a (m, 3) of T_a_b (m, 3)."""
    c, s = np.cos(T[..., 2]), np.sin(T[..., 2])
    x, y = -c * T[..., 0] - s * T[..., 1], s * T[..., 0] - c * T[..., 1]
    return np.stack([x, y, wrapped(-T[..., 2])], axis=-1)


def moves(T: Doubles, covariance: Doubles) -> Doubles:
    """Return the covariance (m, 3, 3) of the motion by which T_a_b (m, 3) errs.

    A shift and a turn about the origin of frame a.
    """
    B = _eye(len(T))
    B[:, 0, 2], B[:, 1, 2] = T[:, 1], -T[:, 0]
    return B @ covariance @ B.transpose(0, 2, 1)


def seen_from(X: Doubles, covariance: Doubles) -> Doubles:
    """Return covariances (m, 3, 3) of motions in frame b as those in frame a, for poses X = T_a_b (m, 3)."""
    A = _eye(len(X))
    c, s = np.cos(X[:, 2]), np.sin(X[:, 2])
    A[:, 0, 0], A[:, 0, 1], A[:, 1, 0], A[:, 1, 1] = c, -s, s, c
    A[:, 0, 2], A[:, 1, 2] = X[:, 1], -X[:, 0]
    return A @ covariance @ A.transpose(0, 2, 1)


def in_own_frames(edges: Edges) -> Doubles:
    """Return the covariances (m, 3, 3) of the errors as they are seen in the frames of the nodes j, not i.

    That is how g2o and GTSAM measure them.
    """
    c, s = np.cos(edges.z[:, 2]), np.sin(edges.z[:, 2])
    A = np.zeros((len(edges), 3, 3))
    A[:, 0, 0], A[:, 0, 1], A[:, 1, 0], A[:, 1, 1], A[:, 2, 2] = c, s, -s, c, 1.0
    return np.asarray(A @ edges.covariance @ A.transpose(0, 2, 1))


def squared_distance(residuals: Doubles, covariance: Doubles) -> Doubles:
    """Return the squared Mahalanobis distances (m,) of residuals (m, 3)."""
    if not len(residuals):
        return np.zeros(0)
    solved = np.linalg.solve(covariance, residuals[..., None])[..., 0]
    return np.asarray((residuals * solved).sum(axis=-1))


def _eye(count: int) -> Doubles:
    return np.repeat(np.eye(3)[None], count, axis=0)
