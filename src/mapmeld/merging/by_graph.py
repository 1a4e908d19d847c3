"""The default way to merge many maps: all pairs, a graph, its poses (`mapmeld.merging.graph`)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from mapmeld.grid import OccupancyGrid
from mapmeld.matching import Alternative, MatchResult, Verdict
from mapmeld.matching.correlative.covariance import of_inverse
from mapmeld.merging.aligned import MergeError
from mapmeld.merging.graph import KnownPose, MapGraph, PairMatch, PairState, match_all_pairs, solve
from mapmeld.merging.graph.robust import Robust, graduated
from mapmeld.merging.graph.with_gtsam import graduated_by_gtsam
from mapmeld.merging.result import Joint, Placement

SOLVERS: Mapping[str, Robust] = {"own": graduated, "gtsam": graduated_by_gtsam}


def map_graph(
    grids: Sequence[OccupancyGrid],
    *,
    method: str,
    parameters: object | None = None,
    known_poses: Mapping[int, KnownPose] | None = None,
    matching: bool = True,
    solver: str = "own",
    workers: int = 0,
    cluster: str | None = None,
    store: Path | None = None,
    candidates: int | None = None,
    on_pair: Callable[[], object] | None = None,
) -> MapGraph:
    """Match every pair and solve the graph; the parameters are those of `mapmeld.merge`.

    Raises
    ------
    MergeError
        A known pose is of no map, there is neither a known pose nor matching, or no such solver.
    """
    if solver not in SOLVERS:
        raise MergeError(f"unknown solver {solver!r}: choose from {', '.join(SOLVERS)}")
    if not matching and not known_poses:
        raise MergeError("without matching, poses must be known; give known poses")
    strangers = sorted(set(known_poses or ()) - set(range(len(grids))))
    if strangers:
        raise MergeError(f"known poses of maps that are not there: {', '.join(map(str, strangers))}")
    matches: tuple[tuple[int, int, MatchResult], ...] = ()
    if matching:
        matches = match_all_pairs(
            grids,
            method=method,
            parameters=parameters,
            workers=workers,
            cluster=cluster,
            store=store,
            candidates=candidates,
            on_pair=on_pair,
        )
    return solve(grids, matches, known_poses, SOLVERS[solver])


def placed_by_graph(
    grids: Sequence[OccupancyGrid],
    *,
    method: str,
    parameters: object | None,
    known_poses: Mapping[int, KnownPose] | None,
    matching: bool,
    solver: str,
    workers: int,
    cluster: str | None,
    store: Path | None,
    candidates: int | None,
    on_pair: Callable[[], object] | None,
) -> Placement:
    """Place maps as the graph says; the parameters are those of `mapmeld.merge`."""
    graph = map_graph(
        grids,
        method=method,
        parameters=parameters,
        known_poses=known_poses,
        matching=matching,
        solver=solver,
        workers=workers,
        cluster=cluster,
        store=store,
        candidates=candidates,
        on_pair=on_pair,
    )
    first = set(graph.components[0])
    return Placement(
        poses=tuple(T if i in first else None for i, T in enumerate(graph.poses)),
        components=graph.components,
        joints=tuple(joint for members in graph.components for joint in _joints(graph, members)),
        refused={i: _refusal(graph, first, i) for i in range(len(grids)) if i not in first},
        covariances=tuple(C if i in first else None for i, C in enumerate(graph.covariances)),
        pairs=graph.pairs,
    )


def _joints(graph: MapGraph, members: Sequence[int]) -> Iterator[Joint]:
    """Give the surest matches that hold a component together, from its first map outwards."""
    used = [pair for pair in graph.pairs if pair.state is PairState.USED]
    joined = {members[0]}
    while True:
        edge = [pair for pair in used if (pair.i in joined) != (pair.j in joined)]
        if not edge:
            return
        pair = max(edge, key=_surety)
        reference, index = (pair.i, pair.j) if pair.i in joined else (pair.j, pair.i)
        result = pair.result if reference == pair.i else seen_from_b(pair.result)
        yield Joint((reference,), index, result)
        joined.add(index)


def _refusal(graph: MapGraph, first: set[int], index: int) -> MatchResult:
    pairs = [p for p in graph.pairs if (p.i == index and p.j in first) or (p.j == index and p.i in first)]
    if not pairs:
        return MatchResult(None, Verdict.REJECTED, "not matched, and its pose is not known")
    pair = max(pairs, key=lambda pair: (pair.state is not PairState.UNUSED, *_surety(pair)))
    result = pair.result if pair.j == index else seen_from_b(pair.result)
    if pair.state is PairState.UNUSED:
        return result
    verdict = Verdict.REJECTED if pair.state is PairState.FALSE else Verdict.AMBIGUOUS
    return replace(result, verdict=verdict, reason=f"{result.reason}; but {pair.why}")


def _surety(pair: PairMatch) -> tuple[float, float]:
    return pair.result.probability or 0.0, pair.result.similarity


def seen_from_b(result: MatchResult) -> MatchResult:
    """Return the answer for maps (a, b) as that for (b, a)."""
    T, covariance = result.T_a_b, result.covariance
    return replace(
        result,
        T_a_b=None if T is None else T.inverse(),
        covariance=None if T is None or covariance is None else of_inverse(T, covariance),
        alternatives=tuple(
            Alternative(other.T_a_b.inverse(), other.similarity, other.probability)
            for other in result.alternatives
        ),
    )
