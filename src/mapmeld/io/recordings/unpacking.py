"""Undoing the compression of pieces of recordings, never to more than they may hold."""

from __future__ import annotations

import bz2
import io

from mapmeld.extras import required
from mapmeld.io.images import MAX_CELLS
from mapmeld.io.recordings.messages import EXTRA

MAX_PIECE_BYTES = MAX_CELLS + (1 << 24)
"""Largest piece of a recording that is unpacked: the largest map, and what goes with it."""

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"


def unpacked(data: bytes, compression: str, size: int | None = None) -> bytes:
    """Return what was packed as "bz2", "lz4" or "zstd" ("" and "none": as it is).

    Parameters
    ----------
    data
        As it is in the recording.
    size
        How many bytes it must become, if known.

    Raises
    ------
    ValueError
        The compression is not known, or the size is another or too large.
    Exception
        Whatever the libraries raise on damaged data.
    """
    most = MAX_PIECE_BYTES if size is None else size
    if most > MAX_PIECE_BYTES:
        raise ValueError(f"a piece of {most:,} bytes, more than the {MAX_PIECE_BYTES:,} that are read")
    if compression in ("", "none"):
        out = data
    elif compression == "bz2":
        out = bz2.BZ2Decompressor().decompress(data, max_length=most + 1)
    elif compression == "lz4":
        out = required("lz4.frame", EXTRA).LZ4FrameDecompressor().decompress(data, max_length=most + 1)
    elif compression == "zstd":
        reader = required("zstandard", EXTRA).ZstdDecompressor().stream_reader(io.BytesIO(data))
        out = reader.read(most + 1)
    else:
        raise ValueError(f"the unknown compression {compression[:40]!r}")
    if len(out) > most or (size is not None and len(out) != size):
        raise ValueError("a piece that is not of the size it should have")
    return out
