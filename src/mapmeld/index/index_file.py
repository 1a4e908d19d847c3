"""An index as one file.

    line 1     ``mapmeld index 1``
    line 2     JSON of one line: version of the signatures, folder of maps (relative to the file), and of each
               map its name, image, two stamps and number of words; and a checksum of all that follows
    the rest   words of all maps, uint16; their counts, uint16; little-endian

Nothing in it is executed, and no size is believed that the file's own size does not bear out.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from mapmeld.index.entries import IndexedMap, MapIndex, MapIndexError, Stamp
from mapmeld.index.signature import Signature, signature_version, vocabulary
from mapmeld.io import MapFileError
from mapmeld.io.atomic import write_files
from mapmeld.io.images import open_regular

MAGIC = b"mapmeld index 1\n"
MAX_BYTES = 1 << 32
"""Largest file that is read; a map takes about 2 KB."""

_BYTES_A_WORD = 4


def write_index(index: MapIndex, path: Path) -> None:
    """Write an index whole or not at all, in the place of one that is there.

    Raises
    ------
    MapFileError
        The file cannot be written.
    """
    words = np.concatenate([np.zeros(0, np.uint16), *(m.signature.words for m in index.maps)])
    counts = np.concatenate([np.zeros(0, np.uint16), *(m.signature.counts for m in index.maps)])
    rest = words.astype("<u2").tobytes() + counts.astype("<u2").tobytes()
    head = {
        "signatures": signature_version(),
        "maps_in": Path(os.path.relpath(index.root.resolve(), path.resolve().parent)).as_posix(),
        "maps": [
            [
                m.name,
                m.image,
                *(number for s in m.stamps for number in (s.size, s.changed)),
                len(m.signature.words),
            ]
            for m in index.maps
        ],
        "checksum": hashlib.blake2b(rest, digest_size=16).hexdigest(),
    }
    write_files([(path, [MAGIC, json.dumps(head).encode() + b"\n", rest])], force=True)


def is_index(path: Path) -> bool:
    """Whether a file says that it is an index, of whatever version."""
    try:
        with open_regular(path) as (file, _):
            return file.read(len(MAGIC) - 2) == MAGIC[:-2]
    except MapFileError:
        return False


def read_index(path: Path) -> MapIndex:
    """Read an index.

    Raises
    ------
    MapFileError
        There is no such file, or it cannot be read.
    MapIndexError
        It is no index, of another version, or damaged.
    """
    with open_regular(path) as (file, size):
        if size > MAX_BYTES:
            raise MapIndexError.of(path, f"is too large for an index ({size:,} bytes, {MAX_BYTES:,} at most)")
        magic = file.read(len(MAGIC))
        if magic != MAGIC:
            if magic[:-2] == MAGIC[:-2]:
                raise MapIndexError.of(path, _OTHER_VERSION)
            raise MapIndexError.of(path, "is not an index of mapmeld; 'mapmeld index' makes one")
        head, rest = file.readline(), file.read()
    try:
        fields = json.loads(head)
        if fields["signatures"] != signature_version():
            raise MapIndexError.of(path, _OTHER_VERSION)
        if fields["checksum"] != hashlib.blake2b(rest, digest_size=16).hexdigest():
            raise ValueError("its checksum is wrong")
        maps = _maps(fields["maps"], rest)
        root = Path(os.path.normpath(path.resolve().parent / _text(fields["maps_in"])))
    except (ValueError, TypeError, KeyError, IndexError, RecursionError, OverflowError) as error:
        what = f"it has no {error}" if isinstance(error, KeyError) else " ".join(str(error).split())[:150]
        raise MapIndexError.of(
            path, f"is damaged ({what}); make it again with 'mapmeld index --force'"
        ) from None
    return MapIndex(root, maps)


_OTHER_VERSION = "was made by another version of mapmeld; make it again with 'mapmeld index --force'"


def _maps(rows: Sequence[Any], rest: bytes) -> tuple[IndexedMap, ...]:
    lengths = [_whole(row[6]) for row in rows]
    total = sum(lengths)
    if total * _BYTES_A_WORD != len(rest):
        raise ValueError(f"{len(rest)} bytes of words instead of {total * _BYTES_A_WORD}")
    words = np.frombuffer(rest, "<u2", total).astype(np.uint16)
    counts = np.frombuffer(rest, "<u2", total, offset=2 * total).astype(np.uint16)
    if total and (int(words.max()) >= len(vocabulary()) or not counts.all()):
        raise ValueError("words or counts that cannot be")
    maps = []
    at = 0
    for (name, image, *stamps, _), length in zip(rows, lengths, strict=True):
        own = words[at : at + length]
        if (np.diff(own.astype(np.int64)) <= 0).any():
            raise ValueError("words out of order")
        size, changed, image_size, image_changed = map(_whole, stamps)
        maps.append(
            IndexedMap(
                _inside(_text(name)),
                _text(image),
                (Stamp(size, changed), Stamp(image_size, image_changed)),
                Signature(own, counts[at : at + length]),
            )
        )
        at += length
    if len({m.name for m in maps}) != len(maps):
        raise ValueError("a map is in it twice")
    return tuple(maps)


def _whole(value: object) -> int:
    if type(value) is not int or not 0 <= value < 1 << 63:
        raise ValueError("a number that is none")
    return value


def _text(value: object) -> str:
    if not isinstance(value, str) or "\0" in value:
        raise ValueError("a name that is none")
    return value


def _inside(name: str) -> str:
    """Check that a name stays inside the folder of maps."""
    path = PurePosixPath(name)
    if (
        not path.parts
        or path.is_absolute()
        or ".." in path.parts
        or path.suffix.lower() not in (".yaml", ".yml")
    ):
        raise ValueError("the name of a map that leads out of the folder of maps, or to no map")
    return name
