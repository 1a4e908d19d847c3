"""The robust optimisation by GTSAM (extra ``gtsam``), in place of our own."""

from __future__ import annotations

from typing import Any

import numpy as np

from mapmeld.extras import required
from mapmeld.merging.graph.edges import Doubles, Edges, Flags, in_own_frames
from mapmeld.merging.graph.least_squares import frames_of, parts

_HELD = 1e-6  # [m, rad] deviation of what is held where it is


def graduated_by_gtsam(
    start: Doubles, edges: Edges, most: float, world: int | None = None
) -> tuple[Doubles, Flags]:
    """As `mapmeld.merging.graph.robust.graduated`, by GTSAM's optimiser of graduated non-convexity.

    Raises
    ------
    MissingExtraError
        GTSAM is not installed.
    """
    gtsam = required("gtsam", "gtsam")
    graph, values = factors(gtsam, start, edges, world)
    params = gtsam.GncLMParams()
    params.setLossType(gtsam.GncLossType.TLS)
    params.setKnownInliers([k for k in range(graph.size()) if k >= len(edges) or edges.given[k]])
    optimiser = gtsam.GncLMOptimizer(graph, values, params)
    optimiser.setInlierCostThresholds(most / 2)  # GTSAM halves squared distances
    found = optimiser.optimize()
    kept = np.asarray(optimiser.getWeights())[: len(edges)] > 0.5
    return poses_of(found, len(start)), np.asarray(kept | edges.given)


def factors(gtsam: Any, start: Doubles, edges: Edges, world: int | None = None) -> tuple[Any, Any]:
    """Return a factor graph, its edges first and in order, and the poses (n, 3) as initial values."""
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for node, row in enumerate(start):
        values.insert(node, gtsam.Pose2(*map(float, row)))
    for i, j, z, covariance in zip(edges.i, edges.j, edges.z, in_own_frames(edges), strict=True):
        noise = gtsam.noiseModel.Gaussian.Covariance(covariance)
        graph.add(gtsam.BetweenFactorPose2(int(i), int(j), gtsam.Pose2(*map(float, z)), noise))
    held = gtsam.noiseModel.Isotropic.Sigma(3, _HELD)
    for node in frames_of(parts(len(start), edges), world):
        graph.add(gtsam.PriorFactorPose2(int(node), values.atPose2(int(node)), held))
    return graph, values


def poses_of(values: Any, count: int) -> Doubles:
    """Return the poses (count, 3) in GTSAM's values."""
    poses = [values.atPose2(node) for node in range(count)]
    return np.array([[pose.x(), pose.y(), pose.theta()] for pose in poses])
