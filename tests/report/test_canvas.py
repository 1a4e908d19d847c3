import numpy as np
import pytest
from drawing import drawn
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from mapmeld.grid import UNKNOWN, OccupancyGrid
from mapmeld.report.canvas import (
    GREYS,
    Window,
    grey_labels,
    known_window,
    paint,
    paint_map,
    whole_scale,
)

PALETTE = [(0, 0, 0), (10, 20, 30), (40, 50, 60), (255, 255, 255)]
small_labels = arrays(np.uint8, st.tuples(st.integers(1, 6), st.integers(1, 6)), elements=st.integers(0, 3))


def test_the_bottom_row_of_cells_is_the_bottom_row_of_the_picture() -> None:
    canvas = paint(np.array([[1, 1], [2, 3]], np.uint8), PALETTE, px_per_cell=1)
    assert canvas.picture.tolist() == [
        [[40, 50, 60], [255, 255, 255]],
        [[10, 20, 30], [10, 20, 30]],
    ]


@given(small_labels, st.integers(1, 5), st.integers(-3, 3), st.integers(-3, 3), st.integers(1, 8))
def test_every_cell_is_where_place_says(
    labels: NDArray[np.uint8], scale: int, col: int, row: int, size: int
) -> None:
    canvas = paint(labels, PALETTE, Window(col, row, size, size + 1), float(scale))
    assert canvas.picture.shape == ((size + 1) * scale, size * scale, 3)
    for r in range(row, row + size + 1):
        for c in range(col, col + size):
            x, y = np.floor(canvas.place((c + 0.5, r + 0.5))).astype(int)
            inside = 0 <= r < labels.shape[0] and 0 <= c < labels.shape[1]
            assert tuple(canvas.picture[y, x]) == PALETTE[labels[r, c] if inside else 0]


@given(small_labels, st.integers(2, 4))
def test_shrinking_loses_no_wall(labels: NDArray[np.uint8], times: int) -> None:
    canvas = paint(labels, PALETTE, px_per_cell=1 / times)
    for r, c in np.argwhere(labels == 3):
        x, y = np.floor(canvas.place((c + 0.5, r + 0.5))).astype(int)
        assert tuple(canvas.picture[y, x]) == PALETTE[3]
    assert canvas.picture.shape[:2] == (-(-labels.shape[0] // times), -(-labels.shape[1] // times))


@given(st.integers(1, 100_000))
def test_pictures_are_neither_small_nor_huge(cells: int) -> None:
    scale = whole_scale(cells)
    assert 600 <= cells * scale <= 2000
    whole = max(scale, 1 / scale)
    assert whole == pytest.approx(round(whole))


def test_a_map_in_the_papers_greys() -> None:
    grid = drawn(
        """
        #.
        .
        """.replace(" " * 8, "")
    )
    picture = paint_map(grid, Window(0, 0, 2, 2), 1.0).picture
    assert picture[:, :, 0].tolist() == [[0, 255], [255, 205]]


def test_cells_between_the_thresholds_are_neither_wall_nor_floor() -> None:
    grid = OccupancyGrid(np.array([[UNKNOWN, 25, 26, 64, 65]], np.int8), 1.0)
    assert grey_labels(grid).tolist() == [[0, 1, 0, 0, 2]]
    assert len(GREYS) == 3


def test_the_window_of_a_map_is_its_known_part() -> None:
    cells = np.full((50, 60), UNKNOWN, np.int8)
    cells[20:30, 40:45] = 0
    window = known_window(OccupancyGrid(cells, 1.0))
    assert (window.cols, window.rows) == (5 + 2 * 3, 10 + 2 * 3)
    assert (window.col, window.row) == (37, 17)


def test_a_map_with_nothing_known_is_shown_whole() -> None:
    window = known_window(OccupancyGrid(np.full((3, 4), UNKNOWN, np.int8), 1.0))
    assert window == Window(0, 0, 4, 3)


def test_a_map_without_cells_still_makes_a_picture() -> None:
    assert paint_map(OccupancyGrid(np.empty((0, 0), np.int8), 1.0)).picture.size > 0


def test_a_window_grows_to_hold_positions() -> None:
    window = Window(0, 0, 4, 4).reaching([(-1.5, 2.0), (3.0, 6.2)], margin=1)
    assert window == Window(-3, 0, 7, 8)
    assert Window(1, 2, 3, 4).reaching(np.empty((0, 2))) == Window(1, 2, 3, 4)
