"""All stages one after the other; what is done already is not done again."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from itertools import combinations
from pathlib import Path
from typing import Any

import cv2

from mapmeld.experiment import folder
from mapmeld.experiment.folder import mapping_folder, write_row
from mapmeld.experiment.results import Results, read_results
from mapmeld.experiment.rows import JoinRow, MatchingRow
from mapmeld.experiment.settings import ExperimentSettings
from mapmeld.experiment.stages import environments, mappings
from mapmeld.experiment.stages.driving import plan_ways
from mapmeld.experiment.stages.elsewhere import match_elsewhere, pairs_of_different_environments
from mapmeld.experiment.stages.joins import join_further
from mapmeld.experiment.stages.mapped import mapped, true_environment
from mapmeld.experiment.stages.matchings import match_histories
from mapmeld.extras import required
from mapmeld.parallel import Job, run_jobs

Progress = Callable[[str, int], AbstractContextManager[Callable[[], None]]]
"""Given what is done and how many of it; what it yields is called after each."""

Unit = tuple[Path, Job]
"""The file that says that a unit of work is done, and the arguments of the function that does it."""


@contextmanager
def _silent(what: str, total: int) -> Iterator[Callable[[], None]]:
    del what, total
    yield lambda: None


def run_experiment(
    root: Path,
    settings: ExperimentSettings,
    *,
    force: bool = False,
    workers: int = 0,
    cluster: str | None = None,
    progress: Progress = _silent,
) -> Results:
    """Do what is not done yet of an experiment, and return all of it.

    Every unit of work (an environment, a mapping, a matching) is written when it is done, so an experiment
    that was interrupted goes on where it stopped. The same settings give the same files, times aside.

    Parameters
    ----------
    root
        Its folder; made if it does not exist.
    force
        Begin anew an experiment that lies there.
    workers, cluster
        Who does the work, see `mapmeld.parallel.run_jobs`. The workers of a cluster must find `root` under
        the same path.
    progress
        Told what is done.

    Raises
    ------
    ExperimentError
        `root` holds something else, or an experiment of other settings or code.
    MissingExtraError
        Libraries of the extra ``reproduce`` are not installed.
    WorkerDiedError, ClusterError
        As `mapmeld.parallel.run_jobs`.
    """
    for module in ("mujoco", "numba", "skimage.graph"):
        required(module, "reproduce")
    folder.open_folder(root, settings, force=force)
    root = root.resolve()
    mapped.cache_clear()  # another experiment may have been there before
    true_environment.cache_clear()

    def stage(name: str, what: str, function: Callable[..., Any], units: Sequence[Unit]) -> None:
        waiting = [unit for unit in units if not unit[0].is_file()]
        if not waiting:
            return
        began = time.monotonic()
        running = run_jobs(
            function,
            [job for _, job in waiting],
            workers=workers,
            cluster=cluster,
            prepare=_prepare_mapping if name == folder.MAPPINGS else _prepare,
        )
        try:
            with contextlib.closing(running), progress(what, len(waiting)) as step:
                for number, row in running:
                    if row is not None:  # environments and mappings are folders, written where they are made
                        write_row(waiting[number][0], row)
                    step()
        finally:
            folder.clear_leftovers(root)
            folder.add_time(root, name, time.monotonic() - began)

    threads = cv2.getNumThreads()
    try:
        stage(
            folder.ENVIRONMENTS,
            "Drawing environments",
            environments.make_environment,
            _environment_units(root, settings),
        )
        stage(folder.MAPPINGS, "Driving and mapping", mappings.make_mapping, _mapping_units(root, settings))
        stage(folder.MATCHINGS, "Matching histories", match_histories, _matching_units(root, settings))
        successes = [row for row in read_results(root).matchings if row.right]
        stage(folder.JOINS, "Joining further mappings", join_further, _join_units(root, settings, successes))
        stage(
            folder.ELSEWHERE,
            "Matching different environments",
            match_elsewhere,
            _elsewhere_units(root, settings),
        )
        stage(
            folder.NAVIGABILITY,
            "Planning ways",
            plan_ways,
            _way_units(root, settings, successes, read_results(root).joins),
        )
    finally:
        cv2.setNumThreads(threads)
    return read_results(root)


def _prepare() -> None:
    cv2.setNumThreads(1)


def _prepare_mapping() -> None:
    from mapmeld.slam import prepare

    _prepare()
    prepare()


def _environment_units(root: Path, settings: ExperimentSettings) -> list[Unit]:
    return [
        (folder.environment_folder(root, e) / environments.ROW, (root, settings, e))
        for e in range(1, settings.environments + 1)
    ]


def _mapping_units(root: Path, settings: ExperimentSettings) -> list[Unit]:
    return [
        (mapping_folder(root, e, m) / mappings.ROW, (root, settings, e, m))
        for e in range(1, settings.environments + 1)
        for m in range(1, settings.mappings + 1)
    ]


def _matching_units(root: Path, settings: ExperimentSettings) -> list[Unit]:
    return [
        (root / folder.MATCHINGS / method / f"{e:02}-{i}-{j}.json", (root, e, i, j, method))
        for e in range(1, settings.environments + 1)
        for i, j in combinations(range(1, settings.mappings + 1), 2)
        for method in settings.methods
    ]


def _join_units(root: Path, settings: ExperimentSettings, successes: Sequence[MatchingRow]) -> list[Unit]:
    if settings.mappings < 3:
        return []
    return [
        (
            root / folder.JOINS / row.method / f"{row.environment:02}-{row.mapping_1}-{row.mapping_2}.json",
            (root, row, settings.mappings),
        )
        for row in successes
    ]


def _elsewhere_units(root: Path, settings: ExperimentSettings) -> list[Unit]:
    return [
        (root / folder.ELSEWHERE / method / f"{e:02}-{i}_{f:02}-{j}.json", (root, (e, i, f, j), method))
        for e, i, f, j in pairs_of_different_environments(settings)
        for method in settings.methods
    ]


def _way_units(
    root: Path, settings: ExperimentSettings, successes: Sequence[MatchingRow], joins: Sequence[JoinRow]
) -> list[Unit]:
    """Return what ways are planned on: single mappings, successful matchings, and the largest joined maps."""
    at_origin = (0.0, 0.0, 0.0)
    of_maps: list[tuple[str, tuple[int, ...], str, int, tuple[tuple[float, float, float], ...]]] = [
        ("single", (m,), "", e, (at_origin,))
        for e in range(1, settings.environments + 1)
        for m in range(1, settings.mappings + 1)
    ]
    for row in successes:
        assert row.T_1_2 is not None
        pair = (row.mapping_1, row.mapping_2)
        of_maps.append((row.method, pair, row.method, row.environment, (at_origin, row.T_1_2)))
    of_maps += [
        (f"{row.method}-joined", row.members, row.method, row.environment, row.poses)
        for row in largest_joins(joins)
        if len(row.members) > 2
    ]
    return [
        (
            root / folder.NAVIGABILITY / name / f"{e:02}-{'-'.join(map(str, members))}.json",
            (root, e, members, poses, method, settings.environment_seed(e)),
        )
        for name, members, method, e, poses in of_maps
    ]


def largest_joins(joins: Sequence[JoinRow]) -> list[JoinRow]:
    """Return, for each environment and method, the first of the joined maps that hold most mappings."""
    largest: dict[tuple[int, str], JoinRow] = {}
    for row in joins:
        key = (row.environment, row.method)
        if key not in largest or len(row.members) > len(largest[key].members):
            largest[key] = row
    return list(largest.values())
