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
from mapmeld.merging.graph.least_squares import Fit, errors, fit, parts, residuals
from mapmeld.merging.graph.robust import Robust, graduated
from mapmeld.se2 import Pose2
from mapmeld.wording import probability_text

MUCH_OVERLAP = 0.3
"""Overlap from which two maps that lie right are expected to match."""

LIKELY = 0.05
"""Probability below which a mode of an ambiguous match does not count."""


LEAST_OVERLAP = 0.1
"""Overlap below which a match is not taken to be less exact still."""

PRIOR_CYCLES = 1
"""So many cycles that close as well as expected are imagined beside a component's own."""


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
    against_known
        Whether this accepted match is left out only because of known poses: among the matches alone
        nothing contradicts it.
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
    against_known: bool = False
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
    edges = Edges.of([*given, *(_edge(pairs[k], pairs[k].result.T_a_b, extents) for k in accepted)])
    overlooked = partial(_overlooked, maps, extents, {(pair.i, pair.j): pair.result for pair in pairs})
    found = consistent(world + 1, edges, world, overlooked, robust)

    without = found.used
    if given and not found.used.all():
        # What the matches alone would say tells whether known poses are what contradicts a match.
        alone = consistent(world, edges[~edges.given], None, overlooked, robust)
        without = np.concatenate([np.ones(len(given), np.bool_), alone.used])
    for k, e in zip(accepted, range(len(given), len(edges)), strict=True):
        pairs[k] = _judged(replace(pairs[k], against_known=bool(without[e] > found.used[e])), found, e, edges)
    pairs = [_settled(pair, found.fit, extents) for pair in pairs]
    pairs = _agreeing(pairs, Edges.of(given), extents, found.fit.poses, world)
    pairs, final = _fitted(pairs, Edges.of(given), extents, found.fit.poses, world)
    return _graph([_off(pair, final, extents) for pair in pairs], final, world, known or {})


def _edge(
    pair: PairMatch, T_i_j: Pose2 | None, extents: Sequence[Extent]
) -> tuple[int, int, Pose2, Doubles, float]:
    assert T_i_j is not None
    own, bend = _spread(pair, T_i_j, extents)
    return pair.i, pair.j, T_i_j, own + bend, log_odds(pair.result.probability)


def _is_accepted(result: MatchResult) -> bool:
    return result.verdict is Verdict.ACCEPTED and result.T_a_b is not None


def _spread(pair: PairMatch, T_i_j: Pose2, extents: Sequence[Extent]) -> tuple[Doubles, Doubles]:
    """Return the covariance of a mode of a match as the matcher has it, and what bending adds to it."""
    result, own = pair.result, np.zeros((3, 3))
    if result.covariance is not None and result.T_a_b is not None:
        own = result.covariance
        if T_i_j is not result.T_a_b:
            own = of_another_mode(result.T_a_b, own, T_i_j, extents[pair.j])
    return own, bending(T_i_j, extents[pair.i], extents[pair.j])


# ---------------------------------------------------------------------- what becomes of a match
def _judged(pair: PairMatch, found: Consistent, e: int, edges: Edges) -> PairMatch:
    sure = (
        ""
        if pair.result.probability is None
        else f", probability {probability_text(pair.result.probability)}"
    )
    if found.used[e]:
        rest = edges[found.used & (np.arange(len(edges)) != e)]
        labels = parts(len(found.fit.poses), rest)
        bridge = bool(labels[pair.i] != labels[pair.j])
        why = f"in no cycle: rests on this match alone{sure}" if bridge else "agrees with the others"
        return replace(pair, state=PairState.USED, why=why, T_i_j=pair.result.T_a_b, bridge=bridge)
    if found.absent[e]:
        why = "maps that would then overlap did not match"
        return replace(pair, state=PairState.DOUBTED, why=why)
    if found.doubted[e]:
        why = "contradicted by matches that are about as probable together; none of them is used"
        if pair.against_known:
            why = f"with the known poses as they are, {why}"
        return replace(pair, state=PairState.DOUBTED, why=why)
    them = "known poses" if pair.against_known else "other matches"
    return replace(pair, state=PairState.FALSE, why=f"contradicted by the {them}")


def _settled(pair: PairMatch, found: Fit, extents: Sequence[Extent]) -> PairMatch:
    """Settle an ambiguous match if exactly one of its modes fits what the graph says anyway."""
    result = pair.result
    if result.verdict is not Verdict.AMBIGUOUS or found.labels[pair.i] != found.labels[pair.j]:
        return pair
    T, spread = found.relative(np.array([pair.i]), np.array([pair.j]))
    fitting = [
        (number, mode)
        for number, mode in enumerate(_modes(result), start=1)
        if (mode.probability is None or mode.probability >= LIKELY)
        and _near(pair, mode.T_a_b, T, spread, extents)
    ]
    if len(fitting) != 1:
        return pair
    ((number, mode),) = fitting
    why = f"ambiguous; only {'its best mode' if number == 1 else f'its mode {number}'} fits the other matches"
    return replace(pair, state=PairState.SETTLED, why=why, T_i_j=mode.T_a_b)


def _agreeing(
    pairs: Sequence[PairMatch], given: Edges, extents: Sequence[Extent], start: Doubles, world: int
) -> list[PairMatch]:
    """Take back settled matches that contradict one another: each fits what is known without them."""
    pairs = list(pairs)
    while True:
        used = [k for k, pair in enumerate(pairs) if pair.T_i_j is not None]
        edges = _joined(given, Edges.of([_edge(pairs[k], pairs[k].T_i_j, extents) for k in used]))
        strain = fit(start, edges, world).strain(edges, np.ones(len(edges), np.bool_))[len(given) :]
        back = [
            k
            for k, strained in zip(used, strain, strict=True)
            if pairs[k].state is PairState.SETTLED and strained > FITS
        ]
        if not back:
            return pairs
        why = "ambiguous; the mode that fits contradicts that of other ambiguous matches"
        for k in back:
            pairs[k] = replace(pairs[k], state=PairState.UNUSED, why=why, T_i_j=None)


def _near(pair: PairMatch, mode: Pose2, T: Doubles, spread: Doubles, extents: Sequence[Extent]) -> bool:
    """Whether a mode is where the graph says (1, 3), as exactly (1, 3, 3) as that and the mode are known."""
    gap = errors(T, np.array([row_of(mode)]))
    return bool(squared_distance(gap, spread + sum(_spread(pair, mode, extents)))[0] <= FITS)


def _modes(result: MatchResult) -> list[Alternative]:
    best = [] if result.T_a_b is None else [Alternative(result.T_a_b, result.similarity, result.probability)]
    return [*best, *result.alternatives]


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
            near = _near(pair, mode.T_a_b, row[None], np.zeros((1, 3, 3)), extents)
            if near and mode.probability is not None and mode.probability >= least:
                return False
        return overlap_share(maps[a], maps[b], pose_of(row)) >= MUCH_OVERLAP

    return np.array([one(int(a), int(b), row) for a, b, row in zip(i, j, T_i_j, strict=True)], np.bool_)


# ---------------------------------------------------------------------- the outcome
def _fitted(
    pairs: Sequence[PairMatch], given: Edges, extents: Sequence[Extent], start: Doubles, world: int
) -> tuple[list[PairMatch], Fit]:
    """Fit the poses to all transforms that are used, with as much bending as these maps show.

    How well the cycles of a component close scales what bending is assumed to add (the variance of unit
    weight of least squares, a posteriori) from what it was taken to be for telling false matches.
    """
    used = [k for k, pair in enumerate(pairs) if pair.T_i_j is not None]
    modes = [(pairs[k], pairs[k].T_i_j) for k in used]
    own, bend = np.zeros((2, len(used), 3, 3))
    for n, (pair, T) in enumerate(modes):
        if T is not None:
            own[n], bend[n] = _spread(pair, T, extents)
            # From a small part of two bent maps it is a long way to the whole of them.
            bend[n] /= max(pair.result.overlap, LEAST_OVERLAP) ** 2
    edges = replace(Edges.of([_edge(pair, T, extents) for pair, T in modes]), covariance=own + bend)
    first = fit(start, _joined(given, edges), world)
    labels, count = first.labels[edges.i], len(first.frames)
    strain = squared_distance(residuals(first.poses, edges), edges.covariance)
    # Of the 3 numbers of a match so many are checked by others: 3 for each cycle, where no pose is known.
    fitted = first.relative(edges.i, edges.j)[1]
    redundancy = 3 - np.trace(np.linalg.solve(edges.covariance, fitted), axis1=1, axis2=2)
    scale = (PRIOR_CYCLES + np.bincount(labels, strain, count) / 3) / (
        PRIOR_CYCLES + np.bincount(labels, redundancy, count) / 3
    )
    edges = replace(edges, covariance=own + scale[labels][:, None, None] * bend)
    pairs = list(pairs)
    for k, covariance in zip(used, edges.covariance, strict=True):
        pairs[k] = replace(pairs[k], covariance=covariance)
    return pairs, fit(first.poses, _joined(given, edges), world)


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
