"""What all kinds of recordings come down to: channels, and messages in the order of their times."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from typing import NamedTuple, Protocol

from mapmeld.errors import MapmeldError
from mapmeld.io.recordings.messages import RecordingError


class Channel(NamedTuple):
    """Messages of one kind: their topic, type ("nav_msgs/msg/OccupancyGrid") and encoding ("cdr")."""

    topic: str
    type: str
    encoding: str


class Message(NamedTuple):
    """One message as it was recorded; `received` in nanoseconds."""

    channel: Channel
    received: int
    data: bytes


class Source(Protocol):
    """A recording that is open.

    Attributes
    ----------
    channels
        All that there are, each once.
    start
        When the first message of any channel was received [ns]; None if there is none.
    left_out
        What could not be read and was passed over, and how often; grows while messages are read.
    damage
        What will be passed over in any case, whichever channels are read.
    """

    channels: tuple[Channel, ...]
    start: int | None
    left_out: Counter[str]
    damage: Counter[str]

    def messages(self, wanted: Collection[Channel]) -> Iterator[Message]:
        """Give the messages of some channels as they were received, reading as it goes."""


def full_type(name: str) -> str:
    """Return the name of a type as ROS 2 has it, with ``msg`` in the middle."""
    package, slash, kind = name.partition("/")
    return f"{package}/msg/{kind}" if slash and "/" not in kind else name


@contextmanager
def damage_said(path: str) -> Iterator[None]:
    """Turn whatever a library trips over in a recording into one line.

    None of the libraries promises what it raises on damaged input, and they raise of everything, failed
    assertions included. So only their calls go into the block.
    """
    try:
        yield
    except MapmeldError:
        raise
    except OSError as error:
        raise RecordingError.of(path, f"cannot be read: {error.strerror or error}") from error
    except Exception as error:
        raise damaged(path, reason_of(error)) from error


def damaged(path: str, reason: str) -> RecordingError:
    """Return the error of a recording that is not read whole, and not in part unasked."""
    return RecordingError.of(
        path,
        f"is damaged, or of a kind that is not read ({reason}); "
        "'mapmeld bag export' with '--damaged use' writes the maps that can be read",
    )


# How the libraries say that there are fewer bytes than there should be, or others.
_CUT_OFF = re.compile(
    r"EndOfFile|unpack(_from)? requires|end of (the )?file|EOF|too short|truncated", re.IGNORECASE
)
_GARBLED = re.compile(r"opcode|crc|checksum|malformed|codec can't|out of range|invalid", re.IGNORECASE)


def reason_of(error: Exception) -> str:
    """Return what the damage is in plain words; where it fits none, what the library says, on one line."""
    text = " ".join(str(error).split()).rstrip(".").removesuffix("; please report issue")
    text = text or type(error).__name__
    if _CUT_OFF.search(text):
        return "it is cut off, its end is missing"
    if _GARBLED.search(text):
        return "a part is garbled"
    return text if len(text) <= 120 else text[:117] + "..."
