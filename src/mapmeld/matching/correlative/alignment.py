"""Wall against wall: what each map's walls meet in the other, and the alignment that brings them together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mapmeld.matching.correlative.wall_map import Cells, Doubles, Floats, Plane, WallMap
from mapmeld.se2 import Pose2

_STEP_MOST = np.array([0.5, 0.5, 0.1])  # [m, m, rad]


def to_local(pa: WallMap, pb: WallMap, T_a_b: Pose2) -> Doubles:
    """(x, y, theta) that takes a point of b's local frame into a's."""
    t = pa.frame.inverse() @ T_a_b @ pb.frame
    return np.array([t.x, t.y, t.theta])


def to_metric(pa: WallMap, pb: WallMap, t: Doubles) -> Pose2:
    """Undo `to_local`."""
    return pa.frame @ Pose2(float(t[0]), float(t[1]), float(t[2])) @ pb.frame.inverse()


def turn_and_shift(t: Doubles) -> tuple[Plane, Plane]:
    """Columns (k, 1) with p_a = turn * p_b + shift, of each t (k, 3)."""
    turn, shift = np.empty((2, len(t), 1), np.complex64)
    turn.real, turn.imag = np.cos(t[:, 2:]), np.sin(t[:, 2:])
    shift.real, shift.imag = t[:, :1], t[:, 1:2]
    return turn, shift


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
    fields: tuple[tuple[WallMap, Cells], tuple[WallMap, Cells]]  # where b's points lie in a's, a's in b's

    @property
    def depth(self) -> Floats:
        """How deep the point lies in the other's free space; -1 unknown."""
        return np.concatenate([walls.depth.take(at) for walls, at in self.fields], axis=1)

    def across(self) -> tuple[Floats, Floats]:
        """Distance between the walls across and along the looked up wall [m]."""
        d = self.normal.conj()
        d *= self.e
        return d.real, d.imag

    def cosine(self) -> Floats:
        """|cos| between both walls' directions."""
        d = self.normal.conj()
        d *= self.own
        return np.abs(d.real)


def look_up(pa: WallMap, pb: WallMap, t: Doubles, n: int, u: Plane | None = None) -> WallPairs:
    """Look up n points of each map under every t (k, 3).

    `u` (k, m) displaces b's walls further, as seen in a's frame.
    """
    turn, shift = turn_and_shift(t)
    b, a = pb.points[:n], pa.points[:n]
    of_b, of_a = np.s_[:, : len(b)], np.s_[:, len(b) :]
    x, e, normal, own = np.empty((4, len(t), len(b) + len(a)), np.complex64)
    straight = np.empty(x.shape, np.float32)

    np.multiply(turn, b, out=x[of_b])
    x[of_b] += shift
    x[of_a] = a
    np.multiply(turn, pb.normals[:n], out=own[of_b])
    own[of_a] = pa.normals[:n]

    moved = x[of_b] if u is None else x[of_b] + u[of_b]
    at_a = pa.at(moved)
    j = pa.nearest.take(at_a)
    np.subtract(moved, pa.points.take(j), out=e[of_b])
    normal[of_b] = pa.normals.take(j)
    np.minimum(pa.straight.take(j), pb.straight[:n], out=straight[of_b])

    y = (a if u is None else a - u[of_a]) - shift
    y *= turn.conj()
    at_b = pb.at(y)
    i = pb.nearest.take(at_b)
    np.subtract(pb.points.take(i), y, out=e[of_a])
    e[of_a] *= turn
    np.multiply(pb.normals.take(i), turn, out=normal[of_a])
    np.minimum(pb.straight.take(i), pa.straight[:n], out=straight[of_a])
    return WallPairs(x, e, normal, own, straight, ((pa, at_a), (pb, at_b)))


def robust_weights(p: WallPairs, scale: float) -> tuple[Floats, Floats]:
    """Distance across the wall [m] and its robust weight (Tukey), zero for walls of another direction."""
    r, along = p.across()
    w = r * np.float32(1 / scale)
    w *= w
    np.subtract(1, w, out=w)
    np.maximum(w, 0, out=w)
    w *= w
    w *= p.straight
    same_way = p.cosine()
    same_way -= np.float32(0.8)
    np.maximum(same_way, 0, out=same_way)
    np.minimum(same_way, np.float32(0.15), out=same_way)
    same_way *= np.float32(1 / 0.15)
    w *= same_way
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
        turned = (p.x - centre[:, None]).conj()
        turned *= p.normal
        J = np.empty((len(t), 3, r.shape[1]), np.float32)
        J[:, 0], J[:, 1], J[:, 2] = p.normal.real, p.normal.imag, turned.imag
        Jw = J * w[:, None]
        H = np.matmul(Jw, J.transpose(0, 2, 1)).astype(np.float64)
        g = np.matmul(Jw, r[..., None]).astype(np.float64)
        # Damped: a direction that nothing fixes (along a corridor) stays where the search put it.
        H += (0.02 * mass)[:, None, None] * np.eye(3)
        step = np.maximum(np.minimum(-np.linalg.solve(H, g)[..., 0], _STEP_MOST), -_STEP_MOST)
        moved = (
            (t[:, 0] + 1j * t[:, 1] - centre) * np.exp(1j * step[:, 2])
            + centre
            + step[:, 0]
            + 1j * step[:, 1]
        )
        t[:, 0], t[:, 1] = moved.real, moved.imag
        t[:, 2] += step[:, 2]
    return t
