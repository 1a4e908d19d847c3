"""The last step of an answer: the rigid motion that fits a bent map best, and how exactly it is known."""

from __future__ import annotations

import math

import numpy as np

from mapmeld.matching.correlative.alignment import look_up, robust_weights, to_metric
from mapmeld.matching.correlative.bending import patch_shifts, patches_of
from mapmeld.matching.correlative.wall_map import Doubles, WallMap
from mapmeld.se2 import Pose2

_REACH = 0.3  # [m] walls further apart than this, once patches are shifted, do not belong together
_DAMPING = 0.002  # of all walls: what holds a direction that hardly any wall fixes
_LOST = (0.7, 0.09)  # [m], [rad] how far off such a direction may be: further off would be another mode
_FITS = 0.2  # [m] walls that stay further apart than this did not take part in the fit
COVARIANCE_FLOOR = (0.003, 0.0003)  # [m], [rad]: what cells leave in any case


def best_fit(pa: WallMap, pb: WallMap, t: Doubles, overlap: float, n: int = 1200) -> tuple[Doubles, Doubles]:
    """Fit all walls that belong together by least squares; return the transform and its covariance.

    Narrow tolerances lock onto one part of a map that bends. Here every part counts, as each patch is
    first shifted to where its walls meet. What the rigid motion then leaves over is the error.
    Neighbouring wall points share it: they are no independent samples, but patches of a few metres
    nearly are. So the covariance is that of a fit whose errors are common to each patch (the
    sandwich of Liang and Zeger 1986, with one size of error for all patches, as there are few), widened
    as that size is itself known from few patches only. Where the maps overlap wholly and their walls
    meet, all that there is was looked at, and nothing is left to chance: the error is lowered as when
    drawing from a finite population. On simulated maps this agrees with the errors (benchmarks/README.md).
    A direction that hardly any wall fixes stays where it was, as far off as a mode may be.

    It is the error of the best rigid motion. How far a place of a bent map lies from that is not in it.

    Parameters
    ----------
    pa, pb
        The maps.
    t
        (3,) takes b's local frame into a's, such that no part is much better off than the others.
    overlap
        Share of the smaller map that the other knows too.
    n
        Wall points of each map to use.

    Returns
    -------
    tuple
        The fitted transform (3,) between the local frames, and the covariance (3, 3) of (x, y, theta)
        [m, m, rad] of the transform between the metric frames.
    """
    rigid = look_up(pa, pb, t[None], n)
    patch, patches = patches_of(rigid.x)
    u = patch_shifts(rigid, patch, patches).take(patch)
    p = look_up(pa, pb, t[None], n, u)
    left, weights = robust_weights(p, _REACH)
    w, normal, at = weights[0].astype(np.float64), p.normal[0], p.x[0]
    mass = float(w.sum()) + 1e-6
    middle = complex(w @ at) / mass
    arm = at - np.complex64(middle)
    apart = left[0] - (u[0] * normal.conj()).real  # as the maps lie, for the walls that belong together
    J = np.stack([normal.real, normal.imag, (arm.conj() * normal).imag]).astype(np.float64)
    reach = math.sqrt(float(w @ (arm.real**2 + arm.imag**2)) / mass) + 1e-3  # of a turn [m per rad]
    damping = _DAMPING * mass * np.diag([1, 1, reach**2])
    inverse = np.linalg.inv((J * w) @ J.T + damping)
    step = -inverse @ ((J * w) @ apart)

    sums = np.array(
        [[np.bincount(patch[0], w * j * v, patches) for v in (normal.real, normal.imag)] for j in J]
    )
    of_patch = np.bincount(patch[0], w, patches)
    count = mass**2 / (float(of_patch @ of_patch) + 1e-6)  # of patches as large as the large ones
    # A patch has two numbers and the fit takes three in all. A variance known from 2 count - 3 of them makes
    # squared normalised errors (2 count - 3) / (2 count - 5) times as large on average.
    off = apart + step @ J
    squared = float(w @ off**2) / mass * count / max(count - 2.5, 0.5)
    took_part = float(w @ np.maximum(1 - (off / _FITS) ** 2, 0) ** 2) / mass
    squared *= 1 - min(overlap, 1.0) * took_part
    meat = squared * np.einsum("ivp,jvp->ij", sums, sums)
    meat += damping @ np.diag([_LOST[0] ** 2, _LOST[0] ** 2, _LOST[1] ** 2]) @ damping
    local = inverse @ meat @ inverse
    xy, theta = COVARIANCE_FLOOR
    local += np.diag([xy**2, xy**2, theta**2])

    moved = (complex(t[0], t[1]) - middle) * np.exp(1j * step[2]) + middle + complex(step[0], step[1])
    fitted = np.array([moved.real, moved.imag, t[2] + step[2]])
    return fitted, _of_origin(pa, pb, fitted, middle, local)


def _of_origin(pa: WallMap, pb: WallMap, t: Doubles, middle: complex, local: Doubles) -> Doubles:
    """Return the covariance of the metric transform, given that of a shift and a turn about `middle`."""
    # A turn about `middle` moves the transform's own origin along.
    T = to_metric(pa, pb, t)
    about = pa.frame.apply((middle.real, middle.imag))
    c, s = math.cos(pa.frame.theta), math.sin(pa.frame.theta)
    A = np.array([[c, -s, about[1] - T.y], [s, c, T.x - about[0]], [0.0, 0.0, 1.0]])
    return np.asarray(A @ local @ A.T)


def of_inverse(T_a_b: Pose2, covariance: Doubles) -> Doubles:
    """Return the covariance (3, 3) of T_b_a, given that of T_a_b (first order)."""
    c, s = math.cos(T_a_b.theta), math.sin(T_a_b.theta)
    inverse = T_a_b.inverse()
    J = np.array([[-c, -s, inverse.y], [s, -c, -inverse.x], [0.0, 0.0, -1.0]])
    return np.asarray(J @ covariance @ J.T)
