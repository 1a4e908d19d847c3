import json
import math
import os
import pty
import re
import select
import signal
import subprocess
import sys
import termios
import time
from pathlib import Path
from typing import Any

import pytest
from listing import contents
from rosbags.highlevel import AnyReader
from running import run, run_for_real

from mapmeld.cli.terminal import plan_around
from mapmeld.se2 import Pose2
from mapmeld.simulation import Environment, true_map
from mapmeld.simulation.recording_file import read_drive
from mapmeld.simulation.vrep_files import read_map_text

MAP = """\
8:1:1:1:4:1:1:1:7
0:-2:-2:-2:0:-2:-2:-2:0
0:-2:-2:-2:-1:-2:-2:-2:0
0:-2:-2:-2:0:-2:-2:-2:0
9:1:1:1:5:1:1:1:6
"""


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("map.txt").write_text(MAP)
    return tmp_path


def topics(path: str) -> dict[str, int]:
    with AnyReader([Path(path)]) as reader:
        return {c.topic: c.msgcount for c in reader.connections}


def simulated(*options: object) -> str:
    outcome = run("simulate", "map.txt", "--furniture", 0, "-o", "run.mcap", *options)
    assert outcome.code == 0, outcome.err
    return outcome.out


def test_a_tour(place: Path) -> None:
    said = simulated("--picture", "run.png")
    assert contents(place) == {"map.txt", "run.mcap", "run.png"}
    assert "9 x 5 m, 2 rooms, 1 doors" in said
    metres, seconds = (float(re.search(p, said)[1]) for p in (r"Drove ([\d.]+) m", r"Simulated ([\d.]+) s"))  # type: ignore[index]
    assert metres > 3
    found = topics("run.mcap")
    assert found["/scan"] == pytest.approx(seconds * 10, abs=2)
    assert found["/odom"] == pytest.approx(seconds * 20, abs=2)
    assert f"({found['/scan']} scans)" in said


def test_mappings_differ_and_the_same_is_the_same(place: Path) -> None:
    simulated("--duration", 1)
    first = Path("run.mcap").read_bytes()
    simulated("--duration", 1, "--force")
    assert Path("run.mcap").read_bytes() == first
    start, _ = read_drive("run.mcap")
    simulated("--duration", 1, "--force", "--mapping", 2)
    assert read_drive("run.mcap")[0].distance_to(start)[0] > 0.5


def test_several_robots() -> None:
    said = simulated("--robots", 2, "--duration", 1)
    assert "Robot 1 drove" in said
    assert "Robot 2 drove" in said
    assert {"/robot_1/scan", "/robot_2/scan"} <= set(topics("run.mcap"))


def test_robots_that_map_on_the_way_are_followed() -> None:
    Path("few.yaml").write_text("slam_gmapping: {particles: 3, base_frame: base}\n")
    outcome = run(
        "simulate", "--seed", 5, "--size", "14x12", "-o", "run.mcap", "--robots", 2, "--slam",
        "--duration", 20, "--slam-params", "few.yaml",
    )  # fmt: skip
    assert outcome.code == 0
    assert "base_frame" in outcome.line
    found = topics("run.mcap")
    count = found["/robot_1/map"], found["/robot_2/map"]
    assert min(count) >= 8
    assert f"{sum(count)} maps)" in outcome.out
    with AnyReader([Path("run.mcap")]) as reader:
        maps = [c for c in reader.connections if c.topic == "/robot_2/map"]
        stamps = [content(reader, c, raw).header for c, _, raw in reader.messages(maps)]
        # No more than one in a second, each of the second before.
        seconds = [h.stamp.sec + h.stamp.nanosec / 1e9 for h in stamps]
        times = [t / 1e9 for _, t, _ in reader.messages(maps)]
        assert {h.frame_id for h in stamps} == {"robot_2/map"}
        assert len({int(s) for s in seconds}) == len(seconds)
        assert all(0 <= t - s <= 1.0 for t, s in zip(times, seconds, strict=True))
        frames = set()
        for c, _, raw in reader.messages([c for c in reader.connections if c.topic == "/tf"]):
            frames |= {(t.header.frame_id, t.child_frame_id) for t in content(reader, c, raw).transforms}
    assert ("robot_2/map", "robot_2/odom") in frames
    followed = run("follow", "run.mcap", "--json")
    assert followed.code == 0, followed.err
    last = json.loads(followed.out.splitlines()[-1])
    assert last["standing"] == "accepted"
    starts = true_starts("run.mcap")
    off, turned = (starts[0].inverse() @ starts[1]).distance_to(Pose2(**last["T_1_2"]))
    assert off < 0.2
    assert turned < 0.05


def content(reader: AnyReader, connection: Any, raw: bytes) -> Any:
    return reader.deserialize(raw, connection.msgtype)


def true_starts(path: str) -> list[Pose2]:
    found: dict[str, Pose2] = {}
    with AnyReader([Path(path)]) as reader:
        for c, _, raw in reader.messages(
            [c for c in reader.connections if c.topic.endswith("/ground_truth")]
        ):
            if c.topic not in found:
                pose = content(reader, c, raw).pose
                turn = 2 * math.atan2(pose.orientation.z, pose.orientation.w)
                found[c.topic] = Pose2(pose.position.x, pose.position.y, turn)
    return [found[topic] for topic in sorted(found)]


def test_exploration_on_the_own_map() -> None:
    simulated("--drive", "frontier", "--duration", 3, "--slam")
    found = topics("run.mcap")
    assert 1 <= found["/map"] <= 4
    assert found["/tf"] == 2 * found["/odom"]


def test_exploration() -> None:
    said = simulated("--drive", "frontier", "--duration", 3)
    assert "Simulated 3.0 s" in said


def test_waypoints_set_the_start() -> None:
    Path("route.txt").write_text("2 2\n2 3\n")
    simulated("--drive", "route", "--route", "route.txt")
    start, _ = read_drive("run.mcap")
    assert start.distance_to(Pose2(2, 2, 1.5708))[0] < 0.01
    assert start.theta == pytest.approx(1.5708, abs=0.01)


def test_a_command_log_from_a_given_start() -> None:
    Path("route.txt").write_text("0 0.5 0\n0.5 0 0\n")
    simulated("--drive", "route", "--route", "route.txt", "--start", "7,2,90")
    start, commands = read_drive("run.mcap")
    assert start.distance_to(Pose2(7, 2))[0] < 0.01
    assert [c.v for _, c in commands] == [0.5, 0.0]


def test_a_recording_is_a_route() -> None:
    simulated("--duration", 2)
    outcome = run(
        "simulate", "map.txt", "--furniture", 0, "-o", "again.mcap", "--drive", "route", "--route", "run.mcap"
    )
    assert outcome.code == 0, outcome.err
    assert read_drive("again.mcap")[0].distance_to(read_drive("run.mcap")[0])[0] < 0.01


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["-o", "run.bag"], ".mcap"),
        (["-o", "nowhere/run.mcap"], "does not exist"),
        (["--picture", "run.jpg"], ".png"),
        (["--drive", "route"], "--route"),
        (["--route", "route.txt"], "--route"),
        (["--drive", "route", "--route", "nowhere.txt"], "no such file"),
        (["--drive", "route", "--route", "map.txt"], "line 1"),
        (["--drive", "route", "--route", "nowhere.mcap"], "cannot be read"),
        (["--drive", "keyboard"], "needs a terminal"),
        (["--drive", "keyboard", "--robots", "2"], "--robots"),
        (["--drive", "sideways"], "sideways"),
        (["--start", "1,2"], "x,y,degrees"),
        (["--start", "1,2,nan"], "x,y,degrees"),
        (["--start", "0.5,2,0"], "inside something"),
        (["--start", "-5,2,0"], "outside the ground"),
        (["--start", "2,2,0", "--robots", "2"], "--robots"),
        (["--duration", "0"], "--duration"),
        (["--duration", "nan"], "--duration"),
        (["--size", "9x9"], "--size"),
        (["--mapping", "0"], "--mapping"),
        (["--slam-params", "few.yaml"], "--slam"),
        (["--slam", "--slam-params", "nowhere.yaml"], "nowhere.yaml"),
        (["--slam", "--slam-params", "map.txt"], "map.txt"),
    ],
)
def test_bad_input_is_one_line(options: list[str], said: str, place: Path) -> None:
    outcome = run("simulate", "map.txt", "-o", "run.mcap", "--furniture", 0, *options)
    assert outcome.code == 2
    assert said in outcome.line
    assert contents(place) == {"map.txt"}


def test_nothing_is_overwritten_unasked() -> None:
    Path("run.mcap").write_text("mine")
    outcome = run("simulate", "map.txt", "-o", "run.mcap")
    assert outcome.code == 2
    assert "exists" in outcome.line
    assert Path("run.mcap").read_text() == "mine"


def test_a_missing_library_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    outcome = run("simulate", "map.txt", "-o", "run.mcap", "--furniture", 0)
    assert outcome.code == 2
    assert 'pip install "mapmeld[sim]"' in outcome.line


@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_tour_leaves_nothing(place: Path, ending: signal.Signals) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "mapmeld", "simulate", "-o", "run.mcap", "--drive", "frontier"],
        stderr=subprocess.PIPE, stdout=subprocess.PIPE,
    )  # fmt: skip
    deadline = time.monotonic() + 60
    # Not while libraries are still being loaded: Python then ends by the signal itself, after the same words.
    while not any(f.stat().st_size for f in place.glob(".mapmeld-*")) and time.monotonic() < deadline:
        time.sleep(0.05)
    process.send_signal(ending)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert b"interrupted" in err
    assert contents(place) == {"map.txt"}


# ---------------------------------------------------------------------- the keyboard, in a real terminal
class Typist:
    """A person at a pseudo terminal."""

    def __init__(self, *command: object) -> None:
        self.master, self.slave = pty.openpty()
        self.before = termios.tcgetattr(self.slave)
        self.process = subprocess.Popen(
            [sys.executable, "-m", "mapmeld", *map(str, command)],
            stdin=self.slave, stdout=self.slave, stderr=self.slave, start_new_session=True,
            env={**os.environ, "TERM": "xterm", "COLUMNS": "80", "LINES": "30"},
        )  # fmt: skip
        self.seen = ""

    def reads(self, pattern: str, seconds: float = 60.0) -> bool:
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            if re.search(pattern, self.seen):
                return True
            if select.select([self.master], [], [], 0.1)[0]:
                self.seen += os.read(self.master, 65536).decode("utf-8", "replace")
        return False

    def types(self, keys: str) -> None:
        os.write(self.master, keys.encode())

    def leaves(self) -> int:
        assert self.reads(r"Written: ")
        code = self.process.wait(timeout=60)
        os.close(self.master)
        os.close(self.slave)
        return code


def test_the_keyboard_drives(place: Path) -> None:
    typist = Typist(
        "simulate",
        "map.txt",
        "--furniture",
        0,
        "-o",
        "run.mcap",
        "--drive",
        "keyboard",
        "--start",
        "2,2.5,90",
    )
    assert typist.reads(r"speed 0\.80 m/s")
    assert "↑" in typist.seen
    assert "Moving around" in typist.seen
    typist.types("z")
    assert typist.reads(r"speed 0\.72 m/s +turn 1\.45 rad/s")
    typist.types("i")
    assert typist.reads(r"(?s)speed 0\.72 m/s.*speed 0\.72 m/s.*speed 0\.72 m/s")
    typist.types("j")
    time.sleep(0.3)
    typist.types("k")
    time.sleep(0.3)
    assert termios.tcgetattr(typist.slave)[3] & termios.ICANON == 0
    typist.types("\x03")
    assert typist.leaves() == 0
    assert contents(place) == {"map.txt", "run.mcap"}
    _, commands = read_drive("run.mcap")
    said = [(round(c.v, 3), round(c.w, 3)) for _, c in commands]
    assert said == [(0, 0), (0.72, 0), (0, 1.449), (0, 0)]


@pytest.mark.parametrize("how", ["closed", "hung up", "ended"])
def test_a_drive_is_not_lost_with_its_terminal(place: Path, how: str) -> None:
    options = ("--furniture", 0, "--start", "2,2.5,90")
    typist = Typist("simulate", "map.txt", "-o", "run.mcap", "--drive", "keyboard", *options)
    assert typist.reads(r"speed 0\.80 m/s")
    typist.types("i")
    assert typist.reads(r"(?s)speed 0\.80 m/s.*speed 0\.80 m/s.*speed 0\.80 m/s")
    os.close(typist.slave)
    if how == "ended":
        typist.process.send_signal(signal.SIGTERM)
        assert typist.reads("Written: ")
        os.close(typist.master)
    else:
        os.close(typist.master)
        if how == "hung up":
            typist.process.send_signal(signal.SIGHUP)
    # Where it was, nobody reads the summary any more.
    assert typist.process.wait(timeout=60) in ((0,) if how == "ended" else (0, 2))
    assert contents(place) == {"map.txt", "run.mcap"}
    _, commands = read_drive("run.mcap")
    assert (0.8, 0.0) in [(round(c.v, 3), round(c.w, 3)) for _, c in commands]


def test_the_terminal_is_as_before_when_the_drive_fails(place: Path) -> None:
    typist = Typist("simulate", "map.txt", "-o", "run.mcap", "--drive", "keyboard", "--start", "0.5,2,0")
    assert typist.reads("inside something")
    assert typist.process.wait(timeout=60) == 2
    assert termios.tcgetattr(typist.slave) == typist.before
    os.close(typist.master)
    os.close(typist.slave)


def test_the_plan_around_a_robot() -> None:
    plan = true_map(Environment(read_map_text("map.txt")), 0.05)
    lines = plan_around(plan, Pose2(2.5, 2.5, 0.0), 36, 10)
    assert lines[5][18] == "→"
    assert "".join(lines).count("→") == 1
    # 18 characters of 0.25 m to the left is x = -2; the outer wall at 0.5 m is 10 characters further.
    assert lines[5].index("█") == 9
    assert plan_around(plan, Pose2(2.5, 2.5, 3.0), 36, 10)[5][18] == "←"
    assert plan_around(plan, Pose2(500.0, 0.0), 10, 4) == ["", "", "     →", ""]


def test_help_says_what_it_needs(place: Path) -> None:
    outcome = run_for_real("simulate", "--help", cwd=place)
    assert outcome.code == 0
    for word in ("tour", "frontier", "route", "keyboard", "--seed", "--config"):
        assert word in outcome.out
