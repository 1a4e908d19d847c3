"""Poses from measured transforms: sparse least squares on SE(2), and how exact its answer is.

Gauss-Newton with Levenberg's and Marquardt's damping on the numbers (x, y, theta) of every pose; the errors
are the differences of measured and resulting T_i_j in the same three numbers, so that covariances mean what
they mean in `mapmeld.MatchResult`. The graph of poses is that of Lu and Milios, "Globally consistent range
scan alignment for environment mapping" (1997).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from mapmeld.merging.graph.edges import Doubles, Edges, Flags, Index, composed, inverted, wrapped

_STEPS = 50
_ENOUGH = 1e-10  # [m, rad] steps below this change nothing


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """Poses of n nodes that fit measured transforms best.

    Attributes
    ----------
    poses
        (n, 3), each in the frame of its part's first node (`labels`, `frames`).
    covariance
        (3 n, 3 n) of the poses, in their order; between nodes of different parts it is 0.
    labels
        (n,) number of the connected part to which a node belongs, counted by its first node.
    frames
        Per part the node whose pose is the identity.
    """

    poses: Doubles
    covariance: Doubles
    labels: Index
    frames: Index

    def relative(self, i: Index, j: Index) -> tuple[Doubles, Doubles]:
        """Return T_i_j (m, 3) and its covariance (m, 3, 3) for nodes (m,) of the same parts."""
        T, J = _relative(self.poses, i, j)
        return T, J @ self._joint(i, j) @ J.transpose(0, 2, 1)

    def strain(self, edges: Edges, used: Flags) -> Doubles:
        """Return how far each edge (m,) is from what the *other* edges say: squared Mahalanobis distances.

        For an edge that was used, the others are all but itself: the statistic of Baarda's data snooping
        ("A testing procedure for use in geodetic networks", 1968). 0 where the others say nothing.
        """
        same = self.labels[edges.i] == self.labels[edges.j]
        strain = np.zeros(len(edges))
        T, spread = self.relative(edges.i[same], edges.j[same])
        r = errors(T, edges.z[same])
        own, inside = edges.covariance[same], used[same]
        S = np.where(inside[:, None, None], own - spread, own + spread)
        # An edge that alone holds two parts together leaves no error at all, and so no spread of errors.
        share = np.linalg.eigvals(np.linalg.solve(own, S)).real.min(axis=1) if len(S) else np.zeros(0)
        tested = share > 1e-6
        inner = np.zeros(len(S))
        inner[tested] = (r[tested] * np.linalg.solve(S[tested], r[tested][..., None])[..., 0]).sum(axis=1)
        strain[same] = inner
        return strain

    def _joint(self, i: Index, j: Index) -> Doubles:
        at = np.concatenate([3 * i[:, None] + np.arange(3), 3 * j[:, None] + np.arange(3)], axis=1)
        return np.asarray(self.covariance[at[:, :, None], at[:, None, :]])


def parts(count: int, edges: Edges) -> Index:
    """Return the number of the connected part of each of `count` nodes, counted by their first nodes."""
    links = sparse.coo_array((np.ones(len(edges)), (edges.i, edges.j)), (count, count))
    labels = connected_components(links, directed=False)[1]
    _, first = np.unique(labels, return_index=True)
    rank = np.empty(len(first), np.intp)
    rank[np.argsort(first)] = np.arange(len(first))
    return np.asarray(rank[labels], np.intp)


def frames_of(labels: Index, world: int | None) -> Index:
    """Return the node of each part in whose frame its poses are: `world` if it is there, else the first."""
    frames = np.unique(labels, return_index=True)[1].astype(np.intp)
    if world is not None:
        frames[labels[world]] = world
    return frames


def fit(start: Doubles, edges: Edges, world: int | None = None) -> Fit:
    """Fit poses to edges, from poses near enough to lead there.

    Parameters
    ----------
    start
        (n, 3) in any frame, one for each connected part.
    edges
        All are taken at their word.
    world
        The node that is to be the frame of its part.
    """
    labels = parts(len(start), edges)
    frames = frames_of(labels, world)
    poses = optimised(_in_frames(start, labels, frames), edges, frames)
    return Fit(poses, _covariance(poses, edges, frames), labels, frames)


def optimised(
    start: Doubles, edges: Edges, frames: Index, weights: Doubles | None = None, steps: int = _STEPS
) -> Doubles:
    """Return the poses (n, 3) with the least weighted squared errors, those of `frames` kept as they are."""
    free = np.setdiff1d(np.arange(len(start)), frames)
    if not len(free) or not len(edges):
        return start
    w = np.ones(len(edges)) if weights is None else weights
    whiten = (
        np.linalg.cholesky(np.linalg.inv(edges.covariance)).transpose(0, 2, 1) * np.sqrt(w)[:, None, None]
    )
    poses, damping = start, 0.0
    r, J = _whitened(poses, edges, whiten, free)
    cost = float(r @ r)
    for _ in range(steps):
        H = (J.T @ J).tocsc()
        # What no edge holds any more (all its weights are 0) stays where it is.
        diagonal = H.diagonal()
        H = H + sparse.diags_array(damping * diagonal + 1e-9, format="csc")
        step = -splu(H, permc_spec="MMD_AT_PLUS_A").solve(J.T @ r)
        moved = poses.copy()
        moved[free] += step.reshape(-1, 3)
        moved[:, 2] = wrapped(moved[:, 2])
        r_new, J_new = _whitened(moved, edges, whiten, free)
        new = float(r_new @ r_new)
        if new <= cost:
            poses, r, J, cost, damping = moved, r_new, J_new, new, damping / 10 if damping > 1e-6 else 0.0
        else:
            damping = max(10 * damping, 1e-4)
        if np.abs(step).max() < _ENOUGH or damping > 1e8:
            break
    return poses


def errors(T: Doubles, z: Doubles) -> Doubles:
    """Return T - z (m, 3), the angles by the shorter way."""
    r = T - z
    r[..., 2] = wrapped(r[..., 2])
    return np.asarray(r)


def residuals(poses: Doubles, edges: Edges) -> Doubles:
    """Return by how much (m, 3) the poses contradict each edge."""
    return errors(_relative(poses, edges.i, edges.j)[0], edges.z)


def _relative(poses: Doubles, i: Index, j: Index) -> tuple[Doubles, Doubles]:
    """Return T_i_j (m, 3) and its derivative (m, 3, 6) by the two poses."""
    one, two = poses[i], poses[j]
    c, s = np.cos(one[:, 2]), np.sin(one[:, 2])
    dx, dy = two[:, 0] - one[:, 0], two[:, 1] - one[:, 1]
    x, y = c * dx + s * dy, c * dy - s * dx
    J = np.zeros((len(one), 3, 6))
    J[:, 0, 0] = J[:, 1, 1] = -c
    J[:, 0, 1], J[:, 1, 0] = -s, s
    J[:, 0, 2], J[:, 1, 2] = y, -x
    J[:, :2, 3:5] = -J[:, :2, :2]
    J[:, 2, 2], J[:, 2, 5] = -1, 1
    return np.stack([x, y, wrapped(two[:, 2] - one[:, 2])], axis=1), J


def _whitened(poses: Doubles, edges: Edges, whiten: Doubles, free: Index) -> tuple[Doubles, sparse.csr_array]:
    """Return the errors (3 m,) in units of their deviations and their sparse derivative by the free poses."""
    T, J = _relative(poses, edges.i, edges.j)
    r = (whiten @ errors(T, edges.z)[..., None])[..., 0]
    J = whiten @ J
    column = np.full(len(poses), -1)
    column[free] = np.arange(len(free))
    nodes = np.stack([column[edges.i], column[edges.j]], axis=1)
    cols = np.repeat(3 * nodes, 3, axis=1) + np.tile(np.arange(3), 2)
    cols = np.broadcast_to(cols[:, None], J.shape)
    rows = np.broadcast_to(np.arange(3 * len(edges)).reshape(-1, 3, 1), J.shape)
    there = np.broadcast_to((np.repeat(nodes, 3, axis=1) >= 0)[:, None], J.shape)
    shape = (3 * len(edges), 3 * len(free))
    return r.ravel(), sparse.csr_array((J[there], (rows[there], cols[there])), shape)


def _covariance(poses: Doubles, edges: Edges, frames: Index) -> Doubles:
    free = np.setdiff1d(np.arange(len(poses)), frames)
    covariance = np.zeros((3 * len(poses), 3 * len(poses)))
    if len(free):
        whiten = np.linalg.cholesky(np.linalg.inv(edges.covariance)).transpose(0, 2, 1)
        J = _whitened(poses, edges, whiten, free)[1]
        at = (3 * free[:, None] + np.arange(3)).ravel()
        found = splu((J.T @ J).tocsc(), permc_spec="MMD_AT_PLUS_A").solve(np.eye(len(at)))
        covariance[np.ix_(at, at)] = (found + found.T) / 2
    return covariance


def _in_frames(poses: Doubles, labels: Index, frames: Index) -> Doubles:
    moved = composed(inverted(poses[frames][labels]), poses)
    moved[frames] = 0.0
    return moved
