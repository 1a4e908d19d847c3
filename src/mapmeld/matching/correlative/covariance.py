"""How exactly a transform is known."""

from __future__ import annotations

import math

import numpy as np

from mapmeld.matching.correlative.alignment import look_up, robust_weights, to_metric
from mapmeld.matching.correlative.bending import PATCH_SPRING, patches_of
from mapmeld.matching.correlative.wall_map import Doubles, WallMap
from mapmeld.se2 import Pose2

_REACH = 0.3  # [m] walls further apart than this do not belong together
BEND_SHARE = 0.45  # of the squared bending that shows as error of a patch; from simulated maps
COVARIANCE_FLOOR = (0.003, 0.0003)  # [m], [rad]: what cells leave in any case


def transform_covariance(pa: WallMap, pb: WallMap, t: Doubles, bend: float, n: int = 1200) -> Doubles:
    """Return the covariance (3, 3) of (x, y, theta) [m, m, rad] of a transform between the metric frames.

    Neighbouring wall points share the maps' distortion: points are no independent samples, but
    patches nearly are. So every patch counts as one sample of its walls' mean information, whose
    spread is what the bending had to take up.

    Parameters
    ----------
    t
        (3,) takes b's local frame into a's.
    bend
        Rms displacement [m] that bends b onto a.
    """
    p = look_up(pa, pb, t[None], n)
    _, weights = robust_weights(p, _REACH)
    w, x, normal = weights[0], p.x[0], p.normal[0]
    middle = complex(w @ x) / (float(w.sum()) + 1e-6)
    arm = x - np.complex64(middle)
    J = np.stack([normal.real, normal.imag, (arm.conj() * normal).imag]).astype(np.float64)
    patches, count = patches_of(p.x)
    mass = np.bincount(patches[0], w, count)
    information = (J * (w / (mass[patches[0]] + PATCH_SPRING))) @ J.T + np.diag([0.01, 0.01, 0.1])
    local = BEND_SHARE * bend**2 * np.linalg.inv(information)
    xy, theta = COVARIANCE_FLOOR
    local += np.diag([xy**2, xy**2, theta**2])
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
