"""Bending one map onto the other: real maps stretch and bend by drift, and no rigid motion fits all of them.

A displacement quadratic in x and y, held by springs, takes up what is smooth of it, and a shift of
each patch what is local, so that what then remains can be judged by a narrow tolerance.
"""

from __future__ import annotations

import math

import numpy as np

from mapmeld.matching.correlative.alignment import WallPairs, look_up, robust_weights
from mapmeld.matching.correlative.wall_map import Doubles, Floats, Index, Plane, WallMap

PATCH = 4.0  # [m] maps bend over longer ways than this
PATCH_SPRING = 2.0  # weight, in wall points, of "a patch lies where the smooth bending puts it"
_SCALES = (0.8, 0.6, 0.45, 0.3, 0.25)  # [m] tolerance of each step of the bending
_SPRING = 4.0  # weight, in wall points, of "maps do not stretch or bend"
_POINTS = 500


def smooth_bending(pa: WallMap, pb: WallMap, t: Doubles, x: Plane) -> Plane:
    """Return the displacement at x (k, m) that bends b smoothly onto a, for each t (k, 3).

    Outside of what is matched the quadratic is held at its edge, so that it cannot run away.
    """
    p = look_up(pa, pb, t, _POINTS)
    _, w = robust_weights(p, 1.0)
    mass = w.sum(axis=1, keepdims=True) + np.float32(1e-6)
    centre = (w * p.x).sum(axis=1, keepdims=True) / mass
    arm = p.x - centre
    spread = np.sqrt((w * (arm.real**2 + arm.imag**2)).sum(axis=1, keepdims=True) / mass)
    per_spread = 1 / np.maximum(spread, 1)
    at_points = _quadratic(arm * per_spread)
    c = np.zeros((len(t), 12))
    J = np.empty((len(t), 12, p.x.shape[1]), np.float32)
    for scale in _SCALES:
        r, w = robust_weights(p, scale)
        np.multiply(p.normal.real[:, None], at_points, out=J[:, :6])
        np.multiply(p.normal.imag[:, None], at_points, out=J[:, 6:])
        Jw = J * w[:, None]
        H = np.matmul(Jw, J.transpose(0, 2, 1)).astype(np.float64) + _STIFFNESS
        g = np.matmul(Jw, r[..., None])[..., 0].astype(np.float64) + c @ _STIFFNESS
        c -= np.linalg.solve(H, g[..., None])[..., 0]
        if scale != _SCALES[-1]:
            p = look_up(pa, pb, t, _POINTS, _displacement(c, at_points))
    return _displacement(c, _quadratic((x - centre) * per_spread))


def _quadratic(z: Plane) -> Floats:
    """Return the six monomials (k, 6, m) of z (k, m)."""
    monomials = np.empty((len(z), 6, z.shape[1]), np.float32)
    one, x, y, xx, xy, yy = monomials.swapaxes(0, 1)
    one[:] = 1
    np.maximum(np.minimum(z.real, 2), -2, out=x)
    np.maximum(np.minimum(z.imag, 2), -2, out=y)
    np.multiply(x, x, out=xx)
    np.multiply(x, y, out=xy)
    np.multiply(y, y, out=yy)
    return monomials


def _displacement(c: Doubles, monomials: Floats) -> Plane:
    u = np.empty((len(c), monomials.shape[2]), np.complex64)
    xy = np.matmul(c.reshape(-1, 2, 6).astype(np.float32), monomials)
    u.real, u.imag = xy[:, 0], xy[:, 1]
    return u


def _stiffness() -> Doubles:
    stiffness = np.diag(np.tile([0.05, 1, 1, 1, 1, 1], 2)) * _SPRING
    turn = np.zeros(12)  # a small turn, (-y, x), is no bending
    turn[2], turn[7] = -math.sqrt(0.5), math.sqrt(0.5)
    return np.asarray(stiffness - 0.95 * _SPRING * np.outer(turn, turn))


_STIFFNESS = _stiffness()


def patches_of(x: Plane) -> tuple[Index, int]:
    """Return the number of the square patch in which each point x (k, m) lies, and how many there are.

    No two rows share a patch.
    """
    col, row = (np.floor(v * np.float32(1 / PATCH)).astype(np.intp) for v in (x.real, x.imag))
    left, bottom = int(col.min()), int(row.min())
    cols, rows = int(col.max()) - left + 1, int(row.max()) - bottom + 1
    patch: Index = row * cols
    patch += col
    patch += np.arange(len(x))[:, None] * (rows * cols) - (bottom * cols + left)
    return patch, len(x) * rows * cols


def patch_shifts(p: WallPairs, patch: Index, count: int) -> Plane:
    """Return the shift (count,) of each patch that brings its walls together, held by a spring."""
    r, w = robust_weights(p, 0.4)
    nx, ny = p.normal.real, p.normal.imag
    wx, wy = w * nx, w * ny
    of_patch = patch.ravel()
    xx, xy, yy, gx, gy = (
        np.bincount(of_patch, v.ravel(), count).astype(np.float64, copy=False)
        for v in (wx * nx, wx * ny, wy * ny, wx * r, wy * r)
    )
    xx += PATCH_SPRING
    yy += PATCH_SPRING
    det = xx * yy - xy * xy
    return np.asarray((-(yy * gx - xy * gy) / det - 1j * (xx * gy - xy * gx) / det).astype(np.complex64))


def nearest_rigid(t: Doubles, x: Plane, u: Plane, w: Floats) -> Doubles:
    """Return the rigid transforms (k, 3) nearest to t (k, 3) followed by x -> x + u, weighted by w (k, m)."""
    total = w.sum(axis=1) + 1e-6
    centre, shift = (w * x).sum(axis=1) / total, (w * u).sum(axis=1) / total
    arm = x - centre[:, None].astype(np.complex64)
    inertia = (w * (arm.real**2 + arm.imag**2)).sum(axis=1) + 1e-6
    angle = (w * (arm.conj() * u).imag).sum(axis=1) / inertia
    moved = (t[:, 0] + 1j * t[:, 1] - centre) * np.exp(1j * angle) + centre + shift
    return np.stack([moved.real, moved.imag, t[:, 2] + angle], axis=1)
