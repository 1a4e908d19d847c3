"""What is left of a .db3 file of rosbag2: its rows one after the other, past those that cannot be read."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from mapmeld.io.recordings.scanning import Damage, ScannedSource
from mapmeld.io.recordings.source import Channel, Message, Source, damage_said, full_type, reason_of

MAGIC = b"SQLite format 3\0"
_LAST_ID = 2**63 - 1


@contextmanager
def sqlite_scan(path: str) -> Iterator[Source]:
    """Open a .db3 file and read what can be read of it."""
    with damage_said(path):
        # Immutable: neither locks nor journals are looked for beside it, nor written.
        database = sqlite3.connect(f"{Path(path).absolute().as_uri()}?mode=ro&immutable=1", uri=True)
    with closing(database):
        with damage_said(path):
            rows = database.execute("SELECT id, name, type, serialization_format FROM topics").fetchall()
            topics = {
                key: Channel(str(name), full_type(str(kind)), str(form)) for key, name, kind, form in rows
            }
        yield ScannedSource(path, lambda damage: _scan(database, topics, damage), strict=False)


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
