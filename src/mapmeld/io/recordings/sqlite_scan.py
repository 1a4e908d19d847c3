"""What is left of a .db3 file of rosbag2: its rows one after the other, past those that cannot be read."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from mapmeld.io.images import open_regular
from mapmeld.io.recordings.scanning import Damage, ScannedSource
from mapmeld.io.recordings.source import Channel, Message, Source, damage_said, full_type, reason_of

MAGIC = b"SQLite format 3\0"
_HEADER_BYTES = 100
_LAST_ID = 2**63 - 1


@contextmanager
def sqlite_scan(path: str) -> Iterator[Source]:
    """Open a .db3 file and read what can be read of it."""
    with ExitStack() as stack:
        file = _with_whole_pages(path, stack)
        with damage_said(path):
            # Immutable: neither locks nor journals are looked for beside it, nor written.
            database = sqlite3.connect(f"{Path(file).absolute().as_uri()}?mode=ro&immutable=1", uri=True)
            stack.enter_context(closing(database))
            rows = database.execute("SELECT id, name, type, serialization_format FROM topics").fetchall()
            topics = {
                key: Channel(str(name), full_type(str(kind)), str(form)) for key, name, kind, form in rows
            }
        yield ScannedSource(path, lambda damage: _scan(database, topics, damage), strict=False)


def _with_whole_pages(path: str, stack: ExitStack) -> str:
    """Return a file that is as long as its header says: a temporary copy of one that is cut off.

    SQLite would not open that, or, made to, take what is missing for zeros.
    """
    with open_regular(path) as (file, size):
        header = file.read(_HEADER_BYTES)
        page = int.from_bytes(header[16:18], "big")
        page = 65536 if page == 1 else page
        if page < 512 or int.from_bytes(header[28:32], "big") <= size // page:
            return path
        copy = Path(stack.enter_context(TemporaryDirectory()), "whole.db3")
        with damage_said(path), copy.open("w+b") as out:
            file.seek(0)
            shutil.copyfileobj(file, out)
            out.truncate(size // page * page)
            out.seek(28)
            out.write((size // page).to_bytes(4, "big"))
        return str(copy)


def _scan(database: sqlite3.Connection, topics: dict[int, Channel], damage: Damage) -> Iterator[Message]:
    after, skip = -(2**63), 0
    while True:
        try:
            query = "SELECT id, topic_id, timestamp, data FROM messages WHERE id > ? ORDER BY id"
            for key, topic, received, data in database.execute(query, (after,)):
                after, skip = key, 0
                if topic in topics and isinstance(received, int) and isinstance(data, bytes):
                    yield Message(topics[topic], received, data)
                else:
                    damage("a row that is no message")
            return
        except sqlite3.Error as error:
            damage(f"rows that are damaged: {reason_of(error)}")
            # Ever farther on, until something can be read again: the steps to the end are few.
            skip = max(1, 2 * skip)
            after = max(after, 0) + skip
            if after >= _LAST_ID:
                return
