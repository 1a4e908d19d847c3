"""MCAP files, of whatever profile, through the library mcap: by their index, or from front to back."""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, BinaryIO

from mapmeld.extras import required
from mapmeld.io.images import open_regular
from mapmeld.io.recordings.messages import EXTRA
from mapmeld.io.recordings.scanning import Damage, ScannedSource
from mapmeld.io.recordings.source import Channel, Message, Source, damage_said, full_type, reason_of
from mapmeld.io.recordings.unpacking import MAX_PIECE_BYTES, unpacked

MAGIC = b"\x89MCAP0\r\n"
_FOOTER_BYTES = 1 + 8 + 20  # opcode, length; where the summary begins, its offsets, its checksum


@contextmanager
def mcap_source(path: str, *, strict: bool) -> Iterator[Source]:
    """Open an MCAP file.

    Parameters
    ----------
    path
        The file.
    strict
        Refuse one that is damaged; otherwise read what can be read.
    """
    with open_regular(path) as (file, size):
        with damage_said(path):
            source = _indexed(path, file, size) if strict else None
        schemas: dict[int, Any] = {}
        channels: dict[int, Channel] = {}
        yield source or ScannedSource(
            path, lambda damage: _scan(file, schemas, channels, damage), strict=strict
        )


# ---------------------------------------------------------------------- by the index
class _IndexedSource:
    """An MCAP file whose summary tells where everything is."""

    def __init__(self, path: str, reader: Any, summary: Any) -> None:
        self._path = path
        self._reader = reader
        self._channels = {i: _channel_of(found, summary.schemas) for i, found in summary.channels.items()}
        self.channels = tuple(dict.fromkeys(self._channels.values()))
        starts = [index.message_start_time for index in summary.chunk_indexes if index.message_index_length]
        self.start: int | None = min(starts, default=None)
        self.left_out: Counter[str] = Counter()
        self.damage: Counter[str] = Counter()

    def messages(self, wanted: Collection[Channel]) -> Iterator[Message]:
        """Give the messages of some channels."""
        topics = {channel.topic for channel in wanted}
        with damage_said(self._path):
            for _, found, message in self._reader.iter_messages(topics=topics):
                channel = self._channels[found.id]
                if channel in wanted:
                    yield Message(channel, message.log_time, message.data)


def _indexed(path: str, file: BinaryIO, size: int) -> Source | None:
    """Open a file by its index; None if it has none that tells of all channels and chunks."""
    reader = required("mcap.reader", EXTRA).SeekingReader(
        file, validate_crcs=True, record_size_limit=MAX_PIECE_BYTES
    )
    reader.get_header()
    summary = reader.get_summary()
    if summary:
        _check_summary(file, size)
    statistics = summary and summary.statistics
    if not statistics or statistics.channel_count != len(summary.channels):
        return None
    # Without message indexes, nothing tells in which chunk to look for which channel.
    indexes = summary.chunk_indexes
    if not indexes or statistics.chunk_count != len(indexes):
        return None
    if any(index.uncompressed_size > MAX_PIECE_BYTES for index in indexes):
        raise ValueError(f"chunks of more than {MAX_PIECE_BYTES:,} bytes")
    return _IndexedSource(path, reader, summary)


def _check_summary(file: BinaryIO, size: int) -> None:
    """Compare the summary with its checksum, which the library does not look at."""
    end = size - len(MAGIC) - 4
    file.seek(size - len(MAGIC) - _FOOTER_BYTES + 9)
    begin = int.from_bytes(file.read(8), "little")
    file.seek(end)
    expected = int.from_bytes(file.read(4), "little")
    file.seek(begin)
    if expected and zlib.crc32(file.read(max(end - begin, 0))) != expected:
        raise ValueError("the checksum of the summary is wrong")


# ---------------------------------------------------------------------- from front to back
def _scan(
    file: BinaryIO, schemas: dict[int, Any], channels: dict[int, Channel], damage: Damage
) -> Iterator[Message]:
    """Give the messages of channels that are known or become so on the way."""
    streams = required("mcap.stream_reader", EXTRA)
    kinds = required("mcap.records", EXTRA)
    file.seek(0)
    records = streams.StreamReader(file, emit_chunks=True, record_size_limit=MAX_PIECE_BYTES).records
    while True:
        try:
            record = next(records)
        except StopIteration:
            return
        except Exception as error:  # see damage_said
            damage(f"all from a place on where the file is damaged or cut off: {reason_of(error)}")
            return
        found = [record]
        if isinstance(record, kinds.Chunk):
            try:
                found = _inside(record, streams)
            except Exception as error:
                damage(f"a chunk that is damaged: {reason_of(error)}")
                continue
        messages = []
        for item in found:
            if isinstance(item, kinds.Schema):
                schemas[item.id] = item
            elif isinstance(item, kinds.Channel):
                channels[item.id] = _channel_of(item, schemas)
            elif isinstance(item, kinds.Message):
                if item.channel_id in channels:
                    messages.append(Message(channels[item.channel_id], item.log_time, item.data))
                else:
                    damage("a message of a channel that is not described")
        yield from sorted(messages, key=lambda message: message.received)


def _inside(chunk: Any, streams: Any) -> list[Any]:
    """Return the records in a chunk, all of them or none."""
    data = unpacked(chunk.data, chunk.compression, chunk.uncompressed_size)
    return list(streams.breakup_chunk(replace(chunk, data=data, compression=""), validate_crc=True))


def _channel_of(found: Any, schemas: dict[int, Any]) -> Channel:
    schema = schemas.get(found.schema_id)
    return Channel(found.topic, full_type(schema.name) if schema else "", found.message_encoding)
