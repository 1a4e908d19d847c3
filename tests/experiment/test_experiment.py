"""The whole experiment, small: every stage, going on after an interruption, the report."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from small_experiment import SETTINGS

from mapmeld.evaluation.score import accuracy
from mapmeld.experiment import Results, read_results, run_experiment
from mapmeld.experiment import run as running
from mapmeld.experiment.folder import read_row, write_row
from mapmeld.experiment.pages.report import write_report
from mapmeld.experiment.rows import MatchingRow
from mapmeld.experiment.stages.elsewhere import pairs_of_different_environments
from mapmeld.experiment.stages.matchings import match_histories
from mapmeld.io import load
from mapmeld.io.history import read_history
from mapmeld.merging import merge_aligned
from mapmeld.se2 import Pose2

DONE = "*/*/*.json"
Made = tuple[Path, Results]


@pytest.fixture
def copy(small_experiment: Made, tmp_path: Path) -> Path:
    return Path(shutil.copytree(small_experiment[0], tmp_path / "copy"))


def without_times(path: Path) -> dict[str, Any]:
    return {name: v for name, v in json.loads(path.read_text()).items() if not name.endswith("seconds")}


def test_environments_are_what_the_environment_command_writes(small_experiment: Made) -> None:
    root, results = small_experiment
    folder = root / "environments" / "01"
    assert {path.name for path in folder.iterdir()} == {
        "map.txt", "config.txt", "map.yaml", "map.pgm", "environment.xml", "plan.png", "environment.json",
    }  # fmt: skip
    (row,) = results.environments
    assert (row.width, row.height, row.seed) == (10.0, 8.0, 0)
    truth = load(folder / "map.yaml")
    assert row.floor == pytest.approx(truth.free.sum() * 0.0025)


def test_a_mapping_has_a_state_a_second_and_its_true_place(small_experiment: Made) -> None:
    root, results = small_experiment
    truth = load(root / "environments" / "01" / "map.yaml")
    assert len({row.start for row in results.mappings}) == 3
    for row in results.mappings:
        folder = root / "mappings" / f"01-{row.mapping}"
        history = read_history(folder / "history")
        assert len(history) == row.states > 5
        seconds = [int(stamp) for stamp in history.stamps]
        assert len(set(seconds)) == len(seconds)
        assert history[-1].cells.tolist() == load(folder / "map.yaml").cells.tolist()
        # Where the start pose lays it, the map is true: that pose is the known truth of all that follows.
        assert row.accuracy == accuracy(load(folder / "map.yaml"), truth, Pose2(*row.start)) > 0.9
        turned = Pose2(*row.start) @ Pose2(0.0, 0.0, 0.5)
        assert accuracy(load(folder / "map.yaml"), truth, turned) < row.accuracy - 0.1
        assert row.accuracy_over_time[-1] == (history.stamps[-1], row.accuracy)
        found, true = (np.loadtxt(folder / name) for name in ("trajectory.txt", "truth.txt"))
        off = np.hypot(*(found - true)[:, 1:3].T)
        assert row.position_error_end == pytest.approx(off[-1], abs=1e-5)
        assert row.position_error == pytest.approx(float(np.sqrt(np.mean(off**2))), abs=1e-5)
        assert off[0] < 0.001
        assert row.position_error < 0.3


def test_all_pairs_are_matched_by_both_methods_and_judged(small_experiment: Made) -> None:
    root, results = small_experiment
    assert [(r.method, r.mapping_1, r.mapping_2) for r in results.matchings] == [
        (method, i, j) for method in ("alphabet", "correlative") for i, j in ((1, 2), (1, 3), (2, 3))
    ]
    truth = load(root / "environments" / "01" / "map.yaml")
    for row in results.matchings:
        one, two = results.mapping(1, row.mapping_1), results.mapping(1, row.mapping_2)
        assert row.steps == one.states + two.states
        known = Pose2(*one.start).inverse() @ Pose2(*two.start)
        assert row.truth == pytest.approx((known.x, known.y, known.theta))
        assert row.T_1_2 is not None
        assert row.right
        assert row.cause == ""
        assert row.translation_error is not None
        assert row.translation_error <= 0.5
        maps = [load(root / "mappings" / f"01-{m}" / "map.yaml") for m in (row.mapping_1, row.mapping_2)]
        merged = merge_aligned(maps, [Pose2(), Pose2(*row.T_1_2)])
        assert row.accuracy == accuracy(merged, truth, Pose2(*one.start))
        assert row.first_right is not None
        assert row.over_time[-1][1] is True
        times = [time for time, _, _ in row.over_time]
        assert times == sorted(times)
        assert row.probability is None or row.method == "correlative"


def test_successes_are_joined_with_the_third_mapping(small_experiment: Made) -> None:
    _, results = small_experiment
    assert len(results.joins) == 6
    for row in results.joins:
        assert set(row.members) == {1, 2, 3}
        assert len(row.poses) == 3
        assert len(row.accuracies) == 2  # of two, and of three
        assert row.members[:2] == (row.mapping_1, row.mapping_2)
        assert (row.tried, row.right) == (1, 1)


def test_ways_are_planned_on_single_and_merged_maps(small_experiment: Made) -> None:
    _, results = small_experiment
    counted = sorted((row.method, len(row.members)) for row in results.ways)
    of_method = [2, 2, 2, 3]
    assert counted == [("", 1)] * 3 + [(m, n) for m in ("alphabet", "correlative") for n in of_method]
    for row in results.ways:
        assert row.problem == ""
        assert row.pairs == 50
        assert row.reachable_truth == 50  # rooms are all joined by doors


def test_what_is_done_is_not_done_again(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gone = copy / "matchings" / "alphabet" / "01-1-3.json"
    before = without_times(gone)
    gone.unlink()
    others = {path: path.stat().st_mtime_ns for path in copy.glob(DONE)}
    calls: list[tuple[int, int]] = []

    def counted(root: Path, environment: int, i: int, j: int, method: str) -> MatchingRow:
        calls.append((i, j))
        return match_histories(root, environment, i, j, method)

    monkeypatch.setattr(running, "match_histories", counted)
    run_experiment(copy, SETTINGS)
    assert calls == [(1, 3)]
    assert without_times(gone) == before  # and it comes out the same
    assert {path: path.stat().st_mtime_ns for path in others} == others


def test_an_interrupted_run_keeps_what_was_done_and_goes_on(
    copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = {p.relative_to(copy): without_times(p) for p in (copy / "matchings").glob("*/*.json")}
    for path in (copy / "matchings").glob("*/*.json"):
        path.unlink()
    calls = 0

    def interrupted(*job: Any) -> MatchingRow:
        nonlocal calls
        calls += 1
        if calls == 3:
            (copy / "matchings" / ".mapmeld-cut.tmp").write_text("half of a fi")
            raise KeyboardInterrupt
        return match_histories(*job)

    with monkeypatch.context() as patch:
        patch.setattr(running, "match_histories", interrupted)
        with pytest.raises(KeyboardInterrupt):
            run_experiment(copy, SETTINGS)
    assert len(list((copy / "matchings").glob("*/*.json"))) == 2
    assert not list(copy.rglob(".mapmeld-*"))
    run_experiment(copy, SETTINGS)
    assert {p.relative_to(copy): without_times(p) for p in (copy / "matchings").glob("*/*.json")} == before


def test_the_same_seed_makes_the_same_mapping_in_other_processes(copy: Path) -> None:
    before = {p.relative_to(copy): p.read_bytes() for p in (copy / "mappings" / "01-2").rglob("*.pgm")}
    row = without_times(copy / "mappings" / "01-2" / "mapping.json")
    shutil.rmtree(copy / "mappings" / "01-2")
    told: list[tuple[str, int]] = []

    @contextmanager
    def progress(what: str, total: int) -> Iterator[Any]:
        told.append((what, total))
        yield lambda: told.append((what, 0))

    run_experiment(copy, SETTINGS, workers=1, progress=progress)
    assert {
        p.relative_to(copy): p.read_bytes() for p in (copy / "mappings" / "01-2").rglob("*.pgm")
    } == before
    assert without_times(copy / "mappings" / "01-2" / "mapping.json") == row
    assert told == [("Driving and mapping", 1), ("Driving and mapping", 0)]


def test_pairs_of_different_environments_are_drawn_by_the_seed() -> None:
    s = replace(SETTINGS, environments=4)
    pairs = pairs_of_different_environments(s)
    assert len(pairs) == len(set(pairs)) == 12  # as many as matchings of one environment
    assert all(e < f <= 4 and 1 <= i <= 3 and 1 <= j <= 3 for e, i, f, j in pairs)
    assert pairs == pairs_of_different_environments(s)
    assert pairs != pairs_of_different_environments(replace(s, seed=1))
    assert pairs_of_different_environments(SETTINGS) == []


def test_the_report_is_one_file_that_needs_no_network(small_experiment: Made, copy: Path) -> None:
    path = write_report(copy, small_experiment[1])
    text = path.read_text(encoding="utf-8")
    assert path == copy.resolve() / "report.html"
    assert not re.search(r"(src|href)=.?(?!\"?data:)", text)
    assert "http" not in text
    assert "@import" not in text
    pictures = {p.name: cv2.imread(str(p)) for p in (copy / "figures").iterdir()}
    assert text.count("data:image/png;base64,") == len(pictures)
    assert {
        "figure_8a.png", "figure_8b.png", "figure_8c.png", "figure_8d.png", "figure_9a.png", "accuracy.png",
        "successes.png", "over_time.png", "reliability_correlative.png", "environment_01.png",
    } == set(pictures)  # fmt: skip
    assert all(picture is not None and picture.std() > 5 for picture in pictures.values())
    for wanted in (
        "Table 1", "0.929006", "0.021912", "79 of 100", "3 of 3", "Figure 8", "Figure 9", "false passages",
        "Times", "0.5 m and 5 degrees", "calibration", small_experiment[1].settings["mapmeld"],
    ):  # fmt: skip
        assert wanted in text, wanted
    kept = json.loads((copy / "results.json").read_text())
    assert kept["successes"]["alphabet"]["right"] == 3
    assert kept["table_1"]["single mappings"]["mean"] == pytest.approx(
        sum(row.accuracy for row in small_experiment[1].mappings) / 3
    )


def test_failures_are_shown_with_cause_and_picture_and_old_pictures_go(copy: Path) -> None:
    path = copy / "matchings" / "alphabet" / "01-1-2.json"
    row = read_row(path, MatchingRow)
    row = replace(row, right=False, accuracy=None, first_right=None, T_1_2=(0.0, 0.0, 0.0))
    write_row(path, replace(row, cause="misled: <wrong> is more alike"))
    (copy / "figures").mkdir()
    (copy / "figures" / "failure_old.png").write_bytes(b"")
    text = write_report(copy, read_results(copy)).read_text(encoding="utf-8")
    assert "misled: &lt;wrong&gt; is more alike; accepted all the same" in text
    assert "1 (1 misled)" in text
    assert "2 of 3" in text
    names = [p.name for p in (copy / "figures").glob("failure*")]
    assert names == ["failure_alphabet_01_1_2.png"]


def test_a_report_of_failures_alone_can_be_written(copy: Path) -> None:
    for path in [*(copy / "joins").glob("*/*.json"), *(copy / "navigability").glob("[ac]*/*.json")]:
        path.unlink()
    for path in (copy / "matchings").glob("*/*.json"):
        row = read_row(path, MatchingRow)
        row = replace(row, right=False, accuracy=None, first_right=None, T_1_2=None, over_time=())
        write_row(path, replace(row, probability=None, cause="nothing found: no corners"))
    text = write_report(copy, read_results(copy)).read_text(encoding="utf-8")
    assert "0 of 3" in text
    assert "There is no successful matching by" in text
