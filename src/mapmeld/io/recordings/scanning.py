"""What the readers share that go through a recording from front to back, without trust in any index.

They find what is left of a damaged recording; what they cannot read they pass over and count.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator

from mapmeld.io.recordings.source import Channel, Message, damaged
from mapmeld.io.recordings.unpacking import ZSTD_MAGIC, unpacked

Damage = Callable[[str], None]
"""Takes note of something that cannot be read, or raises."""

Scan = Callable[[Damage], Iterator[Message]]
"""Goes through a recording once and gives every message of every channel that it knows by then."""


class ScannedSource:
    """A recording read from front to back, as a `Source`.

    Opening goes through all of it to find channels and the first message; a damaged one once more
    before that, because what describes a channel may come after messages of it.

    Parameters
    ----------
    path
        For messages.
    scan
        Goes through it.
    strict
        Refuse what is damaged instead of passing over it.
    """

    def __init__(self, path: str, scan: Scan, *, strict: bool) -> None:
        self._path = path
        self._scan = scan
        self._strict = strict
        self.left_out: Counter[str] = Counter()
        channels: dict[Channel, None] = {}
        self.start: int | None = None
        if not strict:
            for _ in scan(_ignore):
                pass
        for channel, received, _ in scan(self._refuse if strict else _ignore):
            channels[channel] = None
            self.start = received if self.start is None else min(self.start, received)
        self.channels = tuple(channels)

    def messages(self, wanted: Collection[Channel]) -> Iterator[Message]:
        """Give the messages of some channels, in the order in which they were written."""
        for message in self._scan(self._refuse if self._strict else self._note):
            if message.channel in wanted:
                yield self._plain(message)

    def _plain(self, message: Message) -> Message:
        """Undo the compression of single messages that rosbag2 can be told to apply."""
        if message.data[:4] != ZSTD_MAGIC:  # no message begins like this by itself
            return message
        try:
            return message._replace(data=unpacked(message.data, "zstd"))
        except Exception:  # left as it is: the message will be found bad
            return message

    def _refuse(self, reason: str) -> None:
        raise damaged(self._path, reason)

    def _note(self, reason: str) -> None:
        self.left_out[reason] += 1


def _ignore(reason: str) -> None:
    pass
