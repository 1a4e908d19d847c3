"""What is left of a rosbag2 folder: the files in it one after the other, whatever its metadata says."""

from __future__ import annotations

import re
import shutil
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from mapmeld.extras import required
from mapmeld.io import MapFileError
from mapmeld.io.images import open_regular
from mapmeld.io.recordings.mcap_source import mcap_source
from mapmeld.io.recordings.messages import EXTRA, RecordingError
from mapmeld.io.recordings.source import Channel, Message, Source
from mapmeld.io.recordings.sqlite_scan import sqlite_scan

MAX_FILE_BYTES = 1 << 33
"""Largest file that is unpacked into a temporary folder, if that has twice the room."""

PACKED = ".zstd"
"""What files have added to their names that rosbag2 compressed as a whole."""


class _Joined:
    """Several recordings, one after the other, as one `Source`."""

    def __init__(self, sources: Collection[Source]) -> None:
        self._sources = sources
        self.channels = tuple(dict.fromkeys(channel for source in sources for channel in source.channels))
        self.start = min((source.start for source in sources if source.start is not None), default=None)
        self.left_out: Counter[str] = Counter()
        self.damage = sum((source.damage for source in sources), Counter[str]())

    def messages(self, wanted: Collection[Channel]) -> Iterator[Message]:
        """Give the messages of some channels."""
        for source in self._sources:
            yield from source.messages(wanted)
            self.left_out += source.left_out


@contextmanager
def folder_scan(path: str) -> Iterator[Source]:
    """Open a rosbag2 folder and read what can be read of it.

    Raises
    ------
    RecordingError
        There is no file in it that can be read.
    """
    with ExitStack() as stack:
        sources: list[Source] = []
        failed: list[RecordingError] = []
        for file in storage_files(path):
            plain = str(file)
            try:
                if file.suffix == PACKED:
                    plain = _unpacked(file, stack)
                opened = mcap_source(plain, strict=False) if plain.endswith(".mcap") else sqlite_scan(plain)
                sources.append(stack.enter_context(opened))
            except MapFileError as error:
                failed.append(RecordingError(str(error).replace(plain, str(file))))
        if failed and not sources:
            raise failed[0]
        if not sources:
            raise RecordingError.of(path, "holds neither a .db3 nor an .mcap file")
        joined = _Joined(sources)
        for left_out in (joined.left_out, joined.damage):
            left_out.update(f"a whole file: {error}" for error in failed)
        yield joined


def _unpacked(file: Path, stack: ExitStack) -> str:
    """Unpack a file as far as that goes; return where it is until the stack closes.

    Raises
    ------
    RecordingError
        It becomes too large.
    """
    folder = stack.enter_context(TemporaryDirectory())
    plain = Path(folder, file.stem)
    most = min(MAX_FILE_BYTES, shutil.disk_usage(folder).free // 2)
    size = 0
    with open_regular(file, may_be_empty=True) as (packed, _), plain.open("wb") as out:
        reader = required("zstandard", EXTRA).ZstdDecompressor().stream_reader(packed)
        with suppress(Exception):  # what is missing will show when the file is read
            while size <= most and (piece := reader.read(1 << 20)):
                size += len(piece)
                out.write(piece)
    if size > most:
        plain.unlink()
        raise RecordingError.of(file, f"unpacks to more than {most:,} bytes; unpack it yourself (unzstd)")
    return str(plain)


def storage_files(path: str) -> list[Path]:
    """Return the files in a rosbag2 folder that hold messages, in the order of their numbers."""
    found = [
        file for file in Path(path).iterdir() if file.name.removesuffix(PACKED).endswith((".db3", ".mcap"))
    ]
    return sorted(
        found, key=lambda file: [int(n) if n.isdigit() else -1 for n in re.split(r"(\d+)", file.stem)]
    )
