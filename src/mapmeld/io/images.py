"""Read and write the images of maps: PGM by our own parser, PNG and BMP through OpenCV.

What a file declares is checked against its size, and against `MAX_CELLS`, before anything is
allocated. OpenCV is imported only where it decodes or encodes.
"""

from __future__ import annotations

import os
import re
import stat
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from mapmeld.io import AnyPath, MapFileError

MAX_CELLS = 400_000_000
"""Largest map that is read or written: 20,000 x 20,000 cells, 1 km x 1 km at 5 cm."""

MAX_SIDE_OF_PNG_OR_BMP = 1_000_000
"""Greatest width and height that the PNG library below OpenCV accepts."""

_HEADER_BYTES = 1 << 16  # more than any header; comments of a PGM file may be long
_SLACK_BYTES = 1 << 24  # what a file may hold besides its pixels: profiles, texts, comments
_CHUNK_BYTES = 1 << 22

_PNG_MAGIC = b"\x89PNG\r\n\x1a\n"

Samples = NDArray[np.uint8] | NDArray[np.uint16]


@dataclass(frozen=True, slots=True, eq=False)
class Raster:
    """An image as it is in its file.

    Attributes
    ----------
    samples
        uint8 or uint16 array (rows, cols, channels), row 0 at the *top*. Channels: 1 grey, 2 grey
        and opacity, 3 colours, 4 colours and opacity. The order of the colours is not fixed.
    maxval
        The sample that means full brightness, or full opacity.
    """

    samples: Samples
    maxval: int

    @property
    def has_alpha(self) -> bool:
        """Whether the last channel is opacity."""
        return self.samples.shape[2] in (2, 4)


# ---------------------------------------------------------------------- reading
@contextmanager
def open_regular(path: AnyPath, *, may_be_empty: bool = False) -> Iterator[tuple[BufferedReader, int]]:
    """Open a plain file for reading and give it with its size [bytes].

    Pipes and devices, which could block or never end, are refused before they are opened.

    Raises
    ------
    MapFileError
        No such file, not a plain file, empty (unless that is allowed), or not readable.
    """
    try:
        mode = Path(path).stat().st_mode
        if stat.S_ISDIR(mode):
            raise MapFileError.of(path, "is a folder, not a file")
        if not stat.S_ISREG(mode):
            raise MapFileError.of(path, "is not a plain file (a pipe or device?), so it is not read")
        with open(path, "rb") as file:  # noqa: PTH123  (the path is kept as it was given)
            size = os.fstat(file.fileno()).st_size
            if size == 0 and not may_be_empty:
                raise MapFileError.of(path, "is empty")
            yield file, size
    except FileNotFoundError:
        raise MapFileError.of(path, "no such file") from None
    except OSError as error:
        raise MapFileError.of(path, f"cannot be read: {error.strerror or error}") from error
    except ValueError as error:  # a null character in the name
        raise MapFileError.of(path, f"not a usable file name: {error}") from error


def read_image(path: AnyPath) -> Raster:
    """Read a PGM (P2, P5), PNG or BMP image; the content decides which, not the name.

    Raises
    ------
    MapFileError
        Not such an image, damaged, of a size that does not fit the file, without any pixel,
        or over `MAX_CELLS`.
    """
    with open_regular(path) as (file, size):
        head = file.read(_HEADER_BYTES)
        if head[:2] in (b"P2", b"P5"):
            return _read_pgm(file, head, size, path)
        if head.startswith(_PNG_MAGIC):
            return _read_png(file, head, size, path)
        if head[:2] == b"BM":
            return _read_bmp(file, head, size, path)
        if _PNG_MAGIC.startswith(head):
            _truncated(path, "PNG")
        if re.match(rb"P[1346]\s", head):
            raise MapFileError.of(path, f"is a PBM or PPM image (P{head[1:2].decode()}); convert it to PGM")
        raise MapFileError.of(path, f"is not a PGM, PNG or BMP image (begins with {head[:8]!r})")


def _truncated(path: AnyPath, kind: str) -> NoReturn:
    raise MapFileError.of(path, f"the {kind} image is truncated; copy or export it again")


def _check_dimensions(width: int, height: int, path: AnyPath, *, side_limit: int | None = None) -> None:
    if width < 1 or height < 1:
        raise MapFileError.of(path, f"declares {width} x {height} pixels, which is no image")
    if width * height > MAX_CELLS:
        raise MapFileError.of(
            path, f"declares {width} x {height} pixels, more than the {MAX_CELLS:,} that are read"
        )
    if side_limit is not None and max(width, height) > side_limit:
        raise MapFileError.of(path, f"declares {width} x {height} pixels, no side may exceed {side_limit:,}")


def _whole_file(file: BufferedReader, size: int, path: AnyPath) -> NDArray[np.uint8]:
    data = np.empty(size, np.uint8)
    file.seek(0)
    if file.readinto(data.data) != size:
        raise MapFileError.of(path, "shrank while it was being read")
    return data


# ---------------------------------------------------------------------- PGM
# Format: https://netpbm.sourceforge.net/doc/pgm.html
_GAP = re.compile(rb"(?:\s|#[^\r\n]*(?=[\r\n]))*")
_DIGITS = re.compile(rb"[0-9]*")
_COMMENT = re.compile(rb"#[^\r\n]*")
_WHITE = np.zeros(256, np.bool_)
_WHITE[list(b" \t\n\r\v\f")] = True


@dataclass(frozen=True, slots=True)
class _PgmHeader:
    plain: bool
    width: int
    height: int
    maxval: int
    end: int  # offset of the byte after the greatest grey value


def _read_pgm(file: BufferedReader, head: bytes, size: int, path: AnyPath) -> Raster:
    header = _pgm_header(head, path)
    _check_dimensions(header.width, header.height, path)
    samples = (_read_plain if header.plain else _read_packed)(file, size, header, path)
    return Raster(samples.reshape(header.height, header.width, 1), header.maxval)


def _check_values(values: NDArray[np.integer[Any]], first: int, header: _PgmHeader, path: AnyPath) -> None:
    """Refuse pixels brighter than the header says; `values` begin at the pixel counted `first`."""
    if values.size and int(values.max()) > header.maxval:
        at = int(np.argmax(values > header.maxval))
        row, col = divmod(first + at, header.width)
        raise MapFileError.of(
            path,
            f"the pixel in row {row + 1}, column {col + 1} is {values[at]},"
            f" above the greatest value {header.maxval} that the header declares",
        )


def _pgm_header(head: bytes, path: AnyPath) -> _PgmHeader:
    numbers: list[int] = []
    at = 2
    for name in ("width", "height", "greatest grey value"):
        gap = _GAP.match(head, at)
        begin = gap.end() if gap else at
        digits = _DIGITS.match(head, begin)
        end = digits.end() if digits else begin
        # A number or comment that reaches the end of what was read may go on behind it.
        if end == len(head) or head[begin : begin + 1] == b"#":
            raise MapFileError.of(path, f"the PGM image ends within its header, at its {name}")
        if end == begin or begin == at:
            raise MapFileError.of(
                path, f"the PGM header has {head[begin : begin + 8]!r} in place of the {name}"
            )
        if end - begin > 18:
            raise MapFileError.of(path, f"the {name} in the PGM header has {end - begin} digits")
        numbers.append(int(head[begin:end]))
        at = end
    width, height, maxval = numbers
    if not 1 <= maxval <= 65535:
        raise MapFileError.of(path, f"the greatest grey value in the PGM header is {maxval}, not 1..65535")
    if not head[at : at + 1].isspace():
        raise MapFileError.of(path, "white space must follow the greatest grey value in the PGM header")
    return _PgmHeader(head[:2] == b"P2", width, height, maxval, at)


def _read_packed(file: BufferedReader, size: int, header: _PgmHeader, path: AnyPath) -> Samples:
    """Read the raster of a P5 file, flat."""
    sample_bytes = 1 if header.maxval < 256 else 2  # the high byte first
    needed = header.width * header.height * sample_bytes
    begin = header.end + 1
    follow = max(size - begin, 0)
    data = None
    if follow == needed + 1:
        data = _whole_file(file, size, path)
        if data[header.end : header.end + 2].tobytes() == b"\r\n":
            begin += 1  # written in text mode: the one white space became two
            follow = needed
    if follow != needed:
        raise MapFileError.of(
            path,
            f"{'is truncated' if follow < needed else 'does not fit its header'}: it declares"
            f" {header.width} x {header.height} pixels, {needed:,} bytes, but {follow:,} follow",
        )
    if data is None:
        data = _whole_file(file, size, path)
    flat: Samples = data[begin:] if sample_bytes == 1 else data[begin:].view(">u2").astype(np.uint16)
    if header.maxval not in (255, 65535):
        _check_values(flat, 0, header, path)
    return flat


def _read_plain(file: BufferedReader, size: int, header: _PgmHeader, path: AnyPath) -> Samples:
    """Read the raster of a P2 file, flat."""
    count = header.width * header.height
    what = f"declares {header.width} x {header.height} pixels"
    follow = size - header.end
    if follow < 2 * count:  # every value takes a white space and a digit
        raise MapFileError.of(path, f"is truncated: it {what}, but only {follow:,} characters follow")
    if follow > 16 * count + _SLACK_BYTES:
        raise MapFileError.of(path, f"does not fit its header: it {what}, but {follow:,} characters follow")
    text = _whole_file(file, size, path)[header.end :].tobytes()
    if b"#" in text:
        text = _COMMENT.sub(b"", text)
    samples: Samples = np.empty(count, np.uint8 if header.maxval < 256 else np.uint16)  # type: ignore[assignment]
    filled = 0
    for values in _numbers(text, header.width, path):
        if filled + values.size > count:
            raise MapFileError.of(path, f"does not fit its header: it {what}, but more values follow")
        _check_values(values, filled, header, path)
        samples[filled : filled + values.size] = values
        filled += values.size
    if filled < count:
        raise MapFileError.of(path, f"is truncated: it {what}, but only {filled:,} values follow")
    return samples


def _numbers(text: bytes, width: int, path: AnyPath) -> Iterator[NDArray[np.int64]]:
    """Give the numbers in `text`, some at a time: by columns of digits, not number by number."""
    longest = 9
    begin = seen = 0
    while begin < len(text):
        end = min(begin + _CHUNK_BYTES, len(text))
        behind = _DIGITS.match(text, end, end + longest + 1)  # a number must not be cut in two
        end = behind.end() if behind else end
        # White space in front, so that looking back from a first digit stays inside the array.
        piece = np.frombuffer(b" " * (longest + 1) + text[begin:end] + b" ", np.uint8)
        digit = piece - np.uint8(ord("0"))  # wraps around for what is no digit
        is_digit = digit <= 9
        wrong = ~(is_digit | _WHITE[piece])
        last = np.flatnonzero(is_digit[:-1] & ~is_digit[1:])
        if wrong.any():
            at = int(np.argmax(wrong))
            row, col = divmod(seen + int(np.count_nonzero(last < at)), width)
            raise MapFileError.of(
                path, f"has {chr(piece[at])!r} in place of the pixel in row {row + 1}, column {col + 1}"
            )
        values = digit[last].astype(np.int64)
        goes_on = np.ones(last.size, np.bool_)
        for place in range(1, longest + 1):
            goes_on &= is_digit[last - place]
            if not goes_on.any():
                break
            values += np.where(goes_on, digit[last - place], 0).astype(np.int64) * 10**place
        else:
            row, col = divmod(seen + int(np.argmax(goes_on)), width)
            raise MapFileError.of(path, f"the pixel in row {row + 1}, column {col + 1} has too many digits")
        yield values
        seen += values.size
        begin = end


# ---------------------------------------------------------------------- PNG
# Format: https://www.w3.org/TR/png-3/
_PNG_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
_PNG_DEPTHS = {0: (1, 2, 4, 8, 16), 2: (8, 16), 3: (1, 2, 4, 8), 4: (8, 16), 6: (8, 16)}
_ADAM7 = ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2))
_DEFLATE_AT_MOST = 1032  # times that deflate can shrink anything, https://zlib.net/zlib_tech.html


@dataclass(frozen=True, slots=True)
class _PngHeader:
    width: int
    height: int
    depth: int
    colour: int
    interlaced: bool

    def row_bytes(self, width: int) -> int:
        """Bytes of one row of pixels with the byte that names its filter."""
        return 1 + (width * self.depth * _PNG_CHANNELS[self.colour] + 7) // 8

    @property
    def raw_bytes(self) -> int:
        """Bytes of all rows before compression."""
        if not self.interlaced:
            return self.height * self.row_bytes(self.width)
        total = 0
        for x0, y0, dx, dy in _ADAM7:
            width, height = -((x0 - self.width) // dx), -((y0 - self.height) // dy)
            total += height * self.row_bytes(width) if width > 0 and height > 0 else 0
        return total


def _read_png(file: BufferedReader, head: bytes, size: int, path: AnyPath) -> Raster:
    header = _png_header(head, path)
    _check_dimensions(header.width, header.height, path, side_limit=MAX_SIDE_OF_PNG_OR_BMP)
    if size * _DEFLATE_AT_MOST < header.raw_bytes:
        raise MapFileError.of(
            path,
            f"is truncated: it declares {header.width} x {header.height} pixels,"
            f" which {size:,} bytes cannot hold",
        )
    # Stored without compression a pixel's bytes stay about as many as they are.
    if size > header.raw_bytes + header.raw_bytes // 100 + _SLACK_BYTES:
        raise MapFileError.of(
            path,
            f"does not fit its header: it declares {header.width} x {header.height} pixels in {size:,} bytes",
        )
    data = _whole_file(file, size, path)
    transparent = _check_png(data, header, path)
    samples = _decoded(data, header.width, header.height, "PNG", path)
    maxval = 65535 if header.depth == 16 else 255
    if header.colour == 0 and transparent is not None and samples.shape[2] == 1:
        # One grey declared transparent: OpenCV does so for colours, but not for greys.
        grey = transparent * maxval // ((1 << header.depth) - 1)
        alpha = np.where(samples == grey, 0, maxval).astype(samples.dtype)
        samples = np.concatenate([samples, alpha], axis=2)
    return Raster(samples, maxval)


def _png_header(head: bytes, path: AnyPath) -> _PngHeader:
    if len(head) < 33:
        _truncated(path, "PNG")
    length, name, width, height, depth, colour, packing, filtering, interlace = struct.unpack_from(
        ">I4sIIBBBBB", head, 8
    )
    if length != 13 or name != b"IHDR" or depth not in _PNG_DEPTHS.get(colour, ()):
        raise MapFileError.of(path, "the header of the PNG image is damaged")
    if packing != 0 or filtering != 0 or interlace > 1:
        raise MapFileError.of(path, "the header of the PNG image is damaged")
    return _PngHeader(width, height, depth, colour, interlace == 1)


def _check_png(data: NDArray[np.uint8], header: _PngHeader, path: AnyPath) -> int | None:
    """Make sure that a PNG file is whole: every checksum, every row.

    Decoders differ in what they do about damage: some return half an image, some print.
    Returns the grey declared transparent (meaningful for grey images only).
    """
    view = data.data
    inflate = zlib.decompressobj()
    row_bytes = header.row_bytes(header.width)
    seen = 0
    transparent: int | None = None
    at = len(_PNG_MAGIC)
    while True:
        if at + 12 > len(view):
            _truncated(path, "PNG")
        length, name = struct.unpack_from(">I4s", view, at)
        end = at + 12 + length
        if end > len(view):
            _truncated(path, "PNG")
        body = view[at + 8 : end - 4]
        if zlib.crc32(view[at + 4 : end - 4]) != struct.unpack_from(">I", view, end - 4)[0]:
            raise MapFileError.of(path, "the PNG image is damaged (a checksum is wrong)")
        if name == b"tRNS" and header.colour == 0 and length == 2:
            transparent = int.from_bytes(body, "big")
        elif name == b"IDAT":
            waiting: bytes | memoryview = body
            while True:
                try:
                    rows = np.frombuffer(inflate.decompress(waiting, _CHUNK_BYTES), np.uint8)
                except zlib.error:
                    raise MapFileError.of(path, "the PNG image is damaged (it does not decompress)") from None
                if not header.interlaced and (rows[-seen % row_bytes :: row_bytes] > 4).any():
                    raise MapFileError.of(path, "the PNG image is damaged (a row has no known filter)")
                seen += rows.size
                if seen > header.raw_bytes:
                    raise MapFileError.of(path, "does not fit its header: the PNG image has too many rows")
                waiting = inflate.unconsumed_tail
                if not waiting:
                    break
        elif name == b"IEND":
            break
        at = end
    if seen < header.raw_bytes or not inflate.eof:
        _truncated(path, "PNG")
    return transparent


# ---------------------------------------------------------------------- BMP
# Format: https://learn.microsoft.com/windows/win32/gdi/bitmap-storage
_BMP_PLAIN, _BMP_RUNS_8, _BMP_RUNS_4, _BMP_MASKS, _BMP_MASKS_AND_ALPHA = 0, 1, 2, 3, 6


def _read_bmp(file: BufferedReader, head: bytes, size: int, path: AnyPath) -> Raster:
    if len(head) < 26:
        _truncated(path, "BMP")
    offset, header_size = struct.unpack_from("<II", head, 10)
    compression = alpha_mask = 0
    if header_size == 12:
        width, height, _, bits = struct.unpack_from("<HHHH", head, 18)
    elif header_size >= 40:
        if len(head) < 54:
            _truncated(path, "BMP")
        width, height, _, bits, compression = struct.unpack_from("<iiHHI", head, 18)
        if len(head) >= 70 and (header_size >= 56 or compression == _BMP_MASKS_AND_ALPHA):
            alpha_mask = struct.unpack_from("<I", head, 66)[0]
    else:
        raise MapFileError.of(path, "the header of the BMP image is damaged")
    height = abs(height)  # negative: the rows begin at the top
    _check_dimensions(width, height, path, side_limit=MAX_SIDE_OF_PNG_OR_BMP)
    if bits not in (1, 4, 8, 16, 24, 32) or compression not in (0, 1, 2, 3, 6):
        raise MapFileError.of(
            path, f"a BMP image of {bits} bits and compression {compression} is not read; convert it to PNG"
        )
    pixels = (width * bits + 31) // 32 * 4 * height
    if compression in (_BMP_RUNS_8, _BMP_RUNS_4):
        # Two bytes stand for at most 255 pixels.
        if size * 128 < width * height:
            _truncated(path, "BMP")
    elif size < offset + pixels:
        raise MapFileError.of(
            path,
            f"is truncated: it declares {width} x {height} pixels, {pixels:,} bytes,"
            f" but {max(size - offset, 0):,} follow",
        )
    if size > offset + 2 * pixels + _SLACK_BYTES:
        raise MapFileError.of(
            path, f"does not fit its header: it declares {width} x {height} pixels, has {size:,} bytes"
        )
    samples = _decoded(_whole_file(file, size, path), width, height, "BMP", path)
    if samples.shape[2] == 4 and not (alpha_mask and compression in (_BMP_MASKS, _BMP_MASKS_AND_ALPHA)):
        samples = samples[:, :, :3]  # the fourth byte is only padding
    return Raster(samples, 255)


# ---------------------------------------------------------------------- OpenCV
def _decoded(data: NDArray[np.uint8], width: int, height: int, kind: str, path: AnyPath) -> Samples:
    import cv2

    try:
        image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        what = str(error.err if hasattr(error, "err") else error)
        raise MapFileError.of(path, f"OpenCV cannot decode the {kind} image: {what}") from error
    if image is None:
        raise MapFileError.of(path, f"the {kind} image is damaged, or larger than OpenCV is set to read")
    if image.shape[:2] != (height, width) or image.dtype not in (np.uint8, np.uint16):
        raise MapFileError.of(path, f"the {kind} image decodes to something else than its header declares")
    samples: Samples = image.reshape(height, width, -1)  # type: ignore[assignment]
    return samples


# ---------------------------------------------------------------------- writing
def pgm_pieces(grey: NDArray[np.uint8]) -> tuple[bytes, memoryview]:
    """Return the 8-bit P5 file of a grey image (rows, cols), row 0 at the top, in two pieces."""
    rows, cols = grey.shape
    return f"P5\n{cols} {rows}\n255\n".encode(), np.ascontiguousarray(grey).reshape(-1).data


def png_pieces(image: NDArray[np.uint8], path: AnyPath) -> tuple[memoryview]:
    """Return the PNG file of a grey (rows, cols) or BGRA (rows, cols, 4) image, row 0 at the top.

    Raises
    ------
    MapFileError
        A side is longer than the PNG library takes; `path` is for the message.
    """
    import cv2

    if max(image.shape[:2]) > MAX_SIDE_OF_PNG_OR_BMP:
        raise MapFileError.of(path, f"no side of a PNG may exceed {MAX_SIDE_OF_PNG_OR_BMP:,} cells; use PGM")
    try:
        done, data = cv2.imencode(".png", image)
    except cv2.error as error:
        raise MapFileError.of(path, f"OpenCV cannot encode the image: {error}") from error
    if not done:
        raise MapFileError.of(path, "OpenCV cannot encode the image")
    return (data.reshape(-1).data,)
