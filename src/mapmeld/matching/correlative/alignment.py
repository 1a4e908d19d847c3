"""Wall against wall: what each map's walls meet in the other, and the alignment that brings them together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mapmeld.matching.correlative.wall_map import Doubles, Floats, Plane, WallMap
from mapmeld.se2 import Pose2


def to_local(pa: WallMap, pb: WallMap, T_a_b: Pose2) -> Doubles:
    """(x, y, theta) that takes a point of b's local frame into a's."""
    t = pa.frame.inverse() @ T_a_b @ pb.frame
    return np.array([t.x, t.y, t.theta])


def to_metric(pa: WallMap, pb: WallMap, t: Doubles) -> Pose2:
    """Undo `to_local`."""
    return pa.frame @ Pose2(float(t[0]), float(t[1]), float(t[2])) @ pb.frame.inverse()


def turn_and_shift(t: Doubles) -> tuple[Plane, Plane]:
    """Columns (k, 1) with p_a = turn * p_b + shift, of each t (k, 3)."""
    turn = np.exp(1j * t[:, 2:3]).astype(np.complex64)
    return turn, (t[:, :1] + 1j * t[:, 1:2]).astype(np.complex64)


@dataclass(frozen=True, slots=True, eq=False)
class WallPairs:
    """Wall points of b, then of a, against the nearest walls of the other map.

    All arrays are (k, m), a row for each transform, in a's local frame.
    """

    x: Plane  # b's points moved by T, a's points as they are
    e: Plane  # from a's wall to b's
    normal: Plane  # of the wall that was looked up
    own: Plane  # of the wall that the point lies on
    straight: Floats  # the lesser of both
    depth: Floats  # how deep the point lies in the other's free space; -1 unknown

    def across(self) -> tuple[Floats, Floats]:
        """Distance between the walls across and along the looked up wall [m]."""
        d = self.e * self.normal.conj()
        return d.real, d.imag

    def cosine(self) -> Floats:
        """|cos| between both walls' directions."""
        return np.abs(self.own.real * self.normal.real + self.own.imag * self.normal.imag)


def look_up(pa: WallMap, pb: WallMap, t: Doubles, n: int, u: Plane | None = None) -> WallPairs:
    """Look up n points of each map under every t (k, 3).

    `u` (k, m) displaces b's walls further, as seen in a's frame.
    """
    turn, shift = turn_and_shift(t)
    b, a = pb.points[:n], pa.points[:n]
    x = turn * b + shift
    moved = x if u is None else x + u[:, : len(b)]
    at_a = pa.at(moved)
    j = pa.nearest[at_a]
    inverse = turn.conj()
    y = ((a if u is None else a - u[:, len(b) :]) - shift) * inverse
    at_b = pb.at(y)
    i = pb.nearest[at_b]
    k = len(t)
    return WallPairs(
        x=np.concatenate([x, np.broadcast_to(a, (k, len(a)))], axis=1),
        e=np.concatenate([moved - pa.points[j], (pb.points[i] - y) * turn], axis=1),
        normal=np.concatenate([pa.normals[j], pb.normals[i] * turn], axis=1),
        own=np.concatenate([pb.normals[:n] * turn, np.broadcast_to(pa.normals[:n], (k, len(a)))], axis=1),
        straight=np.concatenate(
            [np.minimum(pa.straight[j], pb.straight[:n]), np.minimum(pb.straight[i], pa.straight[:n])], axis=1
        ),
        depth=np.concatenate([pa.depth[at_a], pb.depth[at_b]], axis=1),
    )


def robust_weights(p: WallPairs, scale: float) -> tuple[Floats, Floats]:
    """Distance across the wall [m] and its robust weight (Tukey), zero for walls of another direction."""
    r, along = p.across()
    u = np.maximum(1 - (r * np.float32(1 / scale)) ** 2, 0)
    w = u * u * p.straight
    w *= np.minimum(np.maximum(p.cosine() - np.float32(0.8), 0), np.float32(0.15)) * np.float32(1 / 0.15)
    w *= np.abs(along) < max(scale, 0.2)
    return r, w


def refine(pa: WallMap, pb: WallMap, t: Doubles, scales: Sequence[float], n: int) -> Doubles:
    """Align walls to walls in both directions: one Gauss-Newton step per scale, all t (k, 3) at once.

    Parameters
    ----------
    scales
        Tolerance [m] of each step, wide to narrow: walls further apart do not count.
    n
        Wall points of each map to use.
    """
    t = t.copy()
    for scale in scales:
        p = look_up(pa, pb, t, n)
        r, w = robust_weights(p, scale)
        mass = w.sum(axis=1, dtype=np.float64) + 1e-6
        centre = ((w * p.x).sum(axis=1) / mass).astype(np.complex64)
        arm = p.x - centre[:, None]
        nx, ny = p.normal.real, p.normal.imag
        turned = (arm.conj() * p.normal).imag
        J = np.stack([nx, ny, turned], axis=1)
        Jw = J * w[:, None]
        H = np.matmul(Jw, J.transpose(0, 2, 1)).astype(np.float64)
        g = np.matmul(Jw, r[..., None]).astype(np.float64)
        # Damped: a direction that nothing fixes (along a corridor) stays where the search put it.
        H[:, [0, 1, 2], [0, 1, 2]] += 0.02 * mass[:, None]
        step = -np.linalg.solve(H, g)[..., 0]
        np.clip(step, [-0.5, -0.5, -0.1], [0.5, 0.5, 0.1], out=step)
        moved = (
            (t[:, 0] + 1j * t[:, 1] - centre) * np.exp(1j * step[:, 2])
            + centre
            + step[:, 0]
            + 1j * step[:, 1]
        )
        t[:, 0], t[:, 1] = moved.real, moved.imag
        t[:, 2] += step[:, 2]
    return t
