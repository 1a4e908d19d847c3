"""``mapmeld slam`` from the log to the files."""

from __future__ import annotations

import gzip
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from running import run

from mapmeld.io import load

LOG = Path(__file__).parents[2] / "examples" / "slam" / "office.log.gz"
QUICK = ("--set", "particles=4", "--set", "lskip=2")


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first 60 scans of the example, 18 s."""
    path = tmp_path_factory.mktemp("slam") / "short.log"
    lines = gzip.decompress(LOG.read_bytes()).decode().splitlines(keepends=True)
    path.write_text("".join(lines[:61]), encoding="utf-8")
    return path


def files(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def test_map_trajectory_and_history_are_written(log: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = run("slam", log, "-o", out, "--history", *QUICK, "--set", "linearUpdate=0.3")
    assert (done.code, done.err) == (0, "")
    assert "scans used over" in done.out
    assert f"Written to {out}:" in done.out
    grid = load(out / "map.yaml")
    path = np.loadtxt(out / "trajectory.txt")
    col, row = np.floor(grid.metres_to_lattice(path[:, 1:3])).astype(int).T
    assert not grid.occupied[row, col].any()  # where the robot was, nothing is
    assert grid.free[row, col].mean() > 0.7  # at the start, it does not see what is below it
    lines = (out / "history" / "times.txt").read_text().splitlines()
    times = [line.split() for line in lines if not line.startswith("#")]
    states = [(name, float(stamp)) for name, stamp in times]
    assert 3 < len(states) <= 19
    assert f"{len(states)} states" in done.out
    assert load(out / "history" / states[-1][0]) == grid
    assert states[-1][1] == pytest.approx(path[-1, 0])


def test_the_same_seed_gives_the_same_files_with_or_without_history(log: Path, tmp_path: Path) -> None:
    run("slam", log, "-o", tmp_path / "a", "--history", *QUICK, "--seed", 5)
    run("slam", log, "-o", tmp_path / "b", *QUICK, "--seed", 5)
    assert files(tmp_path / "b") == ["map.pgm", "map.yaml", "trajectory.txt"]
    for name in files(tmp_path / "b"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_force_replaces_what_an_earlier_run_wrote_and_nothing_else(log: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert run("slam", log, "-o", out, "--history", *QUICK).code == 0
    (out / "mine.txt").write_text("mine")
    (out / "history" / "notes.md").write_text("mine")
    refused = run("slam", log, "-o", out, *QUICK)
    assert refused.code == 2
    assert "is not empty" in refused.line
    assert run("slam", log, "-o", out, "--force", *QUICK).code == 0
    assert files(out) == ["history/notes.md", "map.pgm", "map.yaml", "mine.txt", "trajectory.txt"]
    (out / "history" / "notes.md").unlink()
    assert run("slam", log, "-o", out, "--force", "--history", *QUICK).code == 0
    assert run("slam", log, "-o", out, "--force", *QUICK).code == 0
    assert not (out / "history").exists()


def test_files_of_the_node_and_single_settings(log: Path, tmp_path: Path) -> None:
    params = tmp_path / "gmapping.yaml"
    params.write_text("particles: 2\ndelta: 0.2\nodom_frame: odom\nscan_topic: scan\n")
    done = run("slam", log, "-o", tmp_path / "a", "--params", params, "--set", "delta=0.1")
    assert done.code == 0
    assert (
        done.line == f"mapmeld: note: {params}: of the ROS node alone, and not used: odom_frame, scan_topic"
    )
    assert load(tmp_path / "a" / "map.yaml").resolution == 0.1


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (("--set", "particels=3"), "slam_gmapping has no setting 'particels'; did you mean particles"),
        (("--set", "particles=x"), "particles must be a whole number, not 'x'"),
        (("--set", "help"), "slam_gmapping has, by default, maxUrange=None"),
        (("--set", "particles=0"), "parameters of slam_gmapping: particles must be more than 0"),
        (("--params", "none.yaml"), "none.yaml: no such file"),
        (("--scan", "/scan"), "is no ROS recording, so it has no topics"),
        (("--every", "0"), "--every"),
        (("--seed", "-1"), "--seed"),
    ],
)
def test_what_is_wrong_is_one_line_and_nothing_is_written(
    log: Path, tmp_path: Path, arguments: tuple[str, ...], problem: str
) -> None:
    done = run("slam", log, "-o", tmp_path / "out", *arguments)
    assert done.code == 2
    assert problem in done.line
    assert files(tmp_path) == []


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ("hello\n", "no CARMEN log with scans"),
        ("FLASER 2 90 90 0 0 0 0 0 0 1.0 h 1\n", "has no scan from which a map could be made"),
        ("FLASER 2 1 1 0 0 0 0 0 0 1.0 h 1\nFLASER 2 1 1 0 0 0 9e9 0 0 2.0 h 1\n", "the odometry jumps"),
        ("FLASER 2 1 1 0 0 0 0 0 0 1.0 h 1\nFLASER 2 1 x 0 0 0 0 0 0 2.0 h 1\n", "line 2 is no FLASER line"),
    ],
)
@pytest.mark.parametrize("history", [(), ("--history",)], ids=["", "history"])
def test_bad_logs_leave_nothing_behind(
    tmp_path: Path, content: str, problem: str, history: tuple[str, ...]
) -> None:
    log = tmp_path / "bad.log"
    log.write_text(content)
    done = run("slam", log, "-o", tmp_path / "out", *history)
    assert done.code == 2
    assert problem in done.line
    assert files(tmp_path) == ["bad.log"]


def test_without_numba_the_extra_is_named(log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "numba", None)
    done = run("slam", log, "-o", tmp_path / "out")
    assert done.code == 2
    assert 'pip install "mapmeld[sim]"' in done.line
    assert files(tmp_path) == []


def test_what_was_passed_over_is_said(log: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.log"
    cut.write_text(log.read_text(encoding="utf-8")[:-400], encoding="utf-8")
    done = run("slam", cut, "-o", tmp_path / "out", *QUICK)
    assert done.code == 0
    assert done.line == f"mapmeld: note: {cut}: a last line that is cut off"


@pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")
@pytest.mark.parametrize("ending", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_an_interruption_is_one_line_and_leaves_nothing(tmp_path: Path, ending: str) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "mapmeld", "slam", LOG, "-o", "out",
         "--set", "particles=60", "--set", "linearUpdate=0.1"],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    deadline = time.monotonic() + 120
    while not list(tmp_path.iterdir()) and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(0.5)  # almost all of the time from here on is spent in compiled code
    process.send_signal(getattr(signal, ending))
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (130, "")
    assert err == "mapmeld: interrupted, nothing more is written\n"
    assert list(tmp_path.iterdir()) == []
