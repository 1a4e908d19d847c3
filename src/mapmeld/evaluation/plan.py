"""What a benchmark is going to try: every pair, turn and method, in a fixed order."""

from __future__ import annotations

import hashlib
import random
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from mapmeld.errors import MapmeldError
from mapmeld.evaluation.pairs import Dataset, DatasetError, Pair
from mapmeld.evaluation.rows import TrialKey
from mapmeld.evaluation.score import Tolerance, overlap_centroid
from mapmeld.fingerprint import code_version, grid_digest, parameters_json
from mapmeld.grid import overlap_share
from mapmeld.io import load
from mapmeld.matching.match import method_named


class PlanError(MapmeldError):
    """A benchmark that cannot be run as asked."""


@dataclass(frozen=True, slots=True)
class Trial:
    """One thing to try; the fields are those of `mapmeld.evaluation.rows.TrialRow`.

    Attributes
    ----------
    pair
        With its overlap and its centroid, also where the data set leaves them out.
    settings
        Settings of the method, an instance of its parameter class; `parameters` are the same as JSON.
    """

    dataset: str
    pair: Pair
    inputs: str
    method: str
    parameters: str
    settings: object
    turn_seed: int | None
    swapped: bool
    time_against: str | None
    version: str
    tolerance: Tolerance

    @property
    def key(self) -> TrialKey:
        """What is tried, as in `TrialRow.key`."""
        return (
            self.dataset,
            self.pair.id,
            self.inputs,
            self.method,
            self.parameters,
            self.turn_seed,
            self.swapped,
            self.time_against,
            self.version,
        )


def plan_trials(
    datasets: Sequence[Dataset],
    methods: Sequence[str],
    *,
    parameters: Mapping[str, object] | None = None,
    turn: int = 0,
    seed: int = 0,
    limit: int | None = None,
    swap: bool = False,
    tolerances: Mapping[str, Tolerance] | None = None,
    time_against: str | None = None,
    on_pair: Callable[[], object] | None = None,
) -> tuple[Trial, ...]:
    """Decide what to try: data set by data set, pair by pair, turn by turn, method by method.

    Every map is read once, so a missing or damaged one is known before the first match.

    Parameters
    ----------
    datasets
        As read by `mapmeld.evaluation.read_dataset`; their names must differ.
    methods
        Keys of `mapmeld.matching.METHODS`.
    parameters
        Settings per method, where they are not the defaults.
    turn
        0 tries each pair once, as it is. N tries it N times, each time with map 2 turned by another
        angle; the angles depend on `seed`, data set, pair and count only.
    seed
        Of the turns and of the choice by `limit`.
    limit
        Take so many pairs of each data set, drawn at random.
    swap
        Lay map 1 on map 2 instead of 2 on 1.
    tolerances
        By name of the data set: what counts as right, instead of what data set and pairs say.
    time_against
        A method that is timed right after each match on the same maps.
    on_pair
        Called after each pair that was read.

    Raises
    ------
    PlanError
        The request contradicts itself.
    DatasetError, MapFileError, UnknownMethodError
        A map or a method is not there, or the maps of a pair do not overlap under their truth.
    """
    if turn < 0:
        raise PlanError(f"the number of turns cannot be negative, as {turn} is")
    if limit is not None and limit < 1:
        raise PlanError(f"at least one pair of each data set is needed, not {limit}")
    for what, names in (("data set", [d.name for d in datasets]), ("method", list(methods))):
        if not names:
            raise PlanError(f"at least one {what} is needed")
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            hint = "; give one another name in its dataset.json" if what == "data set" else ""
            raise PlanError(f"two times the same {what}: {', '.join(twice)}{hint}")
    unknown = sorted(set(tolerances or {}) - {d.name for d in datasets})
    if unknown:
        raise PlanError(f"a tolerance for {', '.join(unknown)}, but no data set of that name is run")
    if time_against is not None:
        method_named(time_against)
    settings = {name: (parameters or {}).get(name) or method_named(name).parameters() for name in methods}
    texts = {name: parameters_json(chosen) for name, chosen in settings.items()}
    version = code_version()

    trials: list[Trial] = []
    reader = _Reader()
    for dataset in datasets:
        override = (tolerances or {}).get(dataset.name)
        for stated in _chosen(dataset.pairs, limit, seed):
            pair, inputs = reader.completed(stated, dataset)
            turns = _turn_seeds(turn, seed, dataset.name, pair.id)
            trials += [
                Trial(
                    dataset=dataset.name,
                    pair=pair,
                    inputs=inputs,
                    method=method,
                    parameters=texts[method],
                    settings=settings[method],
                    turn_seed=turn_seed,
                    swapped=swap,
                    time_against=time_against,
                    version=version,
                    tolerance=override or pair.tolerance or dataset.tolerance,
                )
                for turn_seed in turns
                for method in methods
            ]
            if on_pair:
                on_pair()
    return tuple(trials)


def _chosen(pairs: Sequence[Pair], limit: int | None, seed: int) -> Iterable[Pair]:
    if limit is None or limit >= len(pairs):
        return pairs
    return [pairs[i] for i in sorted(random.Random(seed).sample(range(len(pairs)), limit))]


def _turn_seeds(turn: int, seed: int, dataset: str, pair: str) -> list[int | None]:
    """Return seeds that are the same in every run, whatever else the run tries; [None] without turns."""
    if not turn:
        return [None]
    texts = ["\0".join((str(seed), dataset, pair, str(number))) for number in range(turn)]
    return [int.from_bytes(hashlib.blake2b(text.encode(), digest_size=6).digest()) for text in texts]


class _Reader:
    """Reads maps, keeps the last few, and the fingerprint of each."""

    def __init__(self) -> None:
        self._load = lru_cache(maxsize=4)(load)
        self._digests: dict[Path, bytes] = {}

    def completed(self, pair: Pair, dataset: Dataset) -> tuple[Pair, str]:
        """Return the pair with overlap and centroid, and the fingerprint of all that it consists of."""
        entry = (pair.kind, pair.T_1_2, pair.env, pair.overlap, pair.centroid)
        digest = hashlib.blake2b(repr(entry).encode(), digest_size=8)
        digest.update(self._digest(pair.map_1) + self._digest(pair.map_2))
        T_1_2 = pair.T_1_2
        if T_1_2 is not None and (pair.centroid is None or pair.overlap is None):
            map_1, map_2 = self._load(pair.map_1), self._load(pair.map_2)
            centroid = pair.centroid or overlap_centroid(map_1, map_2, T_1_2)
            if centroid is None:
                raise DatasetError(f"{dataset.file}: pair {pair.id}: the maps do not overlap under their T")
            overlap = overlap_share(map_1, map_2, T_1_2) if pair.overlap is None else pair.overlap
            pair = replace(pair, centroid=centroid, overlap=overlap)
        return pair, digest.hexdigest()

    def _digest(self, path: Path) -> bytes:
        if path not in self._digests:
            self._digests[path] = grid_digest(self._load(path))
        return self._digests[path]
