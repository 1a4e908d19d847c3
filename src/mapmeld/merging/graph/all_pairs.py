"""Every map matched with every other, or with those that look like it."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from pathlib import Path

import numpy as np

from mapmeld.fingerprint import code_version, grid_digest, parameters_json
from mapmeld.grid import OccupancyGrid
from mapmeld.index.ranking import likely_pairs
from mapmeld.index.signature import signature_of
from mapmeld.matching import DEFAULT_METHOD, Alternative, MatchResult, Verdict, match, method_named
from mapmeld.parallel import Shared, run_jobs
from mapmeld.parquet_rows import RowStore
from mapmeld.se2 import Pose2

BATCH_SECONDS = 2.0

PairKey = tuple[str, str, str, str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class PairRow:
    """A match as it is stored. The first five fields say what was matched, and how.

    Attributes
    ----------
    map_a, map_b
        Fingerprints of the two maps' cells, resolution and origin.
    method, parameters
        Name of the matcher and its settings as JSON.
    version
        mapmeld's version and a fingerprint of its matchers' source.
    verdict, reason, x, y, theta, probability, similarity, overlap, seconds
        As in `mapmeld.MatchResult`; (x, y, theta) are ``T_a_b`` [m, m, rad].
    covariance
        Nine numbers, row by row.
    alternatives
        Five numbers each: x, y, theta, similarity, probability (NaN: none).
    """

    map_a: str
    map_b: str
    method: str
    parameters: str
    version: str
    verdict: str
    reason: str
    x: float | None
    y: float | None
    theta: float | None
    probability: float | None
    similarity: float
    overlap: float
    covariance: tuple[float, ...] | None
    alternatives: tuple[float, ...]
    seconds: float

    @property
    def key(self) -> PairKey:
        """What was matched."""
        return self.map_a, self.map_b, self.method, self.parameters, self.version

    @classmethod
    def of(cls, key: PairKey, result: MatchResult) -> PairRow:
        """Flatten a result."""
        T, covariance = result.T_a_b, result.covariance
        map_a, map_b, method, parameters, version = key
        return cls(
            map_a=map_a,
            map_b=map_b,
            method=method,
            parameters=parameters,
            version=version,
            verdict=str(result.verdict),
            reason=result.reason,
            x=None if T is None else T.x,
            y=None if T is None else T.y,
            theta=None if T is None else T.theta,
            probability=result.probability,
            similarity=result.similarity,
            overlap=result.overlap,
            covariance=None if covariance is None else tuple(map(float, np.ravel(covariance))),
            alternatives=tuple(
                number
                for other in result.alternatives
                for number in (
                    other.T_a_b.x,
                    other.T_a_b.y,
                    other.T_a_b.theta,
                    other.similarity,
                    math.nan if other.probability is None else other.probability,
                )
            ),
            seconds=result.seconds,
        )

    def result(self) -> MatchResult:
        """Return the result as it was."""
        T = None
        if self.x is not None and self.y is not None and self.theta is not None:
            T = Pose2(self.x, self.y, self.theta)
        others = np.reshape(self.alternatives, (-1, 5)).tolist()
        return MatchResult(
            T_a_b=T,
            verdict=Verdict(self.verdict),
            reason=self.reason,
            probability=self.probability,
            similarity=self.similarity,
            overlap=self.overlap,
            covariance=None if self.covariance is None else np.reshape(self.covariance, (3, 3)),
            alternatives=tuple(
                Alternative(Pose2(x, y, theta), similarity, None if math.isnan(p) else p)
                for x, y, theta, similarity, p in others
            ),
            method=self.method,
            seconds=self.seconds,
        )


PAIR_STORE = RowStore(PairRow, "store")


def match_all_pairs(
    maps: Sequence[OccupancyGrid],
    *,
    method: str = DEFAULT_METHOD,
    parameters: object | None = None,
    workers: int = 0,
    cluster: str | None = None,
    store: Path | None = None,
    candidates: int | None = None,
    on_pair: Callable[[], object] | None = None,
) -> tuple[tuple[int, int, MatchResult], ...]:
    """Match every map with every later one; return (i, j, result) in order.

    Parameters
    ----------
    maps
        n maps.
    method, parameters
        As for `mapmeld.match`.
    workers, cluster
        Who does it, see `mapmeld.parallel.run_jobs`.
    store
        A folder that keeps every result as it comes (extra ``store``). What is in it already, of the
        same maps, settings and code, is not matched again.
    candidates
        Match only pairs in which one map is among so many that look most like the other, by their
        signatures (`mapmeld.index`), in place of all.
    on_pair
        Called for each pair as it is done.

    Raises
    ------
    StoreError, WorkerDiedError, ClusterError, MissingExtraError, UnknownMethodError, ResolutionError
        As said there.
    """
    settings = method_named(method).parameters() if parameters is None else parameters
    pairs = _pairs(maps, candidates)
    done: dict[tuple[int, int], MatchResult] = {}
    keys: Mapping[tuple[int, int], PairKey] = {}
    if store is not None:
        keys = _keys(maps, pairs, method, settings)
        kept = {row.key: row for row in PAIR_STORE.open(store)}
        done = {pair: kept[key].result() for pair, key in keys.items() if key in kept}
        for _ in done:
            if on_pair:
                on_pair()
    waiting = [pair for pair in pairs if pair not in done]
    running = run_jobs(
        partial(_match, method=method, parameters=settings),
        [(Shared(i), Shared(j)) for i, j in waiting],
        shared=maps,
        workers=workers,
        cluster=cluster,
    )
    batch: list[PairRow] = []
    due = time.monotonic()  # what takes long is kept at once
    try:
        with contextlib.closing(running):
            for number, result in running:
                pair = waiting[number]
                done[pair] = result
                if store is not None:
                    batch.append(PairRow.of(keys[pair], result))
                    if time.monotonic() >= due:
                        PAIR_STORE.add(store, batch)
                        batch, due = [], time.monotonic() + BATCH_SECONDS
                if on_pair:
                    on_pair()
    finally:
        if store is not None and batch:
            PAIR_STORE.add(store, batch)
    return tuple((i, j, done[i, j]) for i, j in pairs)


def _pairs(maps: Sequence[OccupancyGrid], candidates: int | None) -> list[tuple[int, int]]:
    if candidates is None or candidates >= len(maps) - 1:
        return list(combinations(range(len(maps)), 2))
    return likely_pairs([signature_of(grid) for grid in maps], candidates)


def _keys(
    maps: Sequence[OccupancyGrid], pairs: Sequence[tuple[int, int]], method: str, settings: object
) -> Mapping[tuple[int, int], PairKey]:
    digests = [grid_digest(grid).hex() for grid in maps]
    how = method, parameters_json(settings), code_version()
    return {(i, j): (digests[i], digests[j], *how) for i, j in pairs}


def _match(a: OccupancyGrid, b: OccupancyGrid, *, method: str, parameters: object) -> MatchResult:
    return match(a, b, method, parameters)
