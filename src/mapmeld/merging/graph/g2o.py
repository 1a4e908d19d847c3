"""The graph as a ``.g2o`` file, the text format of g2o (Kümmerle et al. 2011) that GTSAM reads, too.

``VERTEX_SE2 i x y theta`` for every map, ``EDGE_SE2 i j x y theta`` and the upper triangle of the information
matrix for every match that is used, ``FIX i`` for the map in whose frame a component lies. Where poses
were known, one more vertex stands for their frame, and each known pose is an edge from it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mapmeld.io import printable
from mapmeld.merging.graph.edges import Edges, in_own_frames, row_of
from mapmeld.merging.graph.map_graph import MapGraph
from mapmeld.se2 import Pose2


def as_g2o(graph: MapGraph, names: Sequence[str]) -> str:
    """Return the text of a g2o file; the names of the maps stand in comments."""
    world = len(graph.poses)
    poses = [pose if T_w_i is None else T_w_i for pose, T_w_i in zip(graph.poses, graph.T_w_i, strict=True)]
    fixed = [first for first, *_ in graph.components if graph.T_w_i[first] is None]
    notes = [printable(f"# {i}: {name}") for i, name in enumerate(names)]
    if graph.known:
        poses.append(Pose2())
        fixed.append(world)
        notes.append(f"# {world}: the frame of the known poses")
    lines = [f"VERTEX_SE2 {i} {_numbers(row_of(pose))}" for i, pose in enumerate(poses)]
    edges = Edges.of(
        [
            *((world, i, known.T_w_i, known.covariance(), math.inf) for i, known in graph.known.items()),
            *(
                (pair.i, pair.j, pair.T_i_j, pair.covariance, 1.0)
                for pair in graph.pairs
                if pair.T_i_j is not None and pair.covariance is not None
            ),
        ]
    )
    information = np.linalg.inv(in_own_frames(edges))
    for i, j, z, matrix in zip(edges.i, edges.j, edges.z, information, strict=True):
        lines.append(f"EDGE_SE2 {i} {j} {_numbers(z)} {_numbers(matrix[np.triu_indices(3)])}")
    # At the end: GTSAM's reader does not look for edges behind anything but vertices.
    lines += [*(f"FIX {i}" for i in fixed), *notes]
    return "\n".join(lines) + "\n"


def _numbers(values: Sequence[float] | np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)
