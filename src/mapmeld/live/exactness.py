"""How exactly robots lie in the world: covariances of poses in a frame of one's choice."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mapmeld.merging.graph import MapGraph
from mapmeld.merging.graph.edges import Edges, row_of
from mapmeld.merging.graph.least_squares import fit
from mapmeld.se2 import Pose2

Doubles = NDArray[np.float64]


def covariances_from(graph: MapGraph, origin: int | None) -> tuple[Doubles, ...]:
    """Return per map (3, 3) of (x, y, theta) of its pose in the frame of map `origin` [m, m, rad].

    They follow from the graph's own edges, linearised where it has put the maps; those of `MapGraph` are in
    the frame of each component's first map. What is not connected with the origin keeps its own frame.

    Parameters
    ----------
    graph
        As it was solved.
    origin
        Index of a map, whose own covariance is zeros; None: the frame in which poses are known.
    """
    world = len(graph.poses)
    given = [(world, i, pose.T_w_i, pose.covariance(), math.inf) for i, pose in sorted(graph.known.items())]
    used = [
        (pair.i, pair.j, pair.T_i_j, pair.covariance, 0.0)
        for pair in graph.pairs
        if pair.T_i_j is not None and pair.covariance is not None
    ]
    poses = [T if inside is None else inside for T, inside in zip(graph.poses, graph.T_w_i, strict=True)]
    start = np.array([row_of(T) for T in (*poses, Pose2())])
    found = fit(start, Edges.of([*given, *used]), world if origin is None else origin).covariance
    return tuple(found[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] for i in range(world))


def turned(covariance: Doubles, theta: float) -> Doubles:
    """Return the covariance (3, 3) of a pose's (x, y, theta) in a frame in which its own is turned [rad]."""
    c, s = math.cos(theta), math.sin(theta)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(R @ covariance @ R.T)
