"""``mapmeld follow``: what is shown, what is written, and what happens when it cannot be."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import pytest
from drawing import cut, office, school, seen_from
from listing import contents
from running import run, run_for_real

import mapmeld
from mapmeld.cli import follow as command
from mapmeld.cli.follow_outputs import Interval, Outputs, Snapshots, read_interval
from mapmeld.grid import OccupancyGrid
from mapmeld.history import STRATEGIES, Step, follow
from mapmeld.io import save
from mapmeld.io.history import read_history
from mapmeld.se2 import Pose2

RECORDING = Path(__file__).parents[2] / "examples" / "recording" / "two_robots.mcap"
T_2_PLACE = Pose2(3.0, -2.0, 0.7)
TOPICS = ("--topics", "/robot_1/map", "/robot_2/map")


def write_states(folder: Path, states: dict[str, OccupancyGrid]) -> Path:
    folder.mkdir()
    for name, grid in states.items():
        save(grid, folder / f"{name}.yaml")
    return folder


@pytest.fixture
def histories(tmp_path: Path) -> tuple[Path, Path]:
    """Robot 1 sees more and more; robot 2, of the same place, a little and then everything."""
    place = office(0.1)
    first = {str(10 * k): cut(place, 0, 0, x, 12) for k, x in enumerate((4.0, 10.0, 16.0))}
    second = {"5": seen_from(cut(place, 13, 8, 16, 12), T_2_PLACE), "15": seen_from(place, T_2_PLACE)}
    return write_states(tmp_path / "a", first), write_states(tmp_path / "b", second)


@pytest.fixture
def elsewhere(tmp_path: Path) -> Path:
    return write_states(tmp_path / "school", {"0": cut(school(0.1), 0, 0, 8, 9), "7": school(0.1)})


# ---------------------------------------------------------------------- what is shown
def test_a_line_for_every_state_and_the_outcome(histories: tuple[Path, Path]) -> None:
    done = run("follow", *histories)
    assert (done.code, done.err) == (0, "")
    lines = done.out.splitlines()
    assert lines[0].split() == ["states", "time", "[s]", "overlap", "probability", "verdict", "change", "why"]
    assert lines[1].split()[:7] == ["1", "+", "0", "0.0", "-", "-", "undecided"]
    times = [line.split()[3] for line in lines[1:6]]
    assert times == ["0.0", "5.0", "10.0", "15.0", "20.0"]
    assert sum(" found " in line for line in lines) == 1
    assert " confirmed " in lines[5]
    assert any(line.startswith("T_1_2 ") for line in lines)
    assert any(line.startswith("verdict      accepted: ") for line in lines)


def test_nothing_accepted_is_exit_code_1(
    histories: tuple[Path, Path], elsewhere: Path, tmp_path: Path
) -> None:
    done = run("follow", histories[0], elsewhere, "-o", tmp_path / "out")
    assert done.code == 1
    assert "No match is accepted, so nothing is merged." in done.out
    assert "T_1_2 " not in done.out, "a guess is no result"
    assert "std dev" not in done.out
    assert contents(tmp_path / "out") == {"transform.json"}
    written = json.loads((tmp_path / "out" / "transform.json").read_text())
    assert (written["standing"], written["T_1_2"], written["changes"]) == ("undecided", None, [])


def test_json_is_a_line_for_every_state_and_one_for_the_outcome(histories: tuple[Path, Path]) -> None:
    done = run("follow", *histories, "--json")
    assert (done.code, done.err) == (0, "")
    *steps, outcome = [json.loads(line) for line in done.out.splitlines()]
    assert [step["schema"] for step in steps] == ["mapmeld.follow.step/1"] * 5
    assert [step["process"] for step in steps] == [1, 2, 1, 2, 1]
    assert [step["stamp"] for step in steps] == [0, 5, 10, 15, 20]
    assert steps[0]["best"] is None
    assert steps[-1]["best"]["probability"] > 0.95
    assert outcome["schema"] == "mapmeld.follow/1"
    assert outcome["states"] == [3, 2]
    assert outcome["processes"] == {"1": str(histories[0]), "2": str(histories[1])}
    assert [change["change"] for change in outcome["changes"]] == ["found"]
    truth = T_2_PLACE.inverse()
    assert outcome["T_1_2"]["x"] == pytest.approx(truth.x, abs=0.05)
    assert outcome["T_1_2"]["theta"] == pytest.approx(truth.theta, abs=0.01)


def test_strategy_and_method(histories: tuple[Path, Path]) -> None:
    done = run(
        "follow",
        *histories,
        "--strategy",
        "paper",
        "--method",
        "alphabet",
        "--set",
        "candidates=40",
        "--json",
    )
    outcome = json.loads(done.out.splitlines()[-1])
    assert (outcome["strategy"], outcome["method"]) == ("paper", "alphabet")
    assert outcome["parameters"]["candidates"] == 40
    assert outcome["best"]["probability"] is None


def test_the_choices_of_the_option_are_those_there_are() -> None:
    assert [str(strategy) for strategy in command.Strategy] == list(STRATEGIES)


# ---------------------------------------------------------------------- recordings
def test_a_recording_with_the_maps_of_two_robots() -> None:
    named, found = run("follow", RECORDING, *TOPICS), run("follow", RECORDING)
    assert named.code == found.code == 0
    assert named.out == found.out, "two topics with maps need not be named"
    assert "15 + 19" in named.out


def test_topics_of_recordings_and_folders_can_be_mixed(tmp_path: Path) -> None:
    assert run("bag", "export", RECORDING, "--topic", "/robot_2/map", "-o", tmp_path / "h").code == 0
    done = run("follow", f"{RECORDING}#/robot_1/map", tmp_path / "h", "--json")
    assert done.code == 0
    outcome = json.loads(done.out.splitlines()[-1])
    assert outcome["processes"] == {"1": f"{RECORDING}#/robot_1/map", "2": str(tmp_path / "h")}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["a"], "a is no recording; name a second history"),
        (["a", "b", "c"], "two histories are needed, not 3"),
        (["a", "b", *TOPICS], "of two, name each as RECORDING#topic"),
        (["a", "a"], "a is named twice; two robots are needed"),
        (["a", "b/../a"], "is named twice"),
        ([str(RECORDING), "--topics", "/robot_1/map", "/robot_1/map"], "/robot_1/map is named twice"),
        ([f"{RECORDING}#/robot_1/map"] * 2, "is named twice"),
        (["a", "nowhere"], "nowhere: there is no such folder"),
        (["a", f"{RECORDING}#/robot_1/map@30"], "leave out what follows '@'"),
        ([f"{RECORDING}#/robot_1/map"], "is one map; name a second one"),
        ([str(RECORDING), "--topics", "/robot_1/map", "/nothing"], "/nothing"),
        (["a", "b", "--every", "3"], "snapshots go to the folder of -o"),
        (["a", "b", "-o", "o", "--every", "often"], "'often'"),
        (["a", "b", "-o", "o", "--every", "0"], "'0'"),
        (["a", "b", "--strategy", "luck"], "luck"),
        (["a", "b", "--method", "luck"], "luck"),
        (["a", "b", "--strip", "s.jpg"], ".png"),
        (["a", "b", "--gif", "s.png"], ".gif"),
        (["a", "b", "--rerun", "s.mcap"], ".rrd"),
        (["a", "b", "-o", "a"], "is not empty"),
        (["a", "b", "-o", "no/o"], "does not exist"),
        (["a", "b", "--strip", "no/s.png"], "does not exist"),
    ],
)
def test_what_cannot_be_done_is_one_line(
    histories: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch, arguments: list[str], said: str
) -> None:
    monkeypatch.chdir(histories[0].parent)
    before = contents(histories[0].parent)
    done = run("follow", *arguments)
    assert done.code == 2
    assert said in done.line
    assert contents(histories[0].parent) == before


def test_a_recording_of_one_map_asks_for_topics(tmp_path: Path) -> None:
    import mcap.writer

    with (tmp_path / "none.mcap").open("wb") as out:
        writer = mcap.writer.Writer(out)
        writer.start(profile="", library="")
        writer.finish()  # type: ignore[no-untyped-call]
    done = run("follow", tmp_path / "none.mcap")
    assert done.code == 2
    assert "has no maps; choose two topics: --topics T1 T2" in done.line


def test_a_damaged_state_is_one_line_and_nothing_is_written(
    histories: tuple[Path, Path], tmp_path: Path
) -> None:
    (histories[1] / "15.pgm").write_bytes(b"P5 junk")
    before = contents(tmp_path)
    done = run("follow", *histories, "-o", tmp_path / "o", "--every", "1", "--strip", tmp_path / "s.png")
    assert done.code == 2
    assert "15.pgm" in done.line
    assert contents(tmp_path) == before


# ---------------------------------------------------------------------- what is written
def test_everything_that_can_be_written(histories: tuple[Path, Path], tmp_path: Path) -> None:
    out = tmp_path / "out"
    pictures = [tmp_path / "strip.png", tmp_path / "film.gif", tmp_path / "maps.rrd"]
    options = ["--strip", pictures[0], "--gif", pictures[1], "--rerun", pictures[2]]
    done = run("follow", *histories, "-o", out, "--every", "1", *options)
    assert (done.code, done.err) == (0, "")
    assert contents(out) >= {"transform.json", "merged.yaml", "merged.pgm", "snapshots/times.txt"}
    merged = mapmeld.load(out / "merged.yaml")
    snapshots = read_history(out / "snapshots")
    assert snapshots.stamps == (15.0, 20.0), "from the match on"
    assert snapshots[-1] == merged
    written = json.loads((out / "transform.json").read_text())
    assert written["schema"] == "mapmeld.follow/1"
    names = ("merged.yaml", "merged.pgm", "snapshots", "transform.json")
    assert written["files"] == [*map(str, pictures), *(str(out / name) for name in names)]
    assert all(Path(file).exists() for file in written["files"])
    assert all(file in done.out for file in written["files"])
    assert cv2.imread(str(pictures[0])) is not None
    assert pictures[1].read_bytes().startswith(b"GIF8")
    assert pictures[2].stat().st_size > 1000


def test_what_cannot_be_drawn_takes_nothing_else_with_it(
    histories: tuple[Path, Path], tmp_path: Path
) -> None:
    """Robot 1 begins anew a thousand kilometres away: no picture holds both."""
    save(mapmeld.load(histories[0] / "20.yaml").moved(Pose2(1e6, 0, 0)), histories[0] / "30.yaml")
    pictures = ["--strip", tmp_path / "s.png", "--gif", tmp_path / "g.gif", "--rerun", tmp_path / "r.rrd"]
    done = run("follow", *histories, "-o", tmp_path / "o", *pictures)
    assert done.code == 2
    assert [line.partition("mapmeld: ")[2] for line in done.err.splitlines()] == [
        f"{tmp_path / name}: the maps lie too far apart, over all states, for one picture"
        for name in ("s.png", "g.gif")
    ]
    assert "T_1_2 " in done.out
    written = json.loads((tmp_path / "o" / "transform.json").read_text())
    assert str(tmp_path / "r.rrd") in written["files"]
    assert str(tmp_path / "s.png") not in written["files"]
    assert contents(tmp_path) >= {"r.rrd", "o/transform.json", "o/merged.yaml"}
    assert not contents(tmp_path) & {"s.png", "g.gif"}


def test_pictures_that_the_disk_refuses_take_nothing_else_with_them(
    histories: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    strip = tmp_path / "s.png"
    finish = Outputs.finish

    def meanwhile(self: Outputs, *args: Any) -> Any:
        strip.write_text("another's")
        return finish(self, *args)

    monkeypatch.setattr(Outputs, "finish", meanwhile)
    done = run("follow", *histories, "-o", tmp_path / "o", "--strip", strip, "--gif", tmp_path / "g.gif")
    assert done.code == 2
    assert "exists already" in done.line
    assert strip.read_text() == "another's"
    assert (tmp_path / "o" / "transform.json").exists()
    assert not (tmp_path / "g.gif").exists(), "all pictures or none"


def test_a_second_run_replaces_all_of_the_first(
    histories: tuple[Path, Path], elsewhere: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    assert run("follow", *histories, "-o", out, "--every", "1").code == 0
    (out / "notes.txt").write_text("mine")
    refused = run("follow", histories[0], elsewhere, "-o", out)
    assert refused.code == 2
    assert "not empty" in refused.line
    assert run("follow", histories[0], elsewhere, "-o", out, "--force").code == 1
    assert contents(out) == {"notes.txt", "transform.json"}, "no merged map of another run"


def test_snapshots_by_seconds_and_by_states(histories: tuple[Path, Path], tmp_path: Path) -> None:
    steps = list(follow(*histories))

    def taken(every: Interval, steps: list[Step]) -> list[str]:
        folder = tmp_path / f"s{len(os.listdir(tmp_path))}"  # noqa: PTH208
        snapshots = Snapshots(folder, every)
        for step in steps:
            snapshots.take(step)
        return sorted(path.stem for path in folder.glob("*.yaml")) if snapshots.finish() else []

    assert taken(Interval(states=2), steps) == ["state_00004"]
    assert taken(Interval(seconds=8.0), steps) == ["state_00005"]
    assert taken(Interval(seconds=1000.0), steps) == []
    late = [
        replace(steps[-1], number=n, stamp=t) for n, t in enumerate([0.0, 100.0, 105.0, 112.0, 119.0, 120.0])
    ]
    # Due every 10 s from the first; after a gap the next one is due on the beat, not at once.
    assert taken(Interval(seconds=10.0), late) == ["state_00001", "state_00003", "state_00005"]
    timeless = [replace(step, stamp=None) for step in steps]
    assert taken(Interval(seconds=1.0), timeless) == []
    assert taken(Interval(states=1), timeless) == ["state_00004", "state_00005"]


@pytest.mark.parametrize(
    ("text", "interval"),
    [("10", Interval(states=10)), ("30s", Interval(seconds=30.0)), ("0.5s", Interval(seconds=0.5))],
)
def test_intervals(text: str, interval: Interval) -> None:
    assert read_interval(text) == interval


@pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")
def test_an_interruption_leaves_nothing_half_written(histories: tuple[Path, Path], tmp_path: Path) -> None:
    place = mapmeld.load(histories[1] / "15.yaml")
    for k in range(200):
        save(place.moved(Pose2(1e-3 * k, 0, 0)), histories[1] / f"{20 + k}.yaml")
    before = contents(tmp_path)
    options = ["-o", "o", "--every", "1", "--strip", "s.png", "--gif", "g.gif", "--rerun", "r.rrd"]
    process = subprocess.Popen(
        [sys.executable, "-m", "mapmeld", "follow", "a", "b", *options],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    for line in process.stdout:  # rows come while it works, into a pipe too
        if " confirmed " in line:
            break
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert said == "mapmeld: interrupted, nothing more is written\n"
    assert contents(tmp_path) == before


def test_for_real(histories: tuple[Path, Path], tmp_path: Path) -> None:
    done = run_for_real("follow", "a", "b", "-o", "o", cwd=tmp_path)
    assert (done.code, done.err) == (0, "")
    assert contents(tmp_path / "o") == {"transform.json", "merged.yaml", "merged.pgm"}


def test_on_a_terminal_rows_are_lines_and_a_sign_of_life_shows(
    histories: tuple[Path, Path], tmp_path: Path
) -> None:
    if os.name != "posix":
        pytest.skip("a matter of POSIX")
    import pty

    shutil.copytree(histories[0], tmp_path / "c")
    master, slave = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "mapmeld", "follow", "a", "b"],
        cwd=tmp_path, stdout=slave, stderr=slave, env={**os.environ, "COLUMNS": "80", "TERM": "xterm"},
    )  # fmt: skip
    os.close(slave)
    shown = b""
    begin = time.monotonic()
    while time.monotonic() - begin < 120:
        try:
            shown += os.read(master, 1 << 16)
        except OSError:
            break
    assert process.wait() == 0
    plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown.decode()).replace("\r", "\n")
    rows = [line for line in plain.splitlines() if re.match(r" *\d \+ \d", line)]
    assert len(rows) == 5
    assert all(len(row.rstrip()) <= 80 for row in rows)
    assert any(row.rstrip().endswith("…") for row in rows)
    assert "Waiting for the next state" in plain
    assert b"\x1b[" in shown, "colours"
