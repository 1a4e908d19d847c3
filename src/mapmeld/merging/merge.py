"""Merging maps whose poses are not known: match, then merge what fits."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Literal

from mapmeld.grid import OccupancyGrid
from mapmeld.io import load
from mapmeld.matching import DEFAULT_METHOD
from mapmeld.merging.aligned import MergeError, merge_aligned
from mapmeld.merging.by_graph import placed_by_graph
from mapmeld.merging.fusion import check_fusion
from mapmeld.merging.graph import KnownPose
from mapmeld.merging.result import MergeResult, Placement
from mapmeld.merging.sequential import placed_one_by_one
from mapmeld.se2 import Pose2

STRATEGIES = ("graph", "sequential")


def merge(
    maps: Sequence[OccupancyGrid | str | os.PathLike[str]],
    *,
    method: str = DEFAULT_METHOD,
    parameters: object | None = None,
    fusion: str = "colour",
    starts: Sequence[Pose2] | None = None,
    strategy: Literal["graph", "sequential"] = "graph",
    known_poses: Mapping[int, KnownPose] | None = None,
    matching: bool = True,
    solver: Literal["own", "gtsam"] = "own",
    workers: int = 0,
    cluster: str | None = None,
    store: str | os.PathLike[str] | None = None,
    candidates: int | None = None,
    on_pair: Callable[[], object] | None = None,
) -> MergeResult:
    """Match maps and merge those that fit.

    Parameters
    ----------
    maps
        Two or more maps or paths of maps; the first gives the frame and the lattice.
    method, parameters
        As for `mapmeld.match`.
    fusion
        A rule of `mapmeld.merging.fusion.FUSIONS`.
    starts
        Start pose of each robot in its own map's frame; a SLAM map's frame usually starts
        there, so the default is the identity.
    strategy
        "graph": every map is matched with every other, matches that contradict the others are found, and
        the poses fitted to the rest (docs/graph.md). "sequential": the paper's way (section 4), each map
        on all that was merged before it; takes none of the settings below.
    known_poses
        By index: where a map's frame lies in a frame that all of these share. Counts as given.
    matching
        False places maps by `known_poses` alone.
    solver
        Of the robust optimisation: our own, or GTSAM's (extra ``gtsam``).
    workers, cluster, store, candidates, on_pair
        As for `mapmeld.merging.graph.match_all_pairs`.

    Raises
    ------
    MergeError
        Fewer than one map, `starts` of another length, settings that contradict one another, or a merged
        map beyond all size.
    MapFileError
        A map could not be read.
    UnknownMethodError, UnknownFusionError
        No such method or rule.
    StoreError, WorkerDiedError, ClusterError, MissingExtraError
        As for `mapmeld.merging.graph.match_all_pairs`.
    """
    if isinstance(maps, str | os.PathLike):
        raise MergeError(f"{os.fspath(maps)!r} is one map; give a list of maps")
    if not maps:
        raise MergeError("there is no map to merge")
    if starts is not None and len(starts) != len(maps):
        raise MergeError(f"{len(maps)} maps need {len(maps)} start poses, not {len(starts)}")
    if strategy not in STRATEGIES:
        raise MergeError(f"unknown strategy {strategy!r}: choose from {', '.join(STRATEGIES)}")
    of_the_graph = (known_poses, not matching, solver != "own", workers, cluster, store, candidates)
    if strategy == "sequential" and any(of_the_graph):
        raise MergeError(
            "known poses, solvers, workers, clusters, stores and candidates are for strategy 'graph'"
        )
    if candidates is not None and candidates < 1:
        raise MergeError(f"each map needs one candidate or more, not {candidates}")
    check_fusion(fusion)  # before the long work
    grids = [m if isinstance(m, OccupancyGrid) else load(m) for m in maps]
    if strategy == "sequential":
        placed = placed_one_by_one(grids, method, parameters)
    else:
        placed = placed_by_graph(
            grids,
            method=method,
            parameters=parameters,
            known_poses=known_poses,
            matching=matching,
            solver=solver,
            workers=workers,
            cluster=cluster,
            store=None if store is None else Path(store),
            candidates=candidates,
            on_pair=on_pair,
        )
    return _drawn(grids, placed, fusion, starts or [Pose2()] * len(grids))


def _drawn(
    grids: Sequence[OccupancyGrid], placed: Placement, fusion: str, starts: Sequence[Pose2]
) -> MergeResult:
    joined = {i: T for i, T in enumerate(placed.poses) if T is not None}
    return MergeResult(
        grid=merge_aligned([grids[i] for i in joined], list(joined.values()), fusion),
        poses=placed.poses,
        starts=tuple(None if T is None else T @ start for T, start in zip(placed.poses, starts, strict=True)),
        components=placed.components,
        joints=placed.joints,
        refused=placed.refused,
        covariances=placed.covariances,
        pairs=placed.pairs,
    )
