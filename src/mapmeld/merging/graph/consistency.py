"""Which measured transforms contradict one another, and which of them are then false.

What is looked for is the set of edges that contradict nothing in it and weigh most together (log odds of
being right): the most probable explanation. A cycle of right edges closes; one with a false edge
does not, but by itself it cannot tell which of its edges that is. So where another explanation is nearly
as probable, all that depends on the choice is left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mapmeld.merging.graph.cuts import min_cut, weakest_cuts
from mapmeld.merging.graph.edges import (
    Doubles,
    Edges,
    Flags,
    Index,
    composed,
    inverted,
    moves,
    seen_from,
    squared_distance,
)
from mapmeld.merging.graph.least_squares import Fit, errors, fit
from mapmeld.merging.graph.robust import Robust, graduated

FITS = 16.27
"""Squared Mahalanobis distance that one in a thousand right edges exceeds: chi squared, 3 numbers."""

LEAST_ODDS = math.log(0.85 / 0.15)
"""By how much in log odds an explanation must beat the next one: 85 in 100."""

_HELD = 1e3
"""Cut from which on a known pose is among its edges: all matches together count for less."""

ABSENT = math.log(4.0)
"""What it counts against two groups of maps lying where they were laid that a pair of them which then
overlaps by half or more did not match. Matching misses fewer than one in twenty of those, but
what makes it miss one may make it miss others."""

Overlooked = Callable[[Index, Index, Doubles], Flags]
"""Tells of nodes i (k,) and j (k,) at T_i_j (k, 3) which should have matched there and did not."""


@dataclass(frozen=True, slots=True, eq=False)
class Consistent:
    """Edges sorted out.

    Attributes
    ----------
    fit
        Poses of the edges that are used.
    used
        (m,) contradict nothing.
    doubted
        (m,) left out, though not shown to be false: something contradicts them about as strongly as
        anything speaks for them. All others that are not used are false.
    absent
        (m,) those of `doubted` against which speak pairs that should have matched and did not.
    """

    fit: Fit
    used: Flags
    doubted: Flags
    absent: Flags


def consistent(
    count: int,
    edges: Edges,
    world: int | None = None,
    overlooked: Overlooked | None = None,
    robust: Robust = graduated,
) -> Consistent:
    """Sort out which edges contradict one another.

    Starts from a spanning tree of the edges that most triangles confirm (after Zach, Klopschitz and
    Pollefeys, "Disambiguating Visual Relations Using Loop Constraints", 2010), lets go of what does not fit
    by graduated non-convexity, tests every edge against all others, and then exchanges groups of edges across
    minimum cuts for as long as that explains more.

    Parameters
    ----------
    count
        Number of nodes.
    edges
        At most one for each two nodes.
    world
        The node that is to be the frame of its part.
    overlooked
        Tells what else should have matched; None knows of nothing.
    """
    poses = spanning_poses(count, edges, confirmation(edges))
    used = robust(poses[0], edges, FITS, world)[1] if len(edges) else np.zeros(0, np.bool_)
    none = np.zeros(len(edges), np.bool_)
    found = _best(_tested(poses[0], edges, used, none, world), edges, world)
    doubted, absent = none, none
    while True:
        new = _undecided(found, edges)
        missed = _overlooked(found, edges, overlooked) if not new.any() else none
        if not (new | missed).any():
            return Consistent(found.fit, found.used, doubted, absent)
        doubted, absent = doubted | new | missed, absent | missed
        found = _tested(found.fit.poses, edges, found.used & ~doubted, doubted, world)


# ---------------------------------------------------------------------- the start
def confirmation(edges: Edges) -> Doubles:
    """Return per edge (m,) the weight of the triangles that close with it less that of those that do not.

    A triangle weighs as much as the weaker of its two other edges. An edge counts for itself, too.
    """
    m = len(edges)
    i, j = np.concatenate([edges.i, edges.j]), np.concatenate([edges.j, edges.i])
    z = np.concatenate([edges.z, inverted(edges.z)])
    # As motions seen from the edge's own node i; the same error seen from node j for the way back.
    there = moves(edges.z, edges.covariance)
    spread = np.concatenate([there, seen_from(inverted(edges.z), there)])
    out: dict[int, dict[int, int]] = {}
    for k, (a, b) in enumerate(zip(i.tolist(), j.tolist(), strict=True)):
        out.setdefault(a, {})[b] = k
    total = np.minimum(edges.weight, 1e3)
    for k in range(m):
        a, b = int(edges.i[k]), int(edges.j[k])
        through = out[a].keys() & out[b].keys()
        if not through:
            continue
        one = np.array([out[a][c] for c in through])
        two = np.array([out[c][b] for c in through])
        way = composed(z[one], z[two])
        error = errors(
            composed(way, np.repeat(inverted(edges.z[[k]]), len(one), axis=0)), np.zeros((len(one), 3))
        )
        sigma = spread[one] + seen_from(z[one], spread[two]) + spread[k]
        closes = squared_distance(error, sigma) <= FITS
        weight = np.minimum(edges.weight[one % m], edges.weight[two % m])
        total[k] += np.minimum(np.where(closes, weight, -weight), 1e3).sum()
    return np.where(edges.given, np.inf, total)


def spanning_poses(count: int, edges: Edges, order: Doubles) -> tuple[Doubles, Flags]:
    """Return poses (count, 3) along the spanning trees of the highest `order`, and their edges (m,)."""
    label = list(range(count))
    members = {node: [node] for node in range(count)}
    poses = np.zeros((count, 3))
    tree = np.zeros(len(edges), np.bool_)
    for k in np.argsort(-order, kind="stable"):
        i, j = int(edges.i[k]), int(edges.j[k])
        if label[i] == label[j]:
            continue
        tree[k] = True
        z = edges.z[k]
        if len(members[label[i]]) < len(members[label[j]]):
            i, j, z = j, i, inverted(z)
        group = members.pop(label[j])
        move = composed(composed(poses[i], z), inverted(poses[j]))
        poses[group] = composed(np.repeat(move[None], len(group), axis=0), poses[group])
        members[label[i]] += group
        for node in group:
            label[node] = label[i]
    return poses, tree


# ---------------------------------------------------------------------- testing
@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    fit: Fit
    used: Flags
    barred: Flags
    strain: Doubles

    def weight(self, edges: Edges) -> float:
        return float(np.minimum(edges.weight[self.used], 1e3).sum())


def _tested(start: Doubles, edges: Edges, used: Flags, barred: Flags, world: int | None) -> _Found:
    """Take out what the others contradict, put in what they do not, one edge at a time, the worst first."""
    used = used.copy()
    turns = np.zeros(len(edges), np.intp)
    while True:
        found = fit(_following(start, edges, used), edges[used], world)
        start = found.poses
        strain = found.strain(edges, used)
        worst = np.where(used & ~edges.given, strain, 0.0)
        if worst.max(initial=0.0) > FITS:
            # Of those that stand equally badly (a single cycle) the least probable.
            k = int(np.lexsort((edges.weight, -np.round(worst, 6)))[0])
            used[k] = False
        else:
            parted = found.labels[edges.i] != found.labels[edges.j]
            welcome = ~used & ~barred & (turns < 2) & (parted | (strain <= FITS))
            if not welcome.any():
                return _Found(found, used, barred, strain)
            k = int(np.argmax(np.where(welcome, edges.weight, -np.inf)))
            used[k] = True
        turns[k] += 1


def _following(poses: Doubles, edges: Edges, used: Flags) -> Doubles:
    """Return the poses with parts that an edge joins anew laid where it says."""
    kept = edges[used]
    off = squared_distance(errors(composed(inverted(poses[kept.i]), poses[kept.j]), kept.z), kept.covariance)
    return spanning_poses(len(poses), kept, -off)[0] if (off > 100 * FITS).any() else poses


# ---------------------------------------------------------------------- other explanations
def _best(found: _Found, edges: Edges, world: int | None) -> _Found:
    """Exchange edges that hold two sides together for such as contradict them while that explains more."""
    while True:
        for k, weight in _against(found, edges):
            value, side = _cut(found, edges, [int(edges.i[k])], [int(edges.j[k])])
            if weight <= value:
                continue
            kept = found.used & (side[edges.i] == side[edges.j])
            X = found.fit.poses
            D = composed(composed(X[edges.i[k]], edges.z[k]), inverted(X[edges.j[k]]))
            moved = X.copy()
            there = ~side & (found.fit.labels == found.fit.labels[edges.i[k]])
            moved[there] = composed(np.repeat(D[None], int(there.sum()), axis=0), X[there])
            kept[k] = True
            other = _tested(moved, edges, kept, found.barred, world)
            if other.weight(edges) > found.weight(edges) + 1e-9:
                found = other
                break
        else:
            return found


def _undecided(found: _Found, edges: Edges) -> Flags:
    """Return the edges (m,) on both sides of a contradiction that is not clearly decided."""
    doubted = np.zeros(len(edges), np.bool_)
    inside = found.used & ~edges.given
    for k, weight in _against(found, edges):
        i, j = int(edges.i[k]), int(edges.j[k])
        if _cut(found, edges, [i], [j])[0] - weight >= LEAST_ODDS:
            continue
        doubted[k] = True
        same = inside & (found.fit.labels[edges.i] == found.fit.labels[i])
        for e in np.flatnonzero(same):
            ends = int(edges.i[e]), int(edges.j[e])
            for one, two in (ends, ends[::-1]):
                # The least of all cuts between i and j that go through this edge.
                if one == j or two == i:
                    continue
                if _cut(found, edges, [i, one], [j, two])[0] - weight < LEAST_ODDS:
                    doubted[e] = True
    return doubted


def _against(found: _Found, edges: Edges) -> list[tuple[int, float]]:
    """Return every edge that contradicts the poses of its nodes, with the weight of all that say the same.

    Two say the same if the motion that would bring the ends of one together brings those of the other
    together, too. The weightiest come first.
    """
    labels = found.fit.labels
    out = np.flatnonzero(~found.used & ~found.barred & (labels[edges.i] == labels[edges.j]))
    if edges.given.any():
        # Between nodes that known poses hold nothing can be exchanged, so it speaks for nothing else either.
        held = [_cut(found, edges, [int(edges.i[k])], [int(edges.j[k])])[0] >= _HELD for k in out]
        out = out[~np.array(held, np.bool_)]
    if not len(out):
        return []
    X, z = found.fit.poses[edges.i[out]], edges.z[out]
    D = composed(composed(X, z), inverted(found.fit.poses[edges.j[out]]))
    spread = seen_from(X, moves(z, edges.covariance[out]))
    back, spread_back = inverted(D), seen_from(inverted(D), spread)
    weights = []
    for a in range(len(out)):
        total = 0.0
        for motion, its in ((D, spread), (back, spread_back)):
            gap = composed(motion, np.repeat(inverted(D[[a]]), len(out), axis=0))
            same = (labels[edges.i[out]] == labels[edges.i[out[a]]]) & (
                squared_distance(gap, its + spread[a]) <= FITS
            )
            if motion is back:
                same[a] = False
            total += float(np.minimum(edges.weight[out][same], 1e3).sum())
        weights.append(total)
    return sorted(zip(out.tolist(), weights, strict=True), key=lambda found: (-found[1], found[0]))


def _cut(found: _Found, edges: Edges, sources: list[int], sinks: list[int]) -> tuple[float, Flags]:
    used = edges[found.used]
    ends = np.unique(sources), np.unique(sinks)
    return min_cut(len(found.fit.poses), used.i, used.j, used.weight, *ends)


# ---------------------------------------------------------------------- what is missing
def _overlooked(found: _Found, edges: Edges, overlooked: Overlooked | None) -> Flags:
    """Return the edges (m,) of cuts against which more pairs that did not match speak than edges for them."""
    worst, doubted = LEAST_ODDS, np.zeros(len(edges), np.bool_)
    if overlooked is None:
        return doubted
    used, labels = edges[found.used], found.fit.labels
    measured = set(zip(edges.i.tolist(), edges.j.tolist(), strict=True))
    asked: dict[tuple[int, int], bool] = {}
    for value, side in weakest_cuts(len(labels), used.i, used.j, used.weight):
        across = found.used & (side[edges.i] != side[edges.j])
        part = labels == labels[edges.i[across][0]]
        pairs = [
            (int(min(a, b)), int(max(a, b)))
            for a in np.flatnonzero(part & side)
            for b in np.flatnonzero(part & ~side)
        ]
        pairs = [pair for pair in pairs if pair not in measured]
        if value - ABSENT * len(pairs) >= worst:
            continue
        new = [pair for pair in pairs if pair not in asked]
        if new:
            i, j = np.array(new).T
            asked |= dict(zip(new, overlooked(i, j, found.fit.relative(i, j)[0]).tolist(), strict=True))
        against = sum(asked[pair] for pair in pairs)
        # The most doubtful cut only: without it others may be none.
        if against and value - ABSENT * against < worst:
            worst, doubted = value - ABSENT * against, across & ~edges.given
    return doubted
