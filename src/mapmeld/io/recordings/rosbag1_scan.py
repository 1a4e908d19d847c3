"""What is left of a rosbag1 file: its records from front to back, without the index at its end.

The format is that of https://wiki.ros.org/Bags/Format/2.0: records of a header with ``name=value`` fields and
data, some of them within chunks. A recording that was not closed properly (``.bag.active``) is one without
an index.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import BinaryIO

from mapmeld.io.images import open_regular
from mapmeld.io.recordings.messages import ROS1
from mapmeld.io.recordings.scanning import Damage, ScannedSource
from mapmeld.io.recordings.source import Channel, Message, Source, full_type, reason_of
from mapmeld.io.recordings.unpacking import MAX_PIECE_BYTES, unpacked

MAGIC = b"#ROSBAG V2.0\n"
_MESSAGE, _CHUNK, _CONNECTION = 2, 5, 7
_MAX_HEADER_BYTES = 1 << 20

Header = Mapping[bytes, bytes]


@contextmanager
def rosbag1_scan(path: str) -> Iterator[Source]:
    """Open a rosbag1 file and read what can be read of it."""
    connections: dict[bytes, Channel] = {}
    with open_regular(path) as (file, size):
        yield ScannedSource(path, lambda damage: _scan(file, size, connections, damage), strict=False)


def _scan(file: BinaryIO, size: int, connections: dict[bytes, Channel], damage: Damage) -> Iterator[Message]:
    """Give the messages of connections that are known or become so on the way."""
    file.seek(len(MAGIC))
    while file.tell() < size:
        try:
            header, length = _next_header(file)
            kind = header[b"op"][0]
            if length > size - file.tell():
                damage("all from a place on where the file is damaged or cut off: the end of the file")
                length = size - file.tell()
            if kind not in (_MESSAGE, _CHUNK, _CONNECTION):
                file.seek(length, 1)
                continue
            data = file.read(length)
        except Exception as error:  # lengths, fields, anything may be wrong
            damage(f"all from a place on where the file is damaged or cut off: {reason_of(error)}")
            return
        found: list[Message] = []
        try:
            for inner_header, inner_data in _unchunked(header, data) if kind == _CHUNK else [(header, data)]:
                found += _taken(inner_header, inner_data, connections, damage)
        except Exception as error:  # what came before it in the chunk is kept
            damage(f"a chunk that is damaged: {reason_of(error)}")
        yield from sorted(found, key=lambda message: message.received)


def _taken(
    header: Header, data: bytes, connections: dict[bytes, Channel], damage: Damage
) -> Iterator[Message]:
    """Take note of a connection; give a message."""
    kind = header[b"op"][0]
    if kind == _CONNECTION:
        name = _fields(data)[b"type"].decode()
        connections[header[b"conn"]] = Channel(header[b"topic"].decode(), full_type(name), ROS1)
    elif kind == _MESSAGE:
        seconds, nanoseconds = struct.unpack("<LL", header[b"time"])
        if header[b"conn"] in connections:
            yield Message(connections[header[b"conn"]], seconds * 10**9 + nanoseconds, data)
        else:
            damage("a message of a connection that is not described")


def _next_header(file: BinaryIO) -> tuple[Header, int]:
    """Read the header of the next record and the length of its data, which follows."""
    length = int.from_bytes(_exactly(file, 4), "little")
    if length > _MAX_HEADER_BYTES:
        raise ValueError(f"a header of {length:,} bytes")
    header = _fields(_exactly(file, length))
    length = int.from_bytes(_exactly(file, 4), "little")
    if length > MAX_PIECE_BYTES:
        raise ValueError(f"a record of {length:,} bytes")
    return header, length


def _unchunked(header: Header, data: bytes) -> Iterator[tuple[Header, bytes]]:
    compression = header[b"compression"].decode()
    if compression == "none":  # may be cut off, and is of use all the same
        return _records(data)
    return _records(unpacked(data, compression, int.from_bytes(header[b"size"], "little")))


def _records(data: bytes) -> Iterator[tuple[Header, bytes]]:
    """Give header and data of every record in a chunk."""
    at = 0
    while at < len(data):
        header, at = _sized(data, at)
        content, at = _sized(data, at)
        yield _fields(header), content


def _fields(data: bytes) -> Header:
    fields = {}
    at = 0
    while at < len(data):
        field, at = _sized(data, at)
        name, _, value = field.partition(b"=")
        fields[name] = value
    return fields


def _sized(data: bytes, at: int) -> tuple[bytes, int]:
    """Return the bytes whose number stands at a place, and where they end."""
    (length,) = struct.unpack_from("<L", data, at)
    end = at + 4 + length
    if end > len(data):
        raise ValueError("a part that is longer than the whole")
    return data[at + 4 : end], end


def _exactly(file: BinaryIO, count: int) -> bytes:
    data = file.read(count)
    if len(data) != count:
        raise ValueError("the end of the file")
    return data
