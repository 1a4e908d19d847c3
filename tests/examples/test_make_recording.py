"""The example recording: its states grow, and end as the maps that are shipped beside it."""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_typestore

from mapmeld.grid import OccupancyGrid
from mapmeld.io import load
from mapmeld.se2 import Pose2

EXAMPLES = Path(__file__).parents[2] / "examples"
sys.path.insert(0, str(EXAMPLES))  # as when the script is run

import make_recording  # noqa: E402


def _messages(data: bytes) -> dict[str, list[tuple[int, Any]]]:
    store = get_typestore(Stores.ROS2_HUMBLE)
    found: dict[str, list[tuple[int, Any]]] = {}
    for _, channel, message in make_reader(io.BytesIO(data), validate_crcs=True).iter_messages():
        content = store.deserialize_cdr(message.data, make_recording.GRID)
        found.setdefault(channel.topic, []).append((message.log_time, content))
    return found


def _grid(message: Any) -> OccupancyGrid:
    cells = message.data.reshape(message.info.height, message.info.width)
    at = message.info.origin.position
    return OccupancyGrid(cells, round(message.info.resolution, 6), Pose2(at.x, at.y))


@pytest.fixture(scope="module")
def shipped() -> dict[str, list[tuple[int, Any]]]:
    return _messages((EXAMPLES / "recording" / make_recording.NAME).read_bytes())


@pytest.mark.parametrize("robot", ["robot_1", "robot_2"])
def test_states_grow_and_end_as_the_shipped_map(robot: str, shipped: dict[str, Any]) -> None:
    states = shipped[f"/{robot}/map"]
    assert 12 <= len(states) <= 20
    areas = [int((message.data >= 0).sum()) for _, message in states]
    assert areas == sorted(areas)
    assert areas[0] < areas[-1] / 2
    assert _grid(states[-1][1]) == load(EXAMPLES / "maps" / f"{robot}.yaml")


def test_times_and_frames_are_those_of_two_robots(shipped: dict[str, Any]) -> None:
    assert sorted(shipped) == ["/robot_1/map", "/robot_2/map"]
    gaps = []
    for topic, states in shipped.items():
        received = np.array([time for time, _ in states])
        stamps = np.array([m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for _, m in states])
        assert (received > stamps).all()
        assert (np.diff(stamps) > 0).all()
        assert {m.header.frame_id for _, m in states} == {f"{topic.split('/')[1]}/map"}
        gaps.append(float(np.median(np.diff(stamps))))
    assert gaps[0] != gaps[1]


def test_shipped_recording_has_chunks_as_a_recorder_makes_them() -> None:
    """So that what reads it goes by its index, from one to the next."""
    with (EXAMPLES / "recording" / make_recording.NAME).open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert len(summary.chunk_indexes) >= 3
    assert summary.statistics is not None
    assert summary.statistics.chunk_count == len(summary.chunk_indexes)


def test_shipped_recording_is_small() -> None:
    assert (EXAMPLES / "recording" / make_recording.NAME).stat().st_size < 300_000


def test_writes_what_the_robots_would_publish(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cells = np.array([[-1, 0, 100], [50, 0, -1]], np.int8)
    grid = OccupancyGrid(cells, 0.5, Pose2(1.0, -2.0, 0.5))
    monkeypatch.setattr(make_recording, "states", lambda seed: iter([("robot_2", 1.25, grid)]))
    assert make_recording.main(["--out", str(tmp_path / "new")]) == 0
    ((received, message),) = _messages((tmp_path / "new" / make_recording.NAME).read_bytes())["/robot_2/map"]
    stamp = message.header.stamp.sec + message.header.stamp.nanosec / 1e9
    assert stamp == make_recording.BEGINNING + 1.25
    assert received == (make_recording.BEGINNING * 10**9 + 1_250_000_000) + make_recording.DELAY
    np.testing.assert_array_equal(message.data.reshape(2, 3), cells)
    turn = message.info.origin.orientation
    assert 2 * np.arctan2(turn.z, turn.w) == pytest.approx(0.5)


def test_refuses_to_overwrite(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    there = tmp_path / make_recording.NAME
    there.write_text("mine")
    assert make_recording.main(["--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert there.read_text() == "mine"
