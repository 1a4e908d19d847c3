"""Image files put together byte by byte, so that what is read is not what the same code wrote."""

import struct
import zlib
from collections.abc import Sequence

Pixels = Sequence[Sequence[Sequence[int]]]
"""Rows from the top, of pixels, of samples (red, green, blue order)."""


def pgm(width: int, height: int, maxval: int, data: bytes) -> bytes:
    return b"P5\n%d %d\n%d\n" % (width, height, maxval) + data


def chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def png_of(
    width: int, height: int, depth: int, colour: int, raw: bytes, extra: bytes = b"", interlace: int = 0
) -> bytes:
    """A PNG around rows that are given as they are before compression."""
    header = struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, interlace)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + extra
        + chunk(b"IDAT", zlib.compress(raw))
        + chunk(b"IEND", b"")
    )


def png(pixels: Pixels, depth: int = 8) -> bytes:
    """Grey, grey and opacity, RGB or RGBA, by the number of samples of a pixel."""
    colour = {1: 0, 2: 4, 3: 2, 4: 6}[len(pixels[0][0])]
    size = depth // 8
    raw = b"".join(
        b"\0" + b"".join(sample.to_bytes(size, "big") for pixel in row for sample in pixel) for row in pixels
    )
    return png_of(len(pixels[0]), len(pixels), depth, colour, raw)


def bmp(width: int, height: int, bits: int, rows: bytes, palette: bytes = b"", compression: int = 0) -> bytes:
    """A BMP of the usual header; `rows` from the bottom (from the top if height < 0), padded to four."""
    offset = 54 + len(palette)
    return (
        b"BM"
        + struct.pack("<IHHI", offset + len(rows), 0, 0, offset)
        + struct.pack("<IiiHHIIiiII", 40, width, height, 1, bits, compression, len(rows), 0, 0, 0, 0)
        + palette
        + rows
    )
