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
    """Displacement at x (m,) that bends b smoothly onto a.

    Real maps stretch and bend by drift. A displacement quadratic in x and y, held by springs, takes
    up what is smooth of it, so that what remains can be judged by a narrow tolerance.
    """
    p = look_up(pa, pb, t[None], _POINTS)
    _, w = robust_weights(p, 1.0)
    mass = float(w.sum()) + 1e-6
    centre = complex((w * p.x).sum()) / mass
    size = max(math.sqrt(float((w * np.abs(p.x - np.complex64(centre)) ** 2).sum()) / mass), 1.0)

    def basis(z: Plane) -> Floats:
        # Outside of what is matched the polynomial must not run away.
        i, j = (np.clip(v, -2, 2) for v in (((z - centre) / size).real, ((z - centre) / size).imag))
        return np.stack([np.ones_like(i), i, j, i * i, i * j, j * j]).astype(np.float32)

    at_points = basis(p.x[0])
    stiff = np.diag(np.tile([0.05, 1, 1, 1, 1, 1], 2)) * _SPRING
    turn = np.zeros(12)  # a small turn, (-y, x), is no bending
    turn[2], turn[7] = -math.sqrt(0.5), math.sqrt(0.5)
    stiff -= 0.95 * _SPRING * np.outer(turn, turn)
    c = np.zeros(12)
    for scale in _SCALES:
        r, w = robust_weights(p, scale)
        J = np.concatenate([p.normal.real * at_points, p.normal.imag * at_points])
        Jw = J * w
        c -= np.linalg.solve(
            (Jw @ J.T).astype(np.float64) + stiff, (Jw @ r[0]).astype(np.float64) + stiff @ c
        )
        u = ((c[:6] + 1j * c[6:]) @ at_points).astype(np.complex64)
        if scale != _SCALES[-1]:
            p = look_up(pa, pb, t[None], _POINTS, u)
    return np.asarray(((c[:6] + 1j * c[6:]) @ basis(x)).astype(np.complex64))


def patches_of(x: Plane) -> tuple[Index, int]:
    """Return the number of the PATCH x PATCH square that each point lies in, and how many there are."""
    col, row = np.floor(x.real / PATCH).astype(np.intp), np.floor(x.imag / PATCH).astype(np.intp)
    col -= col.min()
    row -= row.min()
    patch = row * (col.max() + 1) + col
    return patch, int(patch.max()) + 1


def patch_shifts(p: WallPairs, patch: Index, count: int) -> Plane:
    """Shift (count,) of each patch that brings its walls together, held by a spring."""
    r, w = (v[0] for v in robust_weights(p, 0.4))
    nx, ny = p.normal[0].real, p.normal[0].imag
    wx, wy = w * nx, w * ny
    xx, xy, yy, gx, gy = (
        np.asarray(np.bincount(patch, v, count), np.float64)
        for v in (wx * nx, wx * ny, wy * ny, wx * r, wy * r)
    )
    xx, yy = xx + PATCH_SPRING, yy + PATCH_SPRING
    det = xx * yy - xy * xy
    return np.asarray((-(yy * gx - xy * gy) / det - 1j * (xx * gy - xy * gx) / det).astype(np.complex64))


def nearest_rigid(t: Doubles, x: Plane, u: Plane, w: Floats) -> Doubles:
    """Least squares rigid motion for x -> x + u, weighted, after t."""
    total = float(w.sum()) + 1e-6
    centre, shift = complex(w @ x) / total, complex(w @ u) / total
    arm = x - np.complex64(centre)
    angle = float(w @ (arm.conj() * u).imag) / (float(w @ (arm.real**2 + arm.imag**2)) + 1e-6)
    moved = (complex(t[0], t[1]) - centre) * complex(math.cos(angle), math.sin(angle)) + centre + shift
    return np.array([moved.real, moved.imag, t[2] + angle])
