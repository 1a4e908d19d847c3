import json
import math
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from tiny_dataset import T_1_2, add_method, saying, write_dataset

from mapmeld.evaluation import (
    Tolerance,
    Trial,
    TrialRow,
    WorkerDiedError,
    accuracy,
    plan_trials,
    read_dataset,
    run_trials,
)
from mapmeld.evaluation.store import read_rows
from mapmeld.grid import OccupancyGrid
from mapmeld.matching import Alternative, MatchResult, Verdict
from mapmeld.se2 import Pose2


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_dataset(tmp_path / "tiny")


def plan(folder: Path, *methods: str, **options: Any) -> tuple[Trial, ...]:
    return plan_trials([read_dataset(folder)], methods, **options)


def timeless(rows: Sequence[TrialRow]) -> list[TrialRow]:
    return [replace(row, seconds=0.0, against_seconds=None) for row in rows]


# ---------------------------------------------------------------------- scores
def test_rows_scored_by_hand(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    guess = Pose2(3.3, -1.6, 0.6)  # 0.3 and 0.4 m off the truth of the first pair, so 0.5 everywhere
    add_method(monkeypatch, "guess", saying(guess, 0.7))
    first, second, third = run_trials(plan(folder, "guess"), workers=0)
    assert [first.translation_error, first.rotation_error] == pytest.approx([0.5, 0])
    assert (first.true_x, first.true_y, first.true_theta) == (3.0, -2.0, 0.6)
    assert (first.x, first.y, first.theta) == (3.3, -1.6, 0.6)
    assert (first.verdict, first.probability, first.similarity, first.reason) == (
        "accepted",
        0.7,
        0.5,
        "says so",
    )
    assert second.rotation_error == pytest.approx(2.6)
    assert not second.right
    assert (third.kind, third.right, third.translation_error, third.true_x) == (
        "different",
        False,
        None,
        None,
    )
    assert all(row.seconds > 0 for row in (first, second, third))


@pytest.mark.parametrize(("tolerance", "right"), [(0.51, True), (0.49, False)])
def test_right_is_what_the_tolerance_says(
    folder: Path, monkeypatch: pytest.MonkeyPatch, tolerance: float, right: bool
) -> None:
    add_method(monkeypatch, "guess", saying(Pose2(3.3, -1.6, 0.6)))
    asked = {"tiny": Tolerance.of(tolerance, 5)}
    row = run_trials(plan(folder, "guess", tolerances=asked), workers=0)[0]
    assert row.right is right
    assert row.tolerance_translation == tolerance
    assert row.tolerance_rotation == pytest.approx(math.radians(5))


def test_no_guess_has_no_errors(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    add_method(monkeypatch, "silent", saying(None))
    row = run_trials(plan(folder, "silent"), workers=0)[0]
    assert (row.x, row.translation_error, row.right) == (None, None, False)


def test_the_evidence_is_kept(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def answer(a: OccupancyGrid, b: OccupancyGrid, settings: Any) -> MatchResult:
        others = (Alternative(Pose2(), 0.1), Alternative(Pose2(), 0.2))
        return MatchResult(
            T_1_2, Verdict.AMBIGUOUS, "two ways", None, 0.3, 0.4, np.arange(9.0).reshape(3, 3), others
        )

    add_method(monkeypatch, "doubting", answer)
    row = run_trials(plan(folder, "doubting"), workers=0)[0]
    assert row.verdict == "ambiguous"
    assert row.covariance == tuple(range(9))
    assert (row.overlap, row.alternatives, row.probability) == (0.4, 2, None)


def test_the_matcher_sees_the_maps_that_the_truth_is_about(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever is turned or swapped: under the truth of the row the two maps agree."""
    seen: list[tuple[OccupancyGrid, OccupancyGrid]] = []

    def look(a: OccupancyGrid, b: OccupancyGrid, settings: Any) -> MatchResult:
        seen.append((a, b))
        return MatchResult(None, Verdict.REJECTED, "only looks")

    add_method(monkeypatch, "look", look)
    for options in ({}, {"swap": True}, {"turn": 3}, {"turn": 3, "swap": True}):
        seen.clear()
        rows = run_trials(plan(folder, "look", **options), workers=0)
        maps = seen[1:]  # the first were the warm-up's
        assert len(maps) == len(rows)
        for row, (a, b) in zip(rows, maps, strict=True):
            if row.true_x is not None and row.true_y is not None and row.true_theta is not None:
                assert accuracy(b, a, Pose2(row.true_x, row.true_y, row.true_theta)) > 0.96


@pytest.mark.parametrize("options", [{}, {"swap": True}, {"turn": 2}, {"turn": 2, "swap": True}])
def test_a_real_method_is_right_however_the_maps_lie(folder: Path, options: dict[str, Any]) -> None:
    rows = run_trials(plan(folder, "alphabet", **options), workers=0)
    same = [row for row in rows if row.kind == "same"]
    assert all(row.right and row.translation_error and row.translation_error < 0.2 for row in same)
    assert all(row.swapped == bool(options.get("swap")) for row in rows)


def test_the_error_of_a_swapped_pair_is_measured_at_the_same_place(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A guess that is turned by 0.1 rad about the overlap's centroid, seen from either map.
    about = Pose2(8, 6, 0) @ Pose2(0, 0, 0.1) @ Pose2(-8, -6, 0)
    add_method(monkeypatch, "turning", saying((about @ T_1_2).inverse()))
    row = run_trials(plan(folder, "turning", swap=True), workers=0)[0]
    assert row.translation_error == pytest.approx(0, abs=1e-9)
    assert row.rotation_error == pytest.approx(0.1)


# ---------------------------------------------------------------------- failures
def test_a_matcher_that_raises_makes_a_row(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fall(a: OccupancyGrid, b: OccupancyGrid, settings: Any) -> MatchResult:
        raise ZeroDivisionError("over\nthe edge")

    add_method(monkeypatch, "falling", fall)
    add_method(monkeypatch, "standing", saying(T_1_2))
    rows = run_trials(plan(folder, "falling", "standing"), workers=0)
    assert [row.verdict for row in rows] == ["error", "accepted"] * 3
    assert rows[0].reason == "ZeroDivisionError: over the edge"
    assert (rows[0].right, rows[0].x) == (False, None)


@pytest.mark.parametrize(
    ("result", "said"),
    [
        (MatchResult(Pose2(), Verdict.ACCEPTED, "", probability=1.5), "a probability of 1.5"),
        (MatchResult(Pose2(), Verdict.ACCEPTED, "", probability=math.nan), "a probability of nan"),
        (MatchResult(Pose2(math.inf, 0, 0), Verdict.ACCEPTED, ""), "not finite"),
        (MatchResult(Pose2(), Verdict.ACCEPTED, "", similarity=math.nan), "a similarity of nan"),
    ],
)
def test_an_impossible_answer_is_an_error(
    folder: Path, monkeypatch: pytest.MonkeyPatch, result: MatchResult, said: str
) -> None:
    add_method(monkeypatch, "mad", lambda a, b, settings: result)
    row = run_trials(plan(folder, "mad"), workers=0)[0]
    assert row.verdict == "error"
    assert said in row.reason


def test_a_worker_that_dies_is_named_and_what_was_done_is_kept(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept: list[TrialRow] = []

    def kill_the_workers(row: TrialRow) -> None:
        for process in multiprocessing.active_children():
            process.kill()

    with pytest.raises(WorkerDiedError, match=r"worker processes died.*continue"):
        run_trials(plan(folder, "alphabet", turn=300), keep=kept.extend, on_row=kill_the_workers)
    assert kept


# ---------------------------------------------------------------------- timing
def test_another_method_is_timed_on_the_same_maps_in_turn(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[tuple[str, int, int]] = []

    def recording(name: str) -> Callable[[OccupancyGrid, OccupancyGrid, Any], MatchResult]:
        def answer(a: OccupancyGrid, b: OccupancyGrid, settings: Any) -> MatchResult:
            calls.append((name, id(a), id(b)))
            return MatchResult(None, Verdict.REJECTED, "")

        return answer

    add_method(monkeypatch, "tried", recording("tried"))
    add_method(monkeypatch, "reference", recording("reference"))
    rows = run_trials(plan(folder, "tried", time_against="reference"), workers=0)
    calls = calls[2:]  # the warm-up's
    assert [name for name, _, _ in calls] == ["tried", "reference"] * 3
    assert all(mine[1:] == its[1:] for mine, its in zip(calls[::2], calls[1::2], strict=True))
    for row in rows:
        assert row.against_seconds
        assert row.time_ratio == row.seconds / row.against_seconds


def test_a_reference_that_fails_gives_no_ratio(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fall(a: OccupancyGrid, b: OccupancyGrid, settings: Any) -> MatchResult:
        raise RuntimeError

    add_method(monkeypatch, "falling", fall)
    row = run_trials(plan(folder, "alphabet", time_against="falling"), workers=0)[0]
    assert (row.against_seconds, row.time_ratio, row.right) == (None, None, True)


def test_trials_run_on_one_thread_and_the_callers_setting_comes_back(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    threads: list[int] = []

    def count(a: OccupancyGrid, b: OccupancyGrid, settings: Any) -> MatchResult:
        threads.append(cv2.getNumThreads())
        return MatchResult(None, Verdict.REJECTED, "")

    add_method(monkeypatch, "count", count)
    before = cv2.getNumThreads()
    cv2.setNumThreads(2)
    try:
        run_trials(plan(folder, "count"), workers=0)
        assert set(threads) == {1}
        assert cv2.getNumThreads() == 2
    finally:
        cv2.setNumThreads(before)


# ---------------------------------------------------------------------- workers, going on
def test_the_number_of_workers_changes_nothing_but_seconds(folder: Path) -> None:
    before = dict(os.environ)
    trials = plan(folder, "alphabet", turn=2)
    here, one, two = (run_trials(trials, workers=workers) for workers in (0, 1, 2))
    assert timeless(here) == timeless(one) == timeless(two)
    assert [row.key for row in two] == [trial.key for trial in trials]
    assert dict(os.environ) == before


def test_finished_trials_are_not_run_again(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    trials = plan(folder, "alphabet")
    rows = run_trials(trials, workers=0)
    new: list[TrialRow] = []
    again = run_trials(trials, workers=0, finished=rows[:2], on_row=new.append)
    assert again[:2] == rows[:2]
    assert [row.key for row in new] == [rows[2].key]


def test_finished_rows_are_judged_by_the_tolerance_of_today(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    add_method(monkeypatch, "guess", saying(Pose2(3.3, -1.6, 0.6)))
    strict = run_trials(plan(folder, "guess", tolerances={"tiny": Tolerance.of(0.1, 5)}), workers=0)
    loose = plan(folder, "guess", tolerances={"tiny": Tolerance.of(1, 5)})
    again = run_trials(loose, workers=0, finished=strict)
    assert (strict[0].right, again[0].right, again[0].tolerance_translation) == (False, True, 1)
    assert again[0].seconds == strict[0].seconds


def test_rows_of_other_trials_are_left_aside(folder: Path) -> None:
    trials = plan(folder, "alphabet")
    strangers = [replace(row, version="older") for row in run_trials(trials, workers=0)]
    new: list[TrialRow] = []
    rows = run_trials(trials, workers=0, finished=strangers, on_row=new.append)
    assert len(new) == 3
    assert not {row.key for row in rows} & {row.key for row in strangers}


def test_rows_are_kept_when_the_run_is_interrupted(folder: Path) -> None:
    kept: list[TrialRow] = []
    seen: list[TrialRow] = []

    def interrupt(row: TrialRow) -> None:
        seen.append(row)
        if len(seen) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_trials(plan(folder, "alphabet"), workers=0, keep=kept.extend, on_row=interrupt)
    assert len(seen) == 2
    assert kept == seen


def test_a_negative_number_of_workers_is_refused(folder: Path) -> None:
    with pytest.raises(ValueError, match="cannot be negative"):
        run_trials(plan(folder, "alphabet"), workers=-1)


KILLED_RUN = """
import json, multiprocessing, sys
from pathlib import Path
from mapmeld.evaluation import plan_trials, read_dataset, run_trials
from mapmeld.evaluation.store import add_rows

def report(row):
    pids = [process.pid for process in multiprocessing.active_children()]
    print(json.dumps(pids), flush=True)

if __name__ == "__main__":
    folder, store = map(Path, sys.argv[1:])
    trials = plan_trials([read_dataset(folder)], ["alphabet"], turn=2000)
    run_trials(trials, workers=2, keep=lambda rows: add_rows(store, rows), on_row=report, batch_seconds=0)
"""


def is_running(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"  # a zombie has ended; nobody has asked for its exit code yet


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks at processes as Linux shows them")
def test_a_killed_run_goes_on_where_it_stopped_and_leaves_no_process(tmp_path: Path, folder: Path) -> None:
    script, store = tmp_path / "killed.py", tmp_path / "rows"
    script.write_text(KILLED_RUN)
    with subprocess.Popen(
        [sys.executable, script, folder, store], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout
        for _ in range(4):
            workers = json.loads(process.stdout.readline())
        process.send_signal(signal.SIGKILL)
    assert len(workers) == 2
    patience = time.monotonic() + 60
    while any(map(is_running, workers)):
        assert time.monotonic() < patience, "workers outlive a killed run"
        time.sleep(0.05)

    kept = read_rows(store)
    assert 3 <= len(kept) < 6000
    trials = plan(folder, "alphabet", turn=2)
    done = {row.key for row in kept} & {trial.key for trial in trials}
    assert done
    new: list[TrialRow] = []
    rows = run_trials(trials, workers=0, finished=kept, on_row=new.append)
    assert len(new) == len(trials) - len(done)
    assert timeless(rows) == timeless(run_trials(trials, workers=0))
