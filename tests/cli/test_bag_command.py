"""``mapmeld bag``, and recordings where the other commands take a map."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import mcap.writer
import pytest
from listing import contents
from running import run, run_for_real

import mapmeld
from mapmeld.io.recordings import map_states

RECORDING = Path(__file__).parents[2] / "examples" / "recording" / "two_robots.mcap"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    shutil.copy(RECORDING, tmp_path / "run.mcap")
    return tmp_path / "run.mcap"


@pytest.fixture
def damaged(file: Path) -> Path:
    file.write_bytes(file.read_bytes()[:-100])
    return file


# ---------------------------------------------------------------- info
def test_info_lists_the_maps(file: Path) -> None:
    done = run("bag", "info", file)
    assert (done.code, done.err) == (0, "")
    lines = [line.split() for line in done.out.splitlines()]
    assert lines[0][:4] == ["topic", "type", "maps", "updates"]
    assert lines[1][0] == "/robot_1/map"
    assert lines[1][2:] == ["15", "0", "0.000", "121.650", "338", "x", "386", "0.05", "robot_1/map"]
    assert lines[2][0] == "/robot_2/map"
    assert done.out.splitlines()[3:] == [
        "",
        f"For other commands: {file}#/robot_1/map, or with @SECONDS the map at that time.",
    ]


def test_info_for_programs(file: Path) -> None:
    done = run("bag", "info", file, "--json")
    found = json.loads(done.out)
    assert found["schema"] == "mapmeld.bag.info/1"
    assert found["path"] == str(file)
    assert [topic["name"] for topic in found["topics"]] == ["/robot_1/map", "/robot_2/map"]
    first = found["topics"][0]
    assert (first["maps"], first["rows"], first["cols"], first["problem"]) == (15, 386, 338, None)
    assert found["start"] + first["last"] > first["last_stamp"] > first["first_stamp"]
    assert found["left_out"] == {}


def test_info_without_maps_and_with_problems(tmp_path: Path) -> None:
    import mcap.writer

    for name, kind in (("none", "std_msgs/msg/String"), ("odd", "foxglove.Grid")):
        with (tmp_path / f"{name}.mcap").open("wb") as out:
            writer = mcap.writer.Writer(out)
            writer.start(profile="", library="")
            channel = writer.register_channel("/x", "json", writer.register_schema(kind, "", b""))
            writer.add_message(channel, 0, b"{}", 0)
            writer.finish()  # type: ignore[no-untyped-call]
    assert run("bag", "info", tmp_path / "none.mcap").out == "No maps in this recording.\n"
    done = run("bag", "info", tmp_path / "odd.mcap")
    assert done.code == 0
    assert "/x: cannot be read: foxglove.Grid as json" in done.out.splitlines()


def test_info_of_a_damaged_recording(damaged: Path) -> None:
    done = run("bag", "info", damaged)
    assert done.code == 2
    assert "is damaged" in done.line
    assert done.out == ""
    done = run("bag", "info", damaged, "--damaged", "use")
    assert done.code == 0
    assert "/robot_1/map" in done.out
    assert "note:" in done.line
    assert "left out: all from a place on where the file is damaged or cut off" in done.line
    found = json.loads(run("bag", "info", damaged, "--damaged", "use", "--json").out)
    assert list(found["left_out"].values()) == [1]


def test_bad_usage(file: Path, tmp_path: Path) -> None:
    assert run("bag", "info", tmp_path / "gone.bag").line.endswith("gone.bag: no such file")
    assert run("bag", "info", file, "--damaged", "perhaps").code == 2
    assert run("bag", "export", file).code == 2
    assert run("bag", "nothing").code == 2


# ---------------------------------------------------------------- export
def test_export_of_one_topic(file: Path, tmp_path: Path) -> None:
    out = tmp_path / "history"
    done = run("bag", "export", file, "--topic", "robot_1/map", "-o", out)
    assert (done.code, done.err) == (0, "")
    assert done.out == f"/robot_1/map: 15 maps in {out}\n"
    assert len(contents(out)) == 31
    states = list(map_states(file, "/robot_1/map"))
    times = [
        line.split() for line in (out / "times.txt").read_text().splitlines() if not line.startswith("#")
    ]
    assert [float(time) for _, time in times] == [state.stamp for state in states]
    for (name, _), state in zip(times, states, strict=True):
        written = mapmeld.load(out / name)
        assert (written.cells == state.cells).all()
        assert (written.resolution, written.origin) == (state.resolution, state.origin)


def test_export_of_several_topics(file: Path, tmp_path: Path) -> None:
    out = tmp_path / "histories"
    done = run("bag", "export", file, "--topic", "/robot_1/map", "--topic", "/robot_2/map", "-o", out)
    assert done.code == 0
    assert done.out.splitlines() == [
        f"/robot_1/map: 15 maps in {out / 'robot_1_map'}",
        f"/robot_2/map: 19 maps in {out / 'robot_2_map'}",
    ]
    assert {name.split("/")[0] for name in contents(out)} == {"robot_1_map", "robot_2_map"}
    again = run("bag", "export", file, "--topic", "/robot_1/map", "--topic", "/robot_2/map", "-o", out)
    assert "is not empty" in again.line
    forced = run(
        "bag", "export", file, "--topic", "/robot_1/map", "--topic", "/robot_2/map", "-o", out, "--force"
    )
    assert forced.code == 0


def test_folders_of_topics_are_told_apart_and_stay_below() -> None:
    from mapmeld.cli.bag import _folders_of

    topics = ["/a/b", "/a_b", "/../../etc", "//", "/ä"]
    assert list(_folders_of(topics).values()) == ["a_b", "a_b_2", "etc", "map", "map_2"]


def test_export_needs_a_topic_where_there_are_several(file: Path, tmp_path: Path) -> None:
    done = run("bag", "export", file, "-o", tmp_path / "history")
    assert done.code == 2
    assert done.line.endswith("has maps on 2 topics; name one of them: /robot_1/map, /robot_2/map")
    assert contents(tmp_path) == {"run.mcap"}


@pytest.mark.parametrize("topics", [["/robot_1/map"], ["/robot_1/map", "/gone"]])
def test_export_writes_all_or_nothing(file: Path, tmp_path: Path, topics: list[str]) -> None:
    if len(topics) == 1:
        data = bytearray(file.read_bytes())
        data[len(data) // 2] ^= 1
        file.write_bytes(data)
    chosen = [word for topic in topics for word in ("--topic", topic)]
    done = run("bag", "export", file, *chosen, "-o", tmp_path / "history")
    assert done.code == 2
    assert "run.mcap" in done.line
    assert contents(tmp_path) == {"run.mcap"}


def test_export_of_what_can_be_read(damaged: Path, tmp_path: Path) -> None:
    out = tmp_path / "history"
    assert run("bag", "export", damaged, "--topic", "/robot_1/map", "-o", out).code == 2
    assert not out.exists()
    done = run("bag", "export", damaged, "--topic", "/robot_1/map", "-o", out, "--damaged", "use")
    assert done.code == 0
    assert done.out.startswith("/robot_1/map: 15 maps in")
    assert "left out" in done.line


@pytest.mark.parametrize("topics", [["/map"], ["/map", "/map2"]])
def test_export_where_every_map_is_bad_says_what_was_left_out(topics: list[str], tmp_path: Path) -> None:
    with (tmp_path / "bad.mcap").open("wb") as out:
        writer = mcap.writer.Writer(out)
        writer.start(profile="ros2", library="")
        schema = writer.register_schema("nav_msgs/msg/OccupancyGrid", "ros2msg", b"")
        for topic in topics:
            channel = writer.register_channel(topic, "cdr", schema)
            for n in range(3):
                writer.add_message(channel, n, b"junk", n)
        writer.finish()  # type: ignore[no-untyped-call]
    chosen = [word for topic in topics for word in ("--topic", topic)]
    done = run("bag", "export", tmp_path / "bad.mcap", "-o", tmp_path / "h", "--damaged", "use", *chosen)
    assert done.code == 2
    assert done.line.endswith("no map on /map can be read; left out: bytes that are no map (3 times)")
    assert contents(tmp_path) == {"bad.mcap"}


def test_damage_counts_once_for_several_topics(damaged: Path, tmp_path: Path) -> None:
    topics = ["--topic", "/robot_1/map", "--topic", "/robot_2/map"]
    done = run("bag", "export", damaged, *topics, "-o", tmp_path / "h", "--damaged", "use")
    assert done.code == 0
    assert "left out" in done.line
    assert "times)" not in done.line


def test_where_no_map_can_be_read(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:300])
    done = run("bag", "info", file, "--damaged", "use")
    assert "No maps could be read from this recording." in done.out
    assert "cut off" in done.line


def test_progress_goes_to_no_pipe(file: Path, tmp_path: Path) -> None:
    done = run_for_real("bag", "export", file, "--topic", "/robot_1/map", "-o", "history", cwd=tmp_path)
    assert (done.code, done.err) == (0, "")


# ---------------------------------------------------------------- where a map is asked for
def test_states_are_maps_for_every_command(file: Path, tmp_path: Path) -> None:
    a, b = f"{file}#/robot_1/map", f"{file}#/robot_2/map@150"
    matched = json.loads(run("match", a, b, "--json").out)
    assert matched["verdict"] == "accepted"
    assert matched["maps"] == {"a": a, "b": b}
    assert matched["T_a_b"]["x"] == pytest.approx(7.377, abs=0.25)
    assert run("match", f"{file}#/robot_1/map@5", b).code == 1
    merged = run("merge", a, b, "-o", tmp_path / "floor.yaml")
    assert merged.code == 0
    assert "run.mcap#/robot_2/map@150" in merged.out.replace("\n", "").replace(" ", "")
    assert merged.err == ""  # two topics of one file are two maps
    assert run("show", a, b, "-o", tmp_path / "overlay.png").code == 0
    assert run("explain", a, b, "-o", tmp_path / "explained").code in (0, 1)
    assert "`run.mcap#/robot_1/map` (a)" in (tmp_path / "explained" / "index.md").read_text()


def test_the_same_state_twice_is_noted(file: Path, tmp_path: Path) -> None:
    a, b = f"{file}#/robot_1/map", f"{file}#/robot_2/map"
    done = run("merge", a, b, a, "-o", tmp_path / "floor.yaml")
    assert "maps 1 and 3 are the same" in done.line


def test_what_is_wrong_with_a_state_is_one_line(file: Path, tmp_path: Path) -> None:
    a = f"{file}#/robot_1/map"
    assert "has maps on 2 topics; name one of them" in run("match", a, file).line
    assert "topic /gone has no maps; there are: /robot_1/map" in run("match", a, f"{file}#/gone").line
    assert "there was no map yet; the first came 6.950 s" in run("match", a, f"{file}#/robot_2/map@6.1").line
    assert "the time after '@'" in run("match", a, f"{file}#/robot_2/map@soon").line
    assert "--resolution is for bare images" in run("match", a, a, "--resolution", 0.05).line
