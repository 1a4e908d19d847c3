import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from mapmeld.report.lettering import plain, shortened, text_size, wrapped
from mapmeld.report.palette import RED
from mapmeld.report.sheet import Panel, _bar, compose


def noise(rows: int, cols: int, seed: int) -> NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(0, 256, (rows, cols, 3), np.uint8)


def holds(sheet: NDArray[np.uint8], picture: NDArray[np.uint8]) -> tuple[int, int]:
    rows, cols = picture.shape[:2]
    for r, c in np.argwhere((sheet == picture[0, 0]).all(axis=2)):
        if np.array_equal(sheet[r : r + rows, c : c + cols], picture):
            return int(r), int(c)
    raise AssertionError("the picture is not on the sheet as it was")


def test_panels_are_on_the_sheet_untouched_and_words_below() -> None:
    picture = noise(120, 150, 1)
    sheet = compose([Panel(picture, "name")], "A caption.", [(RED, "red")], 10.0)
    row, _ = holds(sheet, picture)
    below = sheet[row + 121 :]
    assert sheet.dtype == np.uint8
    assert (below < 128).any()
    assert (below == RED).all(axis=2).any()


def test_tall_panels_stand_beside_and_wide_ones_below_one_another() -> None:
    for shape, beside in (((300, 200), True), ((100, 400), False)):
        first, second = noise(*shape, 1), noise(*shape, 2)
        sheet = compose([Panel(first), Panel(second)], "")
        (r1, c1), (r2, c2) = holds(sheet, first), holds(sheet, second)
        assert (r1 == r2 and c2 > c1) if beside else (c1 == c2 and r2 > r1)


def test_panels_of_different_size() -> None:
    first, second = noise(300, 200, 1), noise(200, 250, 2)
    sheet = compose([Panel(first, "a"), Panel(second, "b")], "caption")
    assert holds(sheet, first)[0] < holds(sheet, second)[0]


def test_a_narrow_picture_gets_room_for_its_caption() -> None:
    sheet = compose([Panel(noise(50, 5, 1))], "word " * 40, [(RED, "a long legend " * 20)], 1.0)
    assert sheet.shape[1] >= 500


@given(st.text(alphabet=st.characters(codec="ascii", exclude_categories=["Cc"]), max_size=200))
def test_wrapping_keeps_the_words_and_fits(text: str) -> None:
    lines = wrapped(text, 0.5, 300)
    assert all(text_size(line, 0.5)[0] <= 300 for line in lines)
    if all(text_size(word, 0.5)[0] <= 300 for word in text.split()):
        assert " ".join(lines).split() == text.split()


def test_long_names_are_cut_in_the_middle() -> None:
    short = shortened("a" * 50 + "b" * 50, 0.5, 200)
    assert short.startswith("aaa")
    assert short.endswith("bbb")
    assert ".." in short
    assert text_size(short, 0.5)[0] <= 200


def test_letters_that_the_font_may_lack_are_replaced() -> None:
    assert plain("Grundriß é.yaml") == "Grundri? ?.yaml"


@given(st.floats(1e-4, 1e5))
def test_scale_bars_are_round(px_per_metre: float) -> None:
    metres, px = _bar(px_per_metre, 10_000)
    assert any(
        metres * 10.0**-power == pytest.approx(step)
        for step in (1, 2, 5)
        for power in [math.floor(math.log10(metres) + 1e-9)]
    )
    assert 60 <= px <= 161
    assert px == pytest.approx(metres * px_per_metre, abs=1)
