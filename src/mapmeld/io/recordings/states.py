"""The states of a map in a recording, in time order."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Generator, Iterator
from typing import NamedTuple

from mapmeld.grid import OccupancyGrid
from mapmeld.io import AnyPath
from mapmeld.io.recordings.address import ABSOLUTE_FROM, parse_address
from mapmeld.io.recordings.messages import (
    ENCODINGS,
    GRID,
    UPDATE,
    BadMessageError,
    RecordingError,
    grid_of,
    is_of_an_earlier_map,
    own_stamp,
    patch_of,
    patched,
    seconds,
)
from mapmeld.io.recordings.opening import Damaged, open_recording
from mapmeld.io.recordings.source import Channel, Source

UPDATES_OF = "_updates"
"""What the name of a map's topic gets for the topic of its updates, by the custom of ROS."""

OTHER_GRIDS = ("foxglove.Grid",)
"""Types of grids that are known of, but not read."""


class State(NamedTuple):
    """A map, and when it was received [s after the first message of the recording]."""

    after: float
    grid: OccupancyGrid


class MapStates(Iterator[OccupancyGrid]):
    """The states of one map, read one by one as they are asked for.

    Attributes
    ----------
    topic
        Where the map was published.
    left_out
        What was passed over so far, and how often: updates that fit no map, and what is damaged where
        that may be.
    damage
        What of the recording is passed over whichever map is read, so that it counts once for several.
    """

    topic: str
    left_out: Counter[str]
    damage: Counter[str]

    def __init__(self, path: AnyPath, topic: str | None, damaged: Damaged) -> None:
        self.left_out, self.damage = Counter(), Counter()
        self._states = self._opened(os.fsdecode(path), topic, damaged)
        next(self._states)  # as far as the topic is found, so that a wrong one is told at once

    def __next__(self) -> OccupancyGrid:
        """Return the next state."""
        return self.next_state().grid

    def next_state(self) -> State:
        """Return the next state with the time when it was received."""
        state = next(self._states)
        assert state is not None  # the first alone
        return state

    def close(self) -> None:
        """Close the recording; there are no more states."""
        self._states.close()

    def _opened(self, path: str, topic: str | None, damaged: Damaged) -> Generator[State | None]:
        with open_recording(path, damaged) as source:
            channels = _channels(path, source, topic)
            self.topic = channels[0].topic
            self.left_out = source.left_out
            self.damage = source.damage
            yield None
            yield from self._read(path, source, channels, damaged)

    def _read(self, path: str, source: Source, channels: list[Channel], damaged: Damaged) -> Iterator[State]:
        start = source.start or 0
        current: OccupancyGrid | None = None
        since: float | None = None  # the stamp of the last whole map, if it has one of its own
        for channel, received, data in source.messages(channels):
            try:
                if channel.type == GRID:
                    current = grid_of(data, channel.encoding, received)
                    changed = current
                    since = None if current is None else own_stamp(current, received)
                else:
                    changed = self._updated(current, since, data, channel, received)
            except BadMessageError as error:
                after = seconds(received - start)
                if damaged == "refuse":
                    raise RecordingError.of(
                        path,
                        f"{channel.topic} has {error}, {after:.3f} s after the start; 'mapmeld bag export' "
                        "with '--damaged use' writes the maps that can be read",
                    ) from error
                self.left_out[str(error)] += 1
                if channel.type == GRID:
                    current = None  # what follows belongs to the map that is lost
                continue
            if changed is not None:
                current = changed
                yield State(seconds(received - start), changed)

    def _updated(
        self, current: OccupancyGrid | None, since: float | None, data: bytes, channel: Channel, received: int
    ) -> OccupancyGrid | None:
        patch = patch_of(data, channel.encoding, received)
        if current is None:
            self.left_out["an update that came before any map"] += 1
            return None
        if is_of_an_earlier_map(patch, since):
            self.left_out["an update that is older than the map"] += 1
            return None
        changed = patched(current, patch)
        if changed is None:
            self.left_out["an update that reaches outside of the map"] += 1
        return changed


def map_states(path: AnyPath, topic: str | None = None, *, damaged: Damaged = "refuse") -> MapStates:
    """Give the states of a map in a recording, in the order in which they were received.

    Reads as it goes: a recording may be larger than memory. Updates on ``TOPIC_updates`` are laid on the
    last map, each giving a state. Three kinds are passed over: those that come before the first map (what
    they would change is not known) and those that reach outside of the map, as RViz and nav2 do, and those
    whose stamp is before the map's (they were meant for one before, which may have lain elsewhere). So are
    maps without cells, which some mappers send before they have one.

    Parameters
    ----------
    path
        A rosbag1 file, a rosbag2 folder, one of the .db3 files in it, or an MCAP file.
    topic
        Where the map is published; may be left out if there is only one with maps.
    damaged
        "refuse": an error where something cannot be read. "use": pass over it, and count it in
        `MapStates.left_out`. The recording is then gone through three times.

    Returns
    -------
    MapStates
        An iterator of grids, each with its frame and the stamp of its header; where that is
        zero, when it was received.

    Raises
    ------
    RecordingError
        At once: not a recording, or no such topic, or several and none named. While states are taken: the
        recording is damaged, or a message is no map.
    MissingExtraError
        The extra "bags" is not installed.
    """
    return MapStates(path, topic, damaged)


def read_state(address: str) -> OccupancyGrid:
    """Return the state of a map that ``FILE#topic@time`` names; the last one without a time.

    A time from `ABSOLUTE_FROM` on is a stamp, and the last state that has that stamp or an earlier one is
    meant. A smaller one is in seconds after the first message of the recording, and the last state
    received by then is meant.

    Raises
    ------
    RecordingError
        As `map_states`; or there was no state yet.
    """
    path, topic, time = parse_address(address)
    states = map_states(path, topic)
    first: State | None = None
    found: OccupancyGrid | None = None
    try:
        while True:
            state = states.next_state()
            first = first or state
            if time is None:
                found = state.grid
            elif time >= ABSOLUTE_FROM:
                found = state.grid if (state.grid.stamp or 0.0) <= time else found
            elif state.after <= time:
                found = state.grid
            else:
                break
    except StopIteration:
        pass
    finally:
        states.close()
    if first is None:
        raise RecordingError.of(path, f"{states.topic} has no map with cells")
    if found is None:
        raise RecordingError.of(
            address,
            f"there was no map yet; the first came {first.after:.3f} s after the start, "
            f"with the stamp {first.grid.stamp}",
        )
    return found


def _channels(path: str, source: Source, topic: str | None) -> list[Channel]:
    """Return the channels of a map and of its updates, the map first.

    Raises
    ------
    RecordingError
        There is no such map, or several and none named.
    """
    grids = [channel for channel in source.channels if channel.type == GRID and channel.encoding in ENCODINGS]
    names = sorted({channel.topic for channel in grids})
    if topic is None:
        if len(names) > 1:
            raise RecordingError.of(
                path, f"has maps on {len(names)} topics; name one of them: {_listed(names)}"
            )
        if not names:
            raise RecordingError.of(path, f"has no topic with maps{_unreadable(source)}{_lost(source)}")
        name = names[0]
    else:
        name = next((n for n in (topic, f"/{topic}", topic.removeprefix("/")) if n in names), "")
        if not name:
            there = f"there are: {_listed(names)}" if names else "nor has any other"
            raise RecordingError.of(
                path, f"topic {topic} has no maps; {there}{_unreadable(source)}{_lost(source)}"
            )
    updates = [
        channel
        for channel in source.channels
        if channel.topic == name + UPDATES_OF and channel.type == UPDATE and channel.encoding in ENCODINGS
    ]
    return [channel for channel in grids if channel.topic == name] + updates


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - 10} more" if len(names) > 10 else ""
    return ", ".join(names[:10]) + more


def _lost(source: Source) -> str:
    """Say that maps may have been in what is damaged."""
    lost = "; ".join(sorted(source.damage)[:2])
    return f"; they may have been in what is damaged and left out: {lost}" if lost else ""


def _unreadable(source: Source) -> str:
    found = sorted(
        {
            f"{channel.topic} ({channel.type} as {channel.encoding or 'unknown'})"
            for channel in source.channels
            if channel.type in OTHER_GRIDS or (channel.type == GRID and channel.encoding not in ENCODINGS)
        }
    )
    return f"; not readable, for only {' and '.join(ENCODINGS)} are: {', '.join(found[:5])}" if found else ""
