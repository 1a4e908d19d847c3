import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from drawing import office, seen_from

from mapmeld.extras import MissingExtraError
from mapmeld.grid import OccupancyGrid
from mapmeld.history import Change, Standing, Step, follow
from mapmeld.io import MapFileError
from mapmeld.report.rerun_recording import RerunRecording, check_recording_path
from mapmeld.se2 import Pose2


@pytest.fixture(scope="module")
def steps() -> list[Step]:
    place = office(0.1)
    second = seen_from(place, Pose2(3.0, -2.0, 0.7))
    blank = OccupancyGrid(place.cells[:2] * 0, 0.1)
    stamped = [replace(grid, stamp=float(100 + k)) for k, grid in enumerate([blank, place])]
    return list(follow(stamped, [replace(second, stamp=100.5)]))


def rerun(*arguments: object) -> str:
    pytest.importorskip("rerun")
    command = [sys.executable, "-m", "rerun", "rrd", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return done.stdout + done.stderr


def test_a_recording_reads_back(steps: list[Step], tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    recording = RerunRecording()
    for step in steps:
        recording.take(step)
    path = recording.save(tmp_path / "maps.rrd")
    assert [p.name for p in tmp_path.iterdir()] == ["maps.rrd"]
    assert "without error" in rerun("verify", path)
    stats = rerun("stats", path)
    for name in ("map_1", "map_2", "merge", "match/probability", "match/overlap", "match/T_1_2", "log"):
        assert f"/{name}:" in stats
    printed = rerun("print", "-vvv", path)
    assert "found" in printed
    for timeline in ("step", "time"):
        assert timeline in printed


def test_a_merge_that_is_withdrawn_is_shown_no_more(
    steps: list[Step], monkeypatch: pytest.MonkeyPatch
) -> None:
    rerun = pytest.importorskip("rerun")
    recording = RerunRecording()
    shown: list[tuple[str, object]] = []
    monkeypatch.setattr(recording._stream, "log", lambda name, what, **_: shown.append((name, what)))
    recording.take(steps[-1])
    recording.take(replace(steps[-1], standing=Standing.WITHDRAWN, change=Change.WITHDRAWN))
    recording.close()
    merge = [what for name, what in shown if name == "merge"]
    assert [type(what) for what in merge] == [rerun.EncodedImage, rerun.Clear]


def test_states_without_stamps(steps: list[Step], tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    recording = RerunRecording()
    recording.take(replace(steps[-1], stamp=None))
    assert "without error" in rerun("verify", recording.save(tmp_path / "maps.rrd"))


def test_paths_are_checked_before_the_work(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    with pytest.raises(MapFileError, match=r"ends in \.rrd"):
        check_recording_path(tmp_path / "maps.mcap")
    (tmp_path / "maps.rrd").write_text("mine")
    with pytest.raises(MapFileError, match="exists"):
        check_recording_path(tmp_path / "maps.rrd")
    check_recording_path(tmp_path / "maps.rrd", force=True)


def test_without_the_extra_there_is_the_command_that_installs_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(MissingExtraError, match=r'pip install "mapmeld\[rerun\]"'):
        check_recording_path(tmp_path / "maps.rrd")
