"""Many maps, matched pair by pair: which matches are false, and where every map lies.

`solve` is the page: known poses and accepted matches become edges, the contradictory ones are sorted
out, ambiguous ones settled by what is left, and the poses fitted.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial

import numpy as np

from mapmeld.grid import OccupancyGrid, overlap_share
from mapmeld.matching import Alternative, MatchResult, Verdict
from mapmeld.merging.graph.consistency import FITS, Consistent, consistent
from mapmeld.merging.graph.edges import (
    Doubles,
    Edges,
    Extent,
    Flags,
    Index,
    bending,
    log_odds,
    of_another_mode,
    pose_of,
    row_of,
    squared_distance,
)
from mapmeld.merging.graph.known_poses import KnownPose
from mapmeld.merging.graph.least_squares import Fit, errors, fit, parts
from mapmeld.merging.graph.robust import Robust, graduated
from mapmeld.se2 import Pose2

MUCH_OVERLAP = 0.3
"""Overlap from which two maps that lie right are expected to match."""

LIKELY = 0.05
"""Probability below which a mode of an ambiguous match does not count."""


class PairState(StrEnum):
    """What the graph makes of a match."""

    USED = "used"
    SETTLED = "settled"
    FALSE = "false"
    DOUBTED = "doubted"
    UNUSED = "unused"


@dataclass(frozen=True, slots=True)
class PairMatch:
    """Two maps, how they were matched, and what the graph makes of it.

    Attributes
    ----------
    i, j
        Indices of the maps, i < j.
    result
        The match: ``T_a_b`` with a = map i and b = map j.
    state
        "used": accepted, and nothing contradicts it. "settled": ambiguous, and of its modes exactly
        one fits what the other matches say. "false": accepted, and contradicted by what is
        clearly more probable. "doubted": accepted, and contradicted by what is about as probable;
        left out. "unused": not accepted.
    why
        The state in words.
    T_i_j
        The transform that is used; None if none is.
    covariance
        (3, 3) of (x, y, theta) of T_i_j [m, m, rad] as the graph takes it: the match's own and what the
        bending of the two maps adds.
    bridge
        Whether this used match alone holds two groups of maps together: no cycle checks it,
        it rests on its own probability.
    off
        How far [m, rad] the match is from the poses of the graph, at the middle of map j; None where
        the graph does not relate the two maps, or the match has no transform.
    """

    i: int
    j: int
    result: MatchResult
    state: PairState = PairState.UNUSED
    why: str = ""
    T_i_j: Pose2 | None = None
    covariance: Doubles | None = None
    bridge: bool = False
    off: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class MapGraph:
    """Where maps lie, by all that is known of pairs of them.

    Attributes
    ----------
    pairs
        Every match, in the order in which they were given.
    components
        Which maps belong together, as indices in order, counted by their first maps.
    poses
        Per map ``T_c_i``: takes its frame into that of the first map of its component.
    covariances
        Per map (3, 3) of (x, y, theta) of ``T_c_i``, bending of the maps included; zeros for the first.
    T_w_i
        Per map its pose in the frame in which poses were known; None where that is not connected.
    known
        The poses that were given, by the maps' indices.
    """

    pairs: tuple[PairMatch, ...]
    components: tuple[tuple[int, ...], ...]
    poses: tuple[Pose2, ...]
    covariances: tuple[Doubles, ...]
    T_w_i: tuple[Pose2 | None, ...]
    known: Mapping[int, KnownPose]


def solve(
    maps: Sequence[OccupancyGrid],
    matches: Iterable[tuple[int, int, MatchResult]],
    known: Mapping[int, KnownPose] | None = None,
    robust: Robust = graduated,
) -> MapGraph:
    """Find the poses of maps from matches of pairs of them.

    Only accepted matches and known poses ever connect two maps.

    Parameters
    ----------
    maps
        n maps.
    matches
        (i, j, result) with i < j and ``T_a_b`` = T_i_j, at most one for each pair.
    known
        By the map's index: its frame's pose in a common frame, which then counts as given.
    robust
        `mapmeld.merging.graph.robust.graduated`, or that of `with_gtsam`.
    """
    pairs = [PairMatch(i, j, result) for i, j, result in matches]
    extents = [Extent.of(grid) for grid in maps]
    world = len(maps)
    given = [(world, i, pose.T_w_i, pose.covariance(), math.inf) for i, pose in sorted((known or {}).items())]
    accepted = [k for k, pair in enumerate(pairs) if _is_accepted(pair.result)]
    rows = [(pairs[k].i, pairs[k].j, *_measured(pairs[k], extents)) for k in accepted]
    edges = Edges.of([*given, *rows])
    overlooked = partial(_overlooked, maps, extents, {(pair.i, pair.j): pair.result for pair in pairs})
    found = consistent(world + 1, edges, world, overlooked, robust)

    for k, e in zip(accepted, range(len(given), len(edges)), strict=True):
        pairs[k] = _judged(pairs[k], found, e, edges)
    settled = [_settled(pair, found.fit, extents) for pair in pairs]
    extra = [(pair.i, pair.j, *row) for pair, row in zip(pairs, settled, strict=True) if row is not None]
    final = found.fit
    if extra:
        pairs = [_with_mode(pair, row) for pair, row in zip(pairs, settled, strict=True)]
        final = fit(final.poses, _joined(edges[found.used], Edges.of(extra)), world)
    return _graph([_off(pair, final, extents) for pair in pairs], final, world, known or {})


def _is_accepted(result: MatchResult) -> bool:
    return result.verdict is Verdict.ACCEPTED and result.T_a_b is not None


def _measured(pair: PairMatch, extents: Sequence[Extent]) -> tuple[Pose2, Doubles, float]:
    T, result = pair.result.T_a_b, pair.result
    assert T is not None
    covariance = bending(T, extents[pair.i], extents[pair.j])
    if result.covariance is not None:
        covariance = covariance + result.covariance
    return T, covariance, log_odds(result.probability)


# ---------------------------------------------------------------------- what becomes of a match
def _judged(pair: PairMatch, found: Consistent, e: int, edges: Edges) -> PairMatch:
    sure = "" if pair.result.probability is None else f", probability {pair.result.probability:.3f}"
    if found.used[e]:
        rest = edges[found.used & (np.arange(len(edges)) != e)]
        labels = parts(len(found.fit.poses), rest)
        bridge = bool(labels[pair.i] != labels[pair.j])
        why = f"in no cycle: rests on this match alone{sure}" if bridge else "agrees with the others"
        T, covariance = pair.result.T_a_b, edges.covariance[e]
        return replace(pair, state=PairState.USED, why=why, T_i_j=T, covariance=covariance, bridge=bridge)
    if found.absent[e]:
        why = "maps that would then overlap did not match"
        return replace(pair, state=PairState.DOUBTED, why=why)
    if found.doubted[e]:
        why = "contradicted by matches that are about as probable together; none of them is used"
        return replace(pair, state=PairState.DOUBTED, why=why)
    return replace(pair, state=PairState.FALSE, why="contradicted by the other matches")


def _settled(pair: PairMatch, found: Fit, extents: Sequence[Extent]) -> tuple[Pose2, Doubles, float] | None:
    """Return the one mode of an ambiguous match that fits what the graph says anyway, as an edge's row."""
    result = pair.result
    if result.verdict is not Verdict.AMBIGUOUS or found.labels[pair.i] != found.labels[pair.j]:
        return None
    i, j = np.array([pair.i]), np.array([pair.j])
    T, spread = found.relative(i, j)
    fitting = []
    for mode in _modes(result):
        if mode.probability is not None and mode.probability < LIKELY:
            continue
        covariance = _of_mode(pair, mode.T_a_b, extents)
        r = errors(T, np.array([row_of(mode.T_a_b)]))
        if squared_distance(r, spread + covariance)[0] <= FITS:
            fitting.append((mode.T_a_b, covariance, log_odds(mode.probability)))
    return fitting[0] if len(fitting) == 1 else None


def _of_mode(pair: PairMatch, T: Pose2, extents: Sequence[Extent]) -> Doubles:
    result, b = pair.result, extents[pair.j]
    covariance = bending(T, extents[pair.i], b)
    if result.covariance is not None and result.T_a_b is not None:
        covariance = covariance + of_another_mode(result.T_a_b, result.covariance, T, b)
    return covariance


def _modes(result: MatchResult) -> list[Alternative]:
    best = [] if result.T_a_b is None else [Alternative(result.T_a_b, result.similarity, result.probability)]
    return [*best, *result.alternatives]


def _with_mode(pair: PairMatch, row: tuple[Pose2, Doubles, float] | None) -> PairMatch:
    if row is None:
        return pair
    number = [mode.T_a_b for mode in _modes(pair.result)].index(row[0])
    which = "its best mode" if number == 0 else f"its mode {number + 1}"
    why = f"ambiguous; only {which} fits the other matches"
    return replace(pair, state=PairState.SETTLED, why=why, T_i_j=row[0], covariance=row[1])


def _overlooked(
    maps: Sequence[OccupancyGrid],
    extents: Sequence[Extent],
    results: Mapping[tuple[int, int], MatchResult],
    i: Index,
    j: Index,
    T_i_j: Doubles,
) -> Flags:
    """Tell which pairs overlap much where they lie, though by their match they hardly lie there."""

    def one(a: int, b: int, row: Doubles) -> bool:
        result = results.get((a, b))
        # Only a calibrated method is known to miss little.
        if result is None or result.probability is None or result.T_a_b is None:
            return False
        least = LIKELY if result.verdict is Verdict.AMBIGUOUS else 0.5
        pair = PairMatch(a, b, result)
        for mode in _modes(result):
            gap = errors(row[None], np.array([row_of(mode.T_a_b)]))
            near = squared_distance(gap, _of_mode(pair, mode.T_a_b, extents)[None])[0] <= FITS
            if near and mode.probability is not None and mode.probability >= least:
                return False
        return overlap_share(maps[a], maps[b], pose_of(row)) >= MUCH_OVERLAP

    return np.array([one(int(a), int(b), row) for a, b, row in zip(i, j, T_i_j, strict=True)], np.bool_)


# ---------------------------------------------------------------------- the outcome
def _graph(pairs: Sequence[PairMatch], final: Fit, world: int, known: Mapping[int, KnownPose]) -> MapGraph:
    labels = final.labels[:world]
    groups = [np.flatnonzero(labels == label) for label in dict.fromkeys(labels.tolist())]
    poses, covariances = np.zeros((world, 3)), np.zeros((world, 3, 3))
    for group in groups:
        poses[group], covariances[group] = final.relative(np.repeat(group[:1], len(group)), group)
        poses[group[0]], covariances[group[0]] = 0.0, 0.0
    in_world = (labels == final.labels[world]).tolist()
    return MapGraph(
        tuple(pairs),
        tuple(tuple(group.tolist()) for group in groups),
        tuple(pose_of(row) for row in poses),
        tuple(covariances),
        tuple(pose_of(final.poses[i]) if inside else None for i, inside in enumerate(in_world)),
        dict(known),
    )


def _off(pair: PairMatch, final: Fit, extents: Sequence[Extent]) -> PairMatch:
    T = pair.T_i_j or pair.result.T_a_b
    if T is None or final.labels[pair.i] != final.labels[pair.j]:
        return pair
    at = (extents[pair.j].x, extents[pair.j].y)
    fitted = pose_of(final.relative(np.array([pair.i]), np.array([pair.j]))[0][0])
    metres = float(np.hypot(*(fitted.apply(at) - T.apply(at))))
    return replace(pair, off=(metres, fitted.distance_to(T)[1]))


def _joined(one: Edges, two: Edges) -> Edges:
    return Edges(
        *(np.concatenate([getattr(e, name) for e in (one, two)]) for name in Edges.__dataclass_fields__)
    )
