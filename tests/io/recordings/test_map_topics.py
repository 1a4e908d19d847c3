"""What a recording is said to hold."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bag_files import FORMATS, GRID, START, mcap_bytes, sent_map, sent_text, sent_update, story, write_mcap

from mapmeld.io.recordings import MapTopic, RecordingInfo, map_topics, recording_info

EXPECTED = RecordingInfo(
    start=float(START),
    topics=(
        MapTopic(
            name="/robot_1/map",
            type=GRID,
            encoding="cdr",
            maps=3,
            updates=2,
            first=0.5,
            last=6.0,
            first_stamp=None,  # the first has no cells
            last_stamp=START + 5.99,
            frame_id="r1",
            resolution=0.05,
            shape=(3, 4),
            problem=None,
        ),
        MapTopic(
            name="/robot_2/map",
            type=GRID,
            encoding="cdr",
            maps=2,
            updates=0,
            first=2.0,
            last=5.0,
            first_stamp=START + 1.98,
            last_stamp=START + 4.98,
            frame_id="r2",
            resolution=0.1,
            shape=(1, 2),
            problem=None,
        ),
    ),
    left_out={},
)


@pytest.mark.parametrize("damaged", ["refuse", "use"])
@pytest.mark.parametrize("name", FORMATS)
def test_every_format_is_described_alike(name: str, damaged: Any, tmp_path: Path) -> None:
    path = FORMATS[name](tmp_path, story())
    found = recording_info(path, damaged=damaged)
    encoding = "ros1" if "rosbag1" in name or "ros1" in name else "cdr"
    assert found.topics == tuple(replace(topic, encoding=encoding) for topic in EXPECTED.topics)
    assert (found.start, found.left_out) == (EXPECTED.start, {})
    assert map_topics(path) == found.topics


@pytest.mark.parametrize("name", FORMATS)
def test_a_recording_without_maps_has_no_topics(name: str, tmp_path: Path) -> None:
    assert map_topics(FORMATS[name](tmp_path, [sent_text(0, "x")])) == ()


@pytest.mark.parametrize(
    "name", ["rosbag1", "rosbag2-sqlite3", "rosbag2-mcap", "mcap-zstd", "mcap-no-chunks"]
)
def test_an_empty_recording(name: str, tmp_path: Path) -> None:
    info = recording_info(FORMATS[name](tmp_path, []))
    assert info == RecordingInfo(None, (), {})


def test_what_cannot_be_read_is_a_problem_of_its_topic_alone(tmp_path: Path) -> None:
    path = write_mcap(
        tmp_path,
        [
            sent_map(0, [[0]], "/a"),
            sent_map(1, [[0]], "/a", resolution=math.nan),
            sent_map(1, [[0]], "/b"),
            sent_map(2, np.zeros((0, 0)), "/c"),
            sent_update(3, 0, 0, [[0]], "/lost_updates"),
        ],
    )
    a, b, c = map_topics(path)
    assert (a.problem, a.resolution, a.last_stamp) == (
        "the last message is a map with cells of nan m",
        None,
        None,
    )
    assert (b.problem, b.resolution) == (None, 0.05)
    assert (c.problem, c.maps, c.shape) == ("the last map has no cells", 1, None)


def test_other_encodings_are_listed_with_the_reason(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(mcap_bytes([sent_map(0.5, [[0]])], encoding="json"))
    (topic,) = map_topics(tmp_path / "a.mcap")
    assert topic.problem == "cannot be read: nav_msgs/msg/OccupancyGrid as json"
    assert (topic.maps, topic.first, topic.first_stamp, topic.shape) == (1, 0.0, None, None)
