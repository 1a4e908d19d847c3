"""Recordings that the library rosbags reads: rosbag1 files, rosbag2 folders and their .db3 files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mapmeld.extras import required
from mapmeld.io.recordings.messages import EXTRA, ROS1
from mapmeld.io.recordings.source import Channel, Message, damage_said


class RosbagsSource:
    """An open reader of rosbags as a `Source`."""

    def __init__(self, path: str, reader: Any) -> None:
        self._path = path
        self._reader = reader
        self.channels = tuple(dict.fromkeys(map(_channel_of, reader.connections)))
        self.start: int | None = reader.start_time if reader.message_count else None
        self.left_out: Counter[str] = Counter()

    def messages(self, wanted: Collection[Channel]) -> Iterator[Message]:
        """Give the messages of some channels."""
        chosen = [found for found in self._reader.connections if _channel_of(found) in wanted]
        if not chosen:  # none would mean all of them
            return
        with damage_said(self._path):
            for connection, received, data in self._reader.messages(connections=chosen):
                yield Message(_channel_of(connection), received, data)


@contextmanager
def rosbag1_source(path: str) -> Iterator[RosbagsSource]:
    """Open a rosbag1 file."""
    with _opened(path, required("rosbags.rosbag1", EXTRA).Reader) as source:
        yield source


@contextmanager
def rosbag2_source(path: str) -> Iterator[RosbagsSource]:
    """Open a rosbag2 folder, or one of the .db3 files in such a folder."""
    with _opened(path, required("rosbags.rosbag2", EXTRA).Reader) as source:
        yield source


@contextmanager
def _opened(path: str, make_reader: Any) -> Iterator[RosbagsSource]:
    with damage_said(path):
        reader = make_reader(Path(path))
        reader.open()
    try:
        with damage_said(path):
            source = RosbagsSource(path, reader)
        yield source
    finally:
        reader.close()


def _channel_of(connection: Any) -> Channel:
    # rosbags gives types of ROS 1 their names of ROS 2.
    encoding = getattr(connection.ext, "serialization_format", ROS1)
    return Channel(connection.topic, connection.msgtype, encoding)
