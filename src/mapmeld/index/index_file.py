"""An index as one file.

    line 1     ``mapmeld index 3``
    line 2     JSON of one line: version of the signatures, folder of maps (relative to the file), of each
               map its name, image and two stamps; and a checksum of the tables
    tables     lengths of the signatures, float32; owners of each word, uint32; checksums of the rows,
               uint32
    rows       weights, uint8, one row for each word; little-endian, as the tables

A query reads the rows of its own words, a tenth of the file, and nothing is made ready. Nothing in it is
executed, and no size is believed that the file's own size does not bear out.
"""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Sequence
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np

from mapmeld.index.entries import IndexedMap, MapIndex, MapIndexError, Stamp
from mapmeld.index.ranking import Ranking
from mapmeld.index.signature import Signature, signature_version, word_count
from mapmeld.io import MapFileError
from mapmeld.io.atomic import write_files
from mapmeld.io.images import open_regular

MAGIC = b"mapmeld index 3\n"
MAX_BYTES = 1 << 32
"""Largest file that is read; a map takes about 4 KB."""
MAX_HEAD_BYTES = 1 << 28
"""Longest second line that is read: those of a million maps are shorter."""


def write_index(index: MapIndex, path: Path) -> None:
    """Write an index whole or not at all, in the place of one that is there.

    Raises
    ------
    MapFileError
        The file cannot be written.
    """
    ranking = index.ranking
    rows = ranking.weights[ranking.rows_of(np.arange(word_count()))]
    checksums = np.array([zlib.crc32(row) for row in rows], "<u4")
    tables = b"".join(
        table.tobytes() for table in (ranking.lengths.astype("<f4"), ranking.owners.astype("<u4"), checksums)
    )
    head = {
        "signatures": signature_version(),
        "maps_in": Path(os.path.relpath(index.root.resolve(), path.resolve().parent)).as_posix(),
        "maps": [
            [m.name, m.image, *(number for s in m.stamps for number in (s.size, s.changed))]
            for m in index.maps
        ],
        "checksum": zlib.crc32(tables),
    }
    write_files([(path, [MAGIC, json.dumps(head).encode() + b"\n", tables, rows.tobytes()])], force=True)


def is_index(path: Path) -> bool:
    """Whether a file says that it is an index, of whatever version."""
    try:
        with open_regular(path) as (file, _):
            return file.read(len(MAGIC) - 2) == MAGIC[:-2]
    except MapFileError:
        return False


def read_index(path: Path, asked: Signature | None = None) -> MapIndex:
    """Read an index.

    Parameters
    ----------
    path
        The file.
    asked
        Read only what it takes to rank the maps by their likeness to this one.

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
        try:
            fields = json.loads(file.readline(MAX_HEAD_BYTES))
            if fields["signatures"] != signature_version():
                raise MapIndexError.of(path, _OTHER_VERSION)
            maps = _maps(fields["maps"])
            ranking = _ranking(file, size - file.tell(), len(maps), fields["checksum"], asked)
            root = Path(os.path.normpath(path.resolve().parent / _text(fields["maps_in"])))
        except (ValueError, TypeError, KeyError, IndexError, RecursionError, OverflowError) as error:
            what = f"it has no {error}" if isinstance(error, KeyError) else " ".join(str(error).split())[:150]
            raise MapIndexError.of(
                path, f"is damaged ({what}); make it again with 'mapmeld index --force'"
            ) from None
    return MapIndex(root, maps, ranking)


_OTHER_VERSION = "was made by another version of mapmeld; make it again with 'mapmeld index --force'"


def _maps(rows: Sequence[Any]) -> tuple[IndexedMap, ...]:
    maps = []
    for name, image, *numbers in rows:
        size, changed, image_size, image_changed = map(_whole, numbers)
        stamps = Stamp(size, changed), Stamp(image_size, image_changed)
        maps.append(IndexedMap(_inside(_text(name)), _text(image), stamps))
    if len({m.name for m in maps}) != len(maps):
        raise ValueError("a map is in it twice")
    return tuple(maps)


def _ranking(
    file: BufferedReader, size: int, count: int, checksum: object, asked: Signature | None
) -> Ranking:
    words = word_count()
    needed = 4 * count + 8 * words + words * count
    if size != needed:
        raise ValueError(f"{size} bytes of signatures instead of {needed}")
    tables = file.read(4 * count + 8 * words)
    if checksum != zlib.crc32(tables):
        raise ValueError("its checksum is wrong")
    lengths = np.frombuffer(tables, "<f4", count).astype(np.float32)
    owners, checksums = np.frombuffer(tables, "<u4", offset=4 * count).astype(np.uint32).reshape(2, words)
    # Weights may be any bytes.
    if not (np.isfinite(lengths).all() and (lengths >= 0).all() and (owners <= count).all()):
        raise ValueError("lengths or counts that cannot be")
    at_hand = np.arange(words) if asked is None else np.flatnonzero(asked.weights)
    weights = np.empty((len(at_hand), count), np.uint8)
    first = file.tell()
    for row, word in zip(weights, at_hand.tolist(), strict=True):
        file.seek(first + word * count)
        packed = file.read(count)
        if checksums[word] != zlib.crc32(packed):
            raise ValueError("a checksum in it is wrong")
        row[:] = np.frombuffer(packed, np.uint8)
    rows = np.full(words, -1)
    rows[at_hand] = np.arange(len(at_hand))
    return Ranking(weights, rows, owners, lengths)


def _whole(value: object) -> int:
    if type(value) is not int or not 0 <= value < 1 << 63:
        raise ValueError("a number that is none")
    return value


def _text(value: object) -> str:
    if not isinstance(value, str) or "\0" in value:
        raise ValueError("a name that is none")
    value.encode()  # lone surrogates are no text
    return value


def _inside(name: str) -> str:
    """Check that a name stays inside the folder of maps."""
    parts = name.split("/")
    if not parts[0] or ".." in parts or not parts[-1].lower().endswith((".yaml", ".yml")):
        raise ValueError("the name of a map that leads out of the folder of maps, or to no map")
    return name
