"""What maps a recording holds."""

from __future__ import annotations

from dataclasses import dataclass

from mapmeld.grid import OccupancyGrid
from mapmeld.io import AnyPath
from mapmeld.io.recordings.messages import (
    ENCODINGS,
    GRID,
    UPDATE,
    BadMessageError,
    grid_of,
    patch_of,
    seconds,
)
from mapmeld.io.recordings.opening import Damaged, open_recording
from mapmeld.io.recordings.source import Channel, Message
from mapmeld.io.recordings.states import OTHER_GRIDS, UPDATES_OF


@dataclass(frozen=True, slots=True)
class MapTopic:
    """A topic on which maps were published.

    Attributes
    ----------
    name, type, encoding
        Of the topic; the type as ROS 2 has it.
    maps
        Whole maps on it, those without cells included.
    updates
        Updates of it, on ``NAME_updates``.
    first, last
        When the first and the last of all these were received [s after the first message of
        the recording]; None if there are none.
    first_stamp, last_stamp
        Their stamps [s]; None if there are none or they cannot be read.
    frame_id, resolution, shape
        Of the last whole map: frame, side of a cell [m], (rows, cols). None if it has no cells, or cannot
        be read.
    problem
        Why maps on this topic cannot be read, or the last one cannot; None if nothing is wrong.
    """

    name: str
    type: str
    encoding: str
    maps: int
    updates: int
    first: float | None
    last: float | None
    first_stamp: float | None
    last_stamp: float | None
    frame_id: str | None
    resolution: float | None
    shape: tuple[int, int] | None
    problem: str | None


@dataclass(frozen=True, slots=True)
class RecordingInfo:
    """A recording: when its first message was received [s], its maps, what could not be read."""

    start: float | None
    topics: tuple[MapTopic, ...]
    left_out: dict[str, int]


def map_topics(path: AnyPath) -> tuple[MapTopic, ...]:
    """Return the topics of a recording on which maps were published, by name.

    Goes through all messages of these topics, but decodes only the first and the last of each.

    Raises
    ------
    RecordingError
        It is no recording, or damaged.
    MissingExtraError
        The extra "bags" is not installed.
    """
    return recording_info(path).topics


def recording_info(path: AnyPath, *, damaged: Damaged = "refuse") -> RecordingInfo:
    """Return what maps a recording holds; see `map_topics`.

    Parameters
    ----------
    path
        The recording.
    damaged
        As of `map_states`.
    """
    with open_recording(path, damaged) as source:
        maps = [found for found in source.channels if found.type == GRID or found.type in OTHER_GRIDS]
        by_updates = {found.topic + UPDATES_OF: found for found in maps}
        owner = {found: found for found in maps}  # updates count with the map to which they belong
        for found in source.channels:
            if found.type == UPDATE and found.topic in by_updates:
                owner[found] = by_updates[found.topic]
        seen = {found: _Seen() for found in maps}
        for message in source.messages(owner.keys()):
            seen[owner[message.channel]].take(message)
        start = source.start
        topics = tuple(_described(channel, seen[channel], start or 0) for channel in sorted(maps))
        return RecordingInfo(None if start is None else seconds(start), topics, dict(source.left_out))


@dataclass(slots=True)
class _Seen:
    """The messages on a topic: how many, and those that tell something."""

    maps: int = 0
    updates: int = 0
    first: Message | None = None
    last: Message | None = None
    last_map: Message | None = None

    def take(self, message: Message) -> None:
        self.first = self.first or message
        self.last = message
        if message.channel.type == UPDATE:
            self.updates += 1
        else:
            self.maps += 1
            self.last_map = message


def _described(channel: Channel, seen: _Seen, start: int) -> MapTopic:
    problem: str | None = None
    grid: OccupancyGrid | None = None
    if channel.type != GRID or channel.encoding not in ENCODINGS:
        problem = f"cannot be read: {channel.type} as {channel.encoding or 'unknown'}"
    elif seen.last_map is not None:
        try:
            grid = grid_of(seen.last_map.data, channel.encoding, seen.last_map.received)
            problem = None if grid else "the last map has no cells"
        except BadMessageError as error:
            problem = f"the last message is {error}"
    return MapTopic(
        name=channel.topic,
        type=channel.type,
        encoding=channel.encoding,
        maps=seen.maps,
        updates=seen.updates,
        first=None if seen.first is None else seconds(seen.first.received - start),
        last=None if seen.last is None else seconds(seen.last.received - start),
        first_stamp=_stamp_of(seen.first),
        last_stamp=_stamp_of(seen.last),
        frame_id=grid.frame_id if grid else None,
        resolution=grid.resolution if grid else None,
        shape=grid.shape if grid else None,
        problem=problem,
    )


def _stamp_of(message: Message | None) -> float | None:
    if message is None or message.channel.encoding not in ENCODINGS:
        return None
    read = patch_of if message.channel.type == UPDATE else grid_of
    try:
        found = read(message.data, message.channel.encoding, message.received)
    except BadMessageError:
        return None
    return None if found is None else found.stamp
