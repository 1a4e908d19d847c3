"""Runs what was planned: each trial on its own, by workers that use one thread each."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache, partial
from itertools import groupby

import cv2
import numpy as np

from mapmeld.evaluation.plan import Trial
from mapmeld.evaluation.rows import ERROR, TrialKey, TrialRow, is_right, judged
from mapmeld.evaluation.score import PoseErrors, pose_errors
from mapmeld.evaluation.turning import turned
from mapmeld.grid import FREE, OCCUPIED, OccupancyGrid
from mapmeld.io import load
from mapmeld.matching import MatchResult, match
from mapmeld.parallel import run_jobs
from mapmeld.se2 import Pose2

Group = tuple[Trial, ...]
"""Trials on the same two maps, which are then loaded and turned once."""


def run_trials(
    trials: Sequence[Trial],
    *,
    workers: int = 1,
    cluster: str | None = None,
    finished: Iterable[TrialRow] = (),
    keep: Callable[[Sequence[TrialRow]], object] | None = None,
    on_row: Callable[[TrialRow], object] | None = None,
    batch_seconds: float = 2.0,
) -> tuple[TrialRow, ...]:
    """Run trials and return their rows in the order of the trials.

    A matcher that raises, or answers what no matcher may, makes a row with verdict "error"; the run
    goes on.

    Parameters
    ----------
    trials
        As made by `mapmeld.evaluation.plan_trials`.
    workers, cluster
        Who runs them, see `mapmeld.parallel.run_jobs`. With ``workers=0`` a crash of a matcher is a crash of
        the caller, and NumPy's own threads are left as they are. Maps are read where the trials are run,
        so the workers of a cluster must find them under the same paths.
    finished
        Rows of earlier runs. A trial that has one is not run again; its row is judged by the trial's
        tolerance.
    keep
        Given the new rows in batches as they come, and the rest of them before this returns or raises,
        whatever ends the run. A batch that was interrupted is given once more.
    on_row
        Called for each new row at once.
    batch_seconds
        Rows are handed to `keep` when this time [s] has passed since the last batch.

    Raises
    ------
    WorkerDiedError
        Processes died (killed, out of memory, crashed inside a library), and did so again and again.
    ClusterError
        The cluster cannot be used.
    """
    wanted = {trial.key: trial for trial in trials}
    rows: dict[TrialKey, TrialRow] = {
        row.key: judged(row, wanted[row.key].tolerance) for row in finished if row.key in wanted
    }
    groups = _groups([trial for key, trial in wanted.items() if key not in rows])
    methods = sorted({name for group in groups for t in group for name in (t.method, t.time_against) if name})
    answers = run_jobs(
        _run_group,
        [(group,) for group in groups],
        workers=workers,
        cluster=cluster,
        prepare=partial(_warm_up, methods),
    )
    threads = cv2.getNumThreads()
    batch: list[TrialRow] = []
    due = time.monotonic() + batch_seconds
    try:
        with contextlib.closing(answers):
            for _, new in answers:
                batch += new
                for row in new:
                    rows[row.key] = row
                    if on_row:
                        on_row(row)
                if keep and time.monotonic() >= due:
                    keep(batch)
                    batch = []
                    due = time.monotonic() + batch_seconds
    finally:
        cv2.setNumThreads(threads)
        if keep and batch:
            keep(batch)
    return tuple(rows[trial.key] for trial in trials)


def _groups(trials: Iterable[Trial]) -> list[Group]:
    same_maps = groupby(trials, key=lambda t: (t.dataset, t.pair.id, t.turn_seed, t.swapped))
    return [tuple(group) for _, group in same_maps]


def _warm_up(methods: Sequence[str]) -> None:
    """Let every method load what it needs, so that the first pair is not charged for it."""
    cv2.setNumThreads(1)
    cells = np.full((80, 80), FREE, np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = OCCUPIED
    cells[20:50, 30] = cells[50, 10:60] = cells[60:, 45] = OCCUPIED
    grid = OccupancyGrid(cells, 0.1)
    for method in methods:
        with contextlib.suppress(Exception):  # it will fail on the pairs, too, and be counted there
            match(grid, grid, method)


# ---------------------------------------------------------------------- one pair
_load = lru_cache(maxsize=2)(load)


def _run_group(group: Group) -> list[TrialRow]:
    first = group[0]
    a, b, T_a_b = _load(first.pair.map_1), _load(first.pair.map_2), first.pair.T_1_2
    centroid = first.pair.centroid
    if first.turn_seed is not None:
        b, T_new_old = turned(b, first.turn_seed)
        T_a_b = None if T_a_b is None else T_a_b @ T_new_old.inverse()
    if first.swapped:
        a, b = b, a
        if T_a_b is not None:
            T_a_b = T_a_b.inverse()
            if centroid is not None:
                x, y = T_a_b.apply(centroid)
                centroid = (float(x), float(y))
    return [_run_trial(trial, a, b, T_a_b, centroid) for trial in group]


def _run_trial(
    trial: Trial,
    a: OccupancyGrid,
    b: OccupancyGrid,
    truth_a_b: Pose2 | None,
    centroid: tuple[float, float] | None,
) -> TrialRow:
    result, problem, seconds = _timed(a, b, trial.method, trial.settings)
    against_seconds = None
    if trial.time_against is not None:
        _, failed, against_seconds = _timed(a, b, trial.time_against, None)
        against_seconds = None if failed else against_seconds
    guess = result.T_a_b if result else None
    errors: PoseErrors | None = None
    if guess is not None and truth_a_b is not None and centroid is not None:
        errors = pose_errors(guess, truth_a_b, centroid)
    return TrialRow(
        dataset=trial.dataset,
        pair=trial.pair.id,
        inputs=trial.inputs,
        method=trial.method,
        parameters=trial.parameters,
        turn_seed=trial.turn_seed,
        swapped=trial.swapped,
        time_against=trial.time_against,
        version=trial.version,
        kind=str(trial.pair.kind),
        env=trial.pair.env,
        true_overlap=trial.pair.overlap,
        true_x=truth_a_b.x if truth_a_b else None,
        true_y=truth_a_b.y if truth_a_b else None,
        true_theta=truth_a_b.theta if truth_a_b else None,
        verdict=str(result.verdict) if result else ERROR,
        reason=result.reason if result else problem,
        x=guess.x if guess else None,
        y=guess.y if guess else None,
        theta=guess.theta if guess else None,
        probability=result.probability if result else None,
        similarity=result.similarity if result else 0.0,
        overlap=result.overlap if result else 0.0,
        covariance=_nine_numbers(result),
        alternatives=len(result.alternatives) if result else 0,
        translation_error=errors.translation if errors else None,
        rotation_error=errors.rotation if errors else None,
        tolerance_translation=trial.tolerance.translation,
        tolerance_rotation=trial.tolerance.rotation,
        right=is_right(errors, trial.tolerance),
        seconds=seconds,
        against_seconds=against_seconds,
    )


def _timed(
    a: OccupancyGrid, b: OccupancyGrid, method: str, settings: object | None
) -> tuple[MatchResult | None, str, float]:
    """Return the answer (None if there is none), what went wrong, and the wall time [s]."""
    cv2.setRNGSeed(
        0
    )  # OpenCV's own generator goes on where the last trial, a different one each run, left it
    start = time.perf_counter()
    try:
        result = match(a, b, method, settings)
        seconds = time.perf_counter() - start
        problem = _not_an_answer(result)
    except Exception as error:  # whatever a matcher raises is its failure, not the benchmark's
        seconds = time.perf_counter() - start
        problem = f"{type(error).__name__}: {' '.join(str(error).split())}"
    return (None, problem, seconds) if problem else (result, "", seconds)


def _not_an_answer(result: MatchResult) -> str:
    """Return what is wrong with an answer, empty if nothing is."""
    p, T = result.probability, result.T_a_b
    if p is not None and not 0 <= p <= 1:
        return f"the method stated a probability of {p}"
    if T is not None and not all(map(math.isfinite, (T.x, T.y, T.theta))):
        return f"the method gave a transform that is not finite: {T}"
    if not math.isfinite(result.similarity):
        return f"the method gave a similarity of {result.similarity}"
    return ""


def _nine_numbers(result: MatchResult | None) -> tuple[float, ...] | None:
    if result is None or result.covariance is None:
        return None
    return tuple(float(v) for v in np.asarray(result.covariance, np.float64).ravel())
