import os
import random
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from image_files import bmp, chunk, pgm, png, png_of

from mapmeld.io import MapFileError
from mapmeld.io import images as images_module
from mapmeld.io.images import MAX_CELLS, Raster, pgm_pieces, png_pieces, read_image

Read = Callable[[bytes], Raster]


@pytest.fixture
def read(tmp_path: Path) -> Read:
    def read_bytes(data: bytes) -> Raster:
        path = tmp_path / "map.pgm"
        path.write_bytes(data)
        return read_image(path)

    return read_bytes


def samples(raster: Raster) -> list[list[list[int]]]:
    rows: list[list[list[int]]] = raster.samples.tolist()
    return rows


# ---------------------------------------------------------------------- PGM
@pytest.mark.parametrize(
    "data",
    [
        b"P5\n3 2\n255\n\x01\x02\x03\x04\x05\x06",
        b"P5 3 2 255 \x01\x02\x03\x04\x05\x06",
        b"P5\r\n3\t2\r\n255\r\n\x01\x02\x03\x04\x05\x06",
        b"P5\n# CREATOR: map_saver.cpp 0.050 m/pix\n3 2\n255\n\x01\x02\x03\x04\x05\x06",
        b"P5 # 7 7 7\r3# width\n#\n # two\n2\n#last\n255\n\x01\x02\x03\x04\x05\x06",
        b"P2\n3 2\n255\n1 2 3\n4 5 6\n",
        b"P2 3 2 255 1 2 3 4 5 6",
        b"P2\n# c\n3 2 # c\n255\n1 2 # 9 9 9\n3\r\n4\t5 006",
    ],
)
def test_both_kinds_of_pgm_with_comments_and_any_white_space(read: Read, data: bytes) -> None:
    raster = read(data)
    assert samples(raster) == [[[1], [2], [3]], [[4], [5], [6]]]
    assert (raster.maxval, raster.has_alpha) == (255, False)


def test_the_first_pixel_may_look_like_white_space_or_a_comment(read: Read) -> None:
    assert samples(read(b"P5 2 1 255\n\n#")) == [[[10], [35]]]
    assert samples(read(b"P5 2 1 255\r\n#")) == [[[10], [35]]]


def test_sixteen_bits_have_the_high_byte_first(read: Read) -> None:
    raster = read(pgm(2, 1, 65535, b"\x01\x02\xff\xfe"))
    assert samples(raster) == [[[0x0102], [0xFFFE]]]
    assert raster.maxval == 65535
    # An odd and an even offset of the pixels in the file.
    assert samples(read(b"P5 2 1 4095 \x01\x02\x0f\xff")) == samples(read(b"P5  2 1 4095 \x01\x02\x0f\xff"))
    assert samples(read(b"P2 2 1 65535 258 65534")) == [[[258], [65534]]]


@given(st.integers(1, 65535), st.integers(1, 9), st.integers(1, 9), st.randoms(use_true_random=False))
def test_plain_and_packed_pgm_agree(
    tmp_path_factory: pytest.TempPathFactory,
    maxval: int,
    width: int,
    height: int,
    dice: random.Random,
) -> None:
    values = [dice.randint(0, maxval) for _ in range(width * height)]
    packed = b"".join(v.to_bytes(1 if maxval < 256 else 2, "big") for v in values)
    plain = f"P2 {width} {height} {maxval} " + " ".join(map(str, values))
    folder = tmp_path_factory.mktemp("pgm")
    (folder / "a").write_bytes(pgm(width, height, maxval, packed))
    (folder / "b").write_text(plain)
    a, b = read_image(folder / "a"), read_image(folder / "b")
    assert a.samples.reshape(-1).tolist() == b.samples.reshape(-1).tolist() == values
    assert a.samples.shape == b.samples.shape == (height, width, 1)
    assert a.maxval == b.maxval == maxval


def test_numbers_that_straddle_the_pieces_in_which_text_is_read(
    read: Read, monkeypatch: pytest.MonkeyPatch
) -> None:
    values = [0, 7, 65535, 10, 123, 40000, 9, 8, 12345, 1]
    for piece in range(1, 20):
        monkeypatch.setattr(images_module, "_CHUNK_BYTES", piece)
        raster = read(b"P2 5 2 65535\n" + b" ".join(b"%d" % v for v in values))
        assert raster.samples.reshape(-1).tolist() == values


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"P5", "ends within its header, at its width"),
        (b"P5 3", "ends within its header, at its width"),
        (b"P5 3 2", "ends within its header, at its height"),
        (b"P5 3 2 255", "ends within its header, at its greatest grey value"),
        (b"P5 3 2 # no end", "ends within its header, at its greatest grey value"),
        (b"P5 three 2 255 ", "b'three 2 ' in place of the width"),
        (b"P5 -3 2 255 ", "in place of the width"),
        (b"P53 2 255 abcdef", "in place of the width"),
        (b"P5 3 2.0 255 ", "in place of the greatest grey value"),
        (b"P5 3 2 0 abcdef", "greatest grey value in the PGM header is 0, not 1..65535"),
        (b"P5 3 2 65536 abcdef", "is 65536, not 1..65535"),
        (b"P5 3 2 255#abcdef", "white space must follow"),
        (b"P5 0 2 255 ", "declares 0 x 2 pixels, which is no image"),
        (b"P2 2 0 255 ", "declares 2 x 0 pixels, which is no image"),
        (b"P5 3 2 255 abc", "is truncated: it declares 3 x 2 pixels, 6 bytes, but 3 follow"),
        (b"P5 3 2 65535 abcdef", "is truncated: it declares 3 x 2 pixels, 12 bytes, but 6 follow"),
        (b"P5 3 2 255 abcdefgh", "does not fit its header: it declares 3 x 2 pixels, 6 bytes, but 8 follow"),
        (b"P5 3 2 255 abcdefg", "does not fit its header"),
        (b"P5 20000 20001 255 abc", "more than the 400,000,000 that are read"),
        (b"P5 20000 20000 255 abc", "is truncated"),
        (b"P2 20000 20000 255 1 2", "20000 x 20000 pixels, but only 4 characters follow"),
        (b"P5 99999999999999999 99999999999999999 255 abc", "more than the 400,000,000"),
        (b"P5 " + b"9" * 5000 + b" 1 255 abc", "the width in the PGM header has 5000 digits"),
        (b"P5 3 1 100 \x00\x65\x64", "row 1, column 2 is 101, above the greatest value 100"),
        (b"P5 1 2 1000 \x00\x00\x03\xe9", "row 2, column 1 is 1001, above the greatest value 1000"),
        (b"P2 2 2 100 1 2 3 101", "row 2, column 2 is 101, above the greatest value 100"),
        (b"P2 2 2 255 1 2 3 256", "row 2, column 2 is 256, above the greatest value 255"),
        (b"P2 2 2 255 1 2 3    ", "is truncated: it declares 2 x 2 pixels, but only 3 values follow"),
        (b"P2 2 2 255 1 2 3 4 5", "does not fit its header: it declares 2 x 2 pixels, but more values"),
        (b"P2 2 2 255 1 2 -3 4", "has '-' in place of the pixel in row 2, column 1"),
        (b"P2 2 2 255 1 2.5 3 4", "has '.' in place of the pixel"),
        (b"P2 2 2 255 1 2 3 99999999999999999999", "row 2, column 2 has too many digits"),
        (b"P4 8 1 \x00", "is a PBM or PPM image (P4); convert it to PGM"),
        (b"P6 1 1 255 abc", "is a PBM or PPM image (P6); convert it to PGM"),
        (b"\xff\xd8\xff\xe0 jpeg", "is not a PGM, PNG or BMP image"),
        (b"P", "is not a PGM, PNG or BMP image"),
        (b"", "is empty"),
    ],
)
def test_bad_pgm(read: Read, data: bytes, says: str) -> None:
    with pytest.raises(MapFileError) as caught:
        read(data)
    message = str(caught.value)
    assert says in message
    assert "map.pgm: " in message
    assert "\n" not in message


def test_every_truncation_of_a_pgm_is_refused(read: Read) -> None:
    for whole in (b"P5\n# c\n3 2\n255\nabcdef", b"P2 # c\n3 2\n255\n1 2 3 4 5 6"):
        for length in range(len(whole)):
            with pytest.raises(MapFileError):
                read(whole[:length])
        read(whole)


def test_a_map_of_ten_thousand_squared_is_within_the_limit() -> None:
    assert MAX_CELLS >= 10_000 * 10_000


# ---------------------------------------------------------------------- PNG
@pytest.mark.parametrize("depth", [8, 16])
def test_png_of_every_kind_of_pixel(read: Read, depth: int) -> None:
    top = (1 << depth) - 1
    for pixels in (
        [[[0], [top]], [[5], [6]]],
        [[[1, 2, 3], [4, 5, 6]], [[7, 8, 9], [10, 11, top]]],
        [[[1, 2, 3, 0], [4, 5, 6, top]], [[7, 8, 9, 77], [10, 11, 12, 13]]],
    ):
        raster = read(png(pixels, depth))
        # The order of the colours is open, that of opacity is not.
        found = [[[*sorted(pixel[:3]), *pixel[3:]] for pixel in row] for row in samples(raster)]
        assert found == pixels
        assert raster.maxval == top
        assert raster.has_alpha == (len(pixels[0][0]) == 4)


def test_png_of_grey_with_opacity(read: Read) -> None:
    for depth, top in ((8, 255), (16, 65535)):
        raster = read(png([[[1, 0], [top, top], [3, 4]]], depth))
        assert raster.has_alpha
        assert raster.samples[0, :, 0].tolist() == [1, top, 3]
        assert raster.samples[0, :, -1].tolist() == [0, top, 4]


def test_png_with_a_palette(read: Read) -> None:
    palette = chunk(b"PLTE", bytes([0, 0, 0, 205, 205, 205, 254, 254, 254]))
    opaque = read(png_of(3, 1, 8, 3, b"\0\x02\x01\x00", palette))
    assert samples(opaque) == [[[254] * 3, [205] * 3, [0] * 3]]
    clear = read(png_of(3, 1, 2, 3, b"\0\x90", palette + chunk(b"tRNS", b"\x07")))
    assert samples(clear) == [[[254, 254, 254, 255], [205, 205, 205, 255], [0, 0, 0, 7]]]


def test_png_of_few_bits(read: Read) -> None:
    assert samples(read(png_of(4, 1, 1, 0, b"\0\xa0"))) == [[[255], [0], [255], [0]]]
    assert samples(read(png_of(2, 1, 4, 0, b"\0\x3f"))) == [[[51], [255]]]


def test_png_with_one_transparent_grey(read: Read) -> None:
    raster = read(png_of(2, 1, 4, 0, b"\0\x3f", chunk(b"tRNS", b"\x00\x03")))
    assert samples(raster) == [[[51, 0], [255, 255]]]
    raster = read(png_of(2, 1, 16, 0, b"\0\x01\x02\x03\x04", chunk(b"tRNS", b"\x01\x02")))
    assert samples(raster) == [[[0x0102, 0], [0x0304, 65535]]]


def test_png_interlaced(read: Read) -> None:
    # 3 x 3: passes hold 1, then (pass 5) one, (6) rows 0 and 2, (7) row 1 of the pixels.
    raw = b"\0\x01" + b"\0\x03" + b"\0\x07\x09" + b"\0\x02" + b"\0\x08" + b"\0\x04\x05\x06"
    assert samples(read(png_of(3, 3, 8, 0, raw, interlace=1))) == [
        [[1], [2], [3]],
        [[4], [5], [6]],
        [[7], [8], [9]],
    ]
    with pytest.raises(MapFileError, match="truncated"):
        read(png_of(3, 3, 8, 0, raw[:-1], interlace=1))


def huge_png(width: int, height: int, raw: bytes = b"\0") -> bytes:
    return png_of(width, height, 8, 0, raw)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (png([[[1]]])[:5], "the PNG image is truncated"),
        (png([[[1]]])[:20], "the PNG image is truncated"),
        (png([[[1]]])[:-1], "the PNG image is truncated"),
        (png([[[1]]])[:-12], "the PNG image is truncated"),
        (png_of(3, 3, 8, 0, b"\0abc\0abc"), "the PNG image is truncated"),
        (png_of(3, 1, 8, 0, b"\0abc\0abc"), "the PNG image has too many rows"),
        (png_of(3, 1, 8, 0, b"\x05abc"), "a row has no known filter"),
        (
            png([[[1]]])[:33] + chunk(b"IDAT", zlib.compress(b"\0\1")[:-4]) + chunk(b"IEND", b""),
            "the PNG image is truncated",
        ),
        (png([[[1]]]).replace(b"IDATx", b"IDATy"), "a checksum is wrong"),
        (
            png([[[1]]])[:33] + chunk(b"IDAT", b"no zlib stream") + chunk(b"IEND", b""),
            "it does not decompress",
        ),
        (png_of(0, 3, 8, 0, b""), "declares 0 x 3 pixels"),
        (png_of(3, 3, 3, 0, b""), "header of the PNG image is damaged"),
        (png_of(3, 3, 8, 5, b""), "header of the PNG image is damaged"),
        (png_of(3, 3, 8, 0, b"", interlace=2), "header of the PNG image is damaged"),
        (huge_png(20_000, 20_001), "more than the 400,000,000 that are read"),
        (huge_png(2**31 - 1, 2**31 - 1), "more than the 400,000,000 that are read"),
        (huge_png(20_000, 20_000), "is truncated: it declares 20000 x 20000 pixels, which 66 bytes cannot"),
        (huge_png(1_000_001, 1), "no side may exceed 1,000,000"),
    ],
)
def test_bad_png(read: Read, data: bytes, says: str, capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(MapFileError) as caught:
        read(data)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")  # damage is found before the library can complain about it


def test_a_png_that_says_little_and_holds_much_is_not_unpacked(read: Read) -> None:
    bomb = png_of(3, 3, 8, 0, bytes(50_000_000))
    with pytest.raises(MapFileError, match="too many rows"):
        read(bomb)


def test_rows_are_unpacked_in_small_pieces(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(images_module, "_CHUNK_BYTES", 16)
    assert read(png([[[9]] * 300] * 300)).samples.shape == (300, 300, 1)


def test_no_byte_of_a_png_changes_unnoticed(read: Read) -> None:
    whole = png([[[x * y % 256] for x in range(6)] for y in range(5)])
    for at in range(8, len(whole)):
        with pytest.raises(MapFileError):
            read(whole[:at] + bytes([whole[at] ^ 0x10]) + whole[at + 1 :])


# ---------------------------------------------------------------------- BMP
def test_bmp_of_every_kind_of_pixel(read: Read) -> None:
    grey = bytes(b for v in range(256) for b in (v, v, v, 0))
    assert samples(read(bmp(3, 2, 8, b"\4\5\6\0\1\2\3\0", grey))) == [[[1], [2], [3]], [[4], [5], [6]]]
    assert samples(read(bmp(3, -2, 8, b"\1\2\3\0\4\5\6\0", grey))) == [[[1], [2], [3]], [[4], [5], [6]]]
    assert samples(read(bmp(1, 1, 24, b"\1\2\3\0"))) == [[[1, 2, 3]]]
    two = b"\0\0\0\0\xfe\xfe\xfe\0"
    assert read(bmp(2, 1, 1, b"\x40\0\0\0", two)).samples[0, :, 0].tolist() == [0, 254]


def test_the_fourth_byte_of_a_bmp_without_alpha_is_padding(read: Read) -> None:
    raster = read(bmp(1, 1, 32, b"\1\2\3\0"))
    assert samples(raster) == [[[1, 2, 3]]]
    masks = struct.pack("<III", 0xFF0000, 0xFF00, 0xFF)
    data = bmp(1, 1, 32, b"\1\2\3\x80", masks, compression=3)
    assert samples(read(data)) == [[[1, 2, 3]]]


def test_the_alpha_of_a_bmp_that_declares_it(read: Read) -> None:
    masks = struct.pack("<IIII", 0xFF0000, 0xFF00, 0xFF, 0xFF000000)
    header = struct.pack("<IiiHHIIiiII", 108, 1, 1, 1, 32, 3, 4, 0, 0, 0, 0) + masks + bytes(52)
    data = b"BM" + struct.pack("<IHHI", 14 + 108 + 4, 0, 0, 14 + 108) + header + b"\1\2\3\x80"
    assert samples(read(data)) == [[[1, 2, 3, 0x80]]]


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"BM", "the BMP image is truncated"),
        (bmp(3, 2, 24, b"")[:40], "the BMP image is truncated"),
        (bmp(3, 2, 24, bytes(23)), "is truncated: it declares 3 x 2 pixels, 24 bytes, but 23 follow"),
        (bmp(0, 2, 24, b""), "declares 0 x 2 pixels"),
        (bmp(-3, 2, 24, bytes(24)), "declares -3 x 2 pixels"),
        (bmp(20_001, 20_000, 8, b""), "more than the 400,000,000 that are read"),
        (bmp(20_000, 20_000, 8, b""), "is truncated"),
        (bmp(20_000, 20_000, 8, b"", compression=1), "is truncated"),
        (bmp(3, 2, 24, bytes(24), compression=4), "compression 4 is not read; convert it to PNG"),
        (bmp(3, 2, 23, bytes(24)), "23 bits"),
        (b"BM" + bytes(60), "the header of the BMP image is damaged"),
    ],
)
def test_bad_bmp(read: Read, data: bytes, says: str) -> None:
    with pytest.raises(MapFileError) as caught:
        read(data)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


# ---------------------------------------------------------------------- not a file
def test_what_is_no_plain_file_is_not_opened(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.pgm")  # opening it would wait for a writer for ever
    with pytest.raises(MapFileError, match=r"pipe\.pgm: is not a plain file"):
        read_image(tmp_path / "pipe.pgm")
    with pytest.raises(MapFileError, match="is not a plain file"):
        read_image("/dev/zero")
    with pytest.raises(MapFileError, match="is a folder"):
        read_image(tmp_path)
    with pytest.raises(MapFileError, match="no such file"):
        read_image(tmp_path / "none.pgm")
    with pytest.raises(MapFileError, match="not a usable file name"):
        read_image("a\0b.pgm")
    with pytest.raises(MapFileError, match="cannot be read: File name too long"):
        read_image("a" * 5000)


def test_a_link_to_an_image_is_fine(tmp_path: Path) -> None:
    (tmp_path / "a.pgm").write_bytes(pgm(1, 1, 255, b"a"))
    (tmp_path / "b.pgm").symlink_to("a.pgm")
    assert samples(read_image(tmp_path / "b.pgm")) == [[[97]]]


# ---------------------------------------------------------------------- writing
@given(st.integers(1, 40), st.integers(1, 40), st.integers(0, 2**32 - 1))
def test_what_is_written_is_read(
    tmp_path_factory: pytest.TempPathFactory, rows: int, cols: int, seed: int
) -> None:
    path = tmp_path_factory.mktemp("images") / "image"
    dice = np.random.default_rng(seed)
    grey = dice.integers(0, 256, (rows, cols), dtype=np.uint8)
    for pieces in (pgm_pieces(grey), pgm_pieces(grey[::-1, ::-1][::-1, ::-1]), png_pieces(grey, path)):
        path.write_bytes(b"".join(pieces))
        assert np.array_equal(read_image(path).samples[:, :, 0], grey)
    colours = dice.integers(0, 256, (rows, cols, 4), dtype=np.uint8)
    path.write_bytes(b"".join(png_pieces(colours, path)))
    assert np.array_equal(read_image(path).samples, colours)


def test_a_png_is_not_written_wider_than_it_can_be_read() -> None:
    with pytest.raises(MapFileError, match="no side of a PNG may exceed 1,000,000 cells; use PGM"):
        png_pieces(np.zeros((1, 1_000_001), np.uint8), "map.yaml")


def test_a_wide_pgm_has_no_such_limit(read: Read) -> None:
    wide = np.zeros((1, 1_000_001), np.uint8)
    assert read(b"".join(pgm_pieces(wide))).samples.shape == (1, 1_000_001, 1)


def test_the_checksums_in_these_tests_are_png_s() -> None:
    assert chunk(b"IEND", b"")[-4:] == zlib.crc32(b"IEND").to_bytes(4, "big") == b"\xae\x42\x60\x82"
