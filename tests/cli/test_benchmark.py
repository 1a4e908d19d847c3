import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from listing import contents
from running import Outcome, run, run_for_real
from tiny_dataset import T_1_2, pair, write_dataset, write_pairs

from mapmeld.evaluation import Trial, TrialRow, run_trials
from mapmeld.evaluation.store import read_rows


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_dataset(tmp_path / "tiny")


def benchmark(*arguments: object) -> Outcome:
    return run("benchmark", *arguments, "--methods", "alphabet")


def cells(outcome: Outcome) -> list[list[str]]:
    """Return the table's lines for data sets."""
    lines = outcome.out.partition("Written:")[0].splitlines()
    return [line.split() for line in lines if " alphabet " in line]


def test_the_table(folder: Path) -> None:
    outcome = benchmark(folder)
    assert outcome.code == 0
    assert outcome.err == ""
    (line,) = cells(outcome)
    assert line[:10] == ["tiny", "alphabet", "2", "/", "1", "100.0", "100.0", "0.0", "0", "/"]


def test_what_is_written(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    outcome = benchmark(folder, "--out", out, "--turn", 2, "--seed", 4, "--tolerance", "1,10")
    assert outcome.code == 0
    files = contents(out)
    (part,) = {name for name in files if name.startswith("rows/")}
    assert files - {part} == {
        "settings.yaml",
        "table.md",
        "success_versus_overlap.png",
        "precision_recall.png",
    }
    assert all(str(out / name) in outcome.out for name in files - {part})
    rows = read_rows(out / "rows")
    assert [row.pair for row in rows] == ["one-two"] * 2 + ["one-three"] * 2 + ["one-other"] * 2
    assert {row.tolerance_translation for row in rows} == {1.0}
    assert "| tiny | alphabet | 4 / 2 | 100.0 |" in (out / "table.md").read_text()
    settings = yaml.safe_load((out / "settings.yaml").read_text())
    assert settings["datasets"] == [
        {"name": "tiny", "file": str(folder / "pairs.json"), "pairs": 3, "tolerance": [1.0, 10.0]}
    ]
    assert (settings["turn"], settings["seed"], settings["workers"]) == (2, 4, 1)
    assert settings["methods"]["alphabet"]["corners"] == 30


def test_the_same_again_runs_nothing_again(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    benchmark(folder, "--out", out)
    before = read_rows(out / "rows")
    again = benchmark(folder, "--out", out)
    assert again.code == 0
    assert again.line == f"mapmeld: {out}: 3 of 3 trials are done already"
    assert read_rows(out / "rows") == before


def test_more_trials_are_added(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    benchmark(folder, "--out", out, "--turn", 1)
    more = benchmark(folder, "--out", out, "--turn", 2)
    assert "3 of 6 trials are done already" in more.line
    other = benchmark(folder, "--out", out, "--swap")
    assert "0 of 3 trials are done already (6 rows of other settings or other code)" in other.line
    assert len(read_rows(out / "rows")) == 9
    assert cells(other)[0][2:5] == ["2", "/", "1"]  # the table shows this run only


def test_force_starts_afresh(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    benchmark(folder, "--out", out, "--turn", 2)
    first = read_rows(out / "rows")
    (out / "notes.txt").write_text("mine")
    forced = benchmark(folder, "--out", out, "--force")
    assert forced.err == ""
    rows = read_rows(out / "rows")
    assert len(rows) == 3
    assert not {row.key for row in rows} & {row.key for row in first}
    assert (out / "notes.txt").read_text() == "mine"


def test_a_picture_without_anything_to_show_goes_away(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    benchmark(folder, "--out", out)
    (out / "reliability.png").write_bytes(b"of a run whose method stated probabilities")
    benchmark(folder, "--out", out)
    assert "reliability.png" not in contents(out)


def test_several_data_sets_with_a_tolerance_each(folder: Path) -> None:
    write_pairs(folder, [pair("a", "one", "two", T_1_2)], "pairs_easy.json")
    options = ("--tolerance", "0.0001,0.0001", "--tolerance", "tiny:pairs_easy=1,10")
    lines = cells(benchmark(folder, folder / "pairs_easy.json", *options))
    assert [(line[0], line[6]) for line in lines] == [("tiny", "0.0"), ("tiny:pairs_easy", "100.0")]


def test_the_list_of_pairs_can_have_another_name(folder: Path) -> None:
    write_pairs(folder, [pair("a", "one", "two", T_1_2)], "pairs_easy.json")
    assert cells(benchmark(folder, "--pairs", "pairs_easy.json"))[0][:5] == [
        *("tiny:pairs_easy", "alphabet", "1", "/", "0")
    ]


def test_the_ratio_to_another_method(folder: Path) -> None:
    outcome = benchmark(folder, "--time-against", "alphabet")
    assert "ratio" in outcome.out
    assert 0.02 < float(cells(outcome)[0][-1]) < 50


class Breaking:
    """The real `run_trials`, but the first answer of each run becomes a failure while `broken` is set."""

    def __init__(self) -> None:
        self.broken = True

    def __call__(self, trials: Sequence[Trial], **options: Any) -> tuple[TrialRow, ...]:
        keep = options.pop("keep", None)
        rows = run_trials(trials, **options)
        if self.broken:
            rows = (replace(rows[0], verdict="error", reason="ValueError: oh", right=False), *rows[1:])
        if keep:
            keep(rows)
        return rows


def test_failed_trials_are_pointed_out_and_tried_again(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    breaking = Breaking()
    monkeypatch.setattr("mapmeld.evaluation.run_trials", breaking)
    outcome = benchmark(folder, "--out", tmp_path / "out")
    assert outcome.code == 0
    assert (
        outcome.line == "mapmeld: alphabet failed on 1 of 3 trials, the first time on one-two: ValueError: oh"
    )
    breaking.broken = False
    again = benchmark(folder, "--out", tmp_path / "out")
    assert "2 of 3 trials are done already" in again.line
    assert next(row.verdict for row in read_rows(tmp_path / "out" / "rows")) == "accepted"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nowhere"], "nowhere: there is no such folder or file"),
        (["tiny", "--pairs", "nothing.json"], "the folder has no nothing.json"),
        (["tiny", "--methods", "alphabet,fortune"], "'fortune'"),
        (["tiny", "--methods", "alphabet,alphabet"], "two times the same method"),
        (["tiny", "tiny"], "two times the same data set"),
        (["tiny", "--time-against", "fortune"], "'fortune'"),
        (["tiny", "--tolerance", "1"], "--tolerance needs metres and degrees"),
        (["tiny", "--tolerance", "1,x"], "--tolerance needs metres and degrees"),
        (["tiny", "--tolerance", "0,5"], "a positive number of metres"),
        (["tiny", "--tolerance", "house=1,5"], "a tolerance for house"),
        (["tiny", "--workers", "0"], "--workers"),
        (["tiny", "--limit", "0"], "--limit"),
        (["tiny", "--out", "a/b"], "the folder a does not exist"),
        (["tiny", "--out", "tiny"], "is not empty"),
        (["tiny", "--out", "tiny/pairs.json"], "is not a folder"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    before = contents(tmp_path)
    outcome = run("benchmark", *arguments)
    assert outcome.code == 2
    assert said in outcome.line
    assert contents(tmp_path) == before


def test_a_missing_map_is_known_before_anything_is_written(folder: Path, tmp_path: Path) -> None:
    (folder / "maps" / "other.pgm").unlink()
    outcome = benchmark(folder, "--out", tmp_path / "out")
    assert outcome.code == 2
    assert "other.pgm" in outcome.line
    assert not (tmp_path / "out").exists()


def test_damaged_rows_are_named(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    benchmark(folder, "--out", out)
    (part,) = (out / "rows").iterdir()
    part.write_bytes(part.read_bytes()[:100])
    outcome = benchmark(folder, "--out", out)
    assert outcome.code == 2
    assert f"{part}: damaged" in outcome.line
    assert benchmark(folder, "--out", out, "--force").code == 0


@pytest.mark.parametrize("module", ["pyarrow.parquet", "matplotlib.figure"])
def test_without_the_extra_nothing_is_run_that_could_not_be_kept(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    outcome = benchmark(folder, "--out", tmp_path / "out")
    assert outcome.code == 2
    assert 'pip install "mapmeld[benchmark]"' in outcome.line
    assert benchmark(folder).code == 0  # the table alone needs neither


# ---------------------------------------------------------------------- ended from outside
@contextmanager
def endless_run(folder: Path, out: Path) -> Iterator[subprocess.Popen[str]]:
    """Start a run of thousands of trials and wait until some are kept."""
    command = [sys.executable, "-m", "mapmeld", "benchmark", str(folder), "--methods", "alphabet"]
    command += ["--turn", "1000", "--out", str(out)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        try:
            patience = time.monotonic() + 120
            while not list(out.glob("rows/rows-*.parquet")):
                assert process.poll() is None, process.communicate()
                assert time.monotonic() < patience
                time.sleep(0.05)
            yield process
        finally:
            process.kill()


@pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")
@pytest.mark.parametrize("whole_group", [True, False], ids=["Ctrl-C", "parent only"])
def test_an_interrupted_run_says_how_to_go_on(folder: Path, tmp_path: Path, whole_group: bool) -> None:
    out = tmp_path / "out"
    with endless_run(folder, out) as process:
        if whole_group:  # as a terminal does it
            os.killpg(process.pid, signal.SIGINT)
        else:
            process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert (
        err
        == f"mapmeld: interrupted; what was done is in {out / 'rows'}, the same command goes on from there\n"
    )
    assert read_rows(out / "rows"), "how many is a matter of the machine"


def test_a_killed_run_goes_on(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with endless_run(folder, out) as process:
        process.kill()
        process.communicate()
    kept = {row.key: row for row in read_rows(out / "rows")}
    outcome = run_for_real(
        "benchmark", folder, "--methods", "alphabet", "--turn", 3, "--out", out, cwd=tmp_path
    )
    assert outcome.code == 0, outcome.err
    found = re.search(r"(\d+) of 9 trials are done already", outcome.err)
    assert found
    assert int(found[1]) >= 1  # how many is a matter of the machine
    rows = read_rows(out / "rows")
    assert len({row.key for row in rows}) == len(rows) == len(kept) + 9 - int(found[1])
    assert all(kept[row.key] == row for row in rows if row.key in kept)
    assert [row.pair for row in rows[:9]] == ["one-two"] * 3 + ["one-three"] * 3 + ["one-other"] * 3
