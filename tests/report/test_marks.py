import math

import numpy as np
import pytest
from numpy.typing import NDArray

from mapmeld.report.canvas import Canvas, paint
from mapmeld.report.marks import with_arrow, with_boxes, with_dots, with_labels, with_lines, with_texts
from mapmeld.report.palette import BLUE, FLOOR_WHITE, INK, RED
from mapmeld.se2 import Pose2


def blank(side: int = 20, px_per_cell: float = 10.0) -> Canvas:
    return paint(np.zeros((side, side), np.uint8), [FLOOR_WHITE], px_per_cell=px_per_cell)


def colour_at(canvas: Canvas, position: tuple[float, float]) -> tuple[int, ...]:
    x, y = np.floor(canvas.place(position)).astype(int)
    return tuple(int(v) for v in canvas.picture[y, x])


def changed(canvas: Canvas) -> NDArray[np.intp]:
    return np.argwhere((canvas.picture != 255).any(axis=2))


def test_a_dot_lies_on_its_position() -> None:
    rows, cols = changed(with_dots(blank(), [(5.5, 4.5)], RED, 4)).T
    assert cols.mean() + 0.5 == pytest.approx(55, abs=0.1)
    assert rows.mean() + 0.5 == pytest.approx(200 - 45, abs=0.1)
    assert 4 <= (np.ptp(cols) + 1) / 2 <= 6
    assert 4 <= (np.ptp(rows) + 1) / 2 <= 6


def test_a_ring_is_open() -> None:
    canvas = with_dots(blank(), [(5.5, 4.5)], RED, 8, hollow=True)
    assert colour_at(canvas, (5.5, 4.5)) == FLOOR_WHITE
    assert colour_at(canvas, (6.3, 4.5)) == RED


def test_lines_end_where_they_should() -> None:
    canvas = with_lines(blank(), [(2, 3), (2, 10)], [(12, 3), (2, 18)], [RED, BLUE], 3)
    assert colour_at(canvas, (7.0, 3.0)) == RED
    assert colour_at(canvas, (2.0, 14.0)) == BLUE
    assert colour_at(canvas, (13.0, 3.0)) == FLOOR_WHITE
    assert colour_at(canvas, (7.0, 17.0)) == FLOOR_WHITE


def test_a_box_is_drawn_around_its_cell() -> None:
    canvas = with_boxes(blank(), [(3, 4)], RED)
    assert colour_at(canvas, (3.5, 4.5)) == FLOOR_WHITE
    for side in ((3.0, 4.5), (4.0, 4.5), (3.5, 4.0), (3.5, 5.0)):
        assert colour_at(canvas, side) == RED


@pytest.mark.parametrize("degrees", [0, 45, 90, 200, -90])
def test_an_arrow_points_in_its_heading(degrees: float) -> None:
    heading = math.radians(degrees)
    canvas = with_arrow(blank(), Pose2(10, 10, heading), 60, BLUE, "1")
    ahead = (10 + 5 * math.cos(heading), 10 + 5 * math.sin(heading))
    behind = (10 - 3 * math.cos(heading), 10 - 3 * math.sin(heading))
    assert colour_at(canvas, ahead) == BLUE
    assert colour_at(canvas, behind) == FLOOR_WHITE


def test_labels_keep_off_one_another_and_inside() -> None:
    positions = [(0.2, 0.2), (19.8, 19.8), (10.0, 10.0), (10.4, 10.0)]
    canvas = with_labels(blank(), positions, ["1", "22", "333", "444"], INK)
    apart = sum(
        len(changed(with_labels(blank(), [position], [text], INK)))
        for position, text in zip(positions, ["1", "22", "333", "444"], strict=True)
    )
    # Had they covered one another or been cut at the edge, fewer pixels would be dark.
    assert len(changed(canvas)) == pytest.approx(apart, rel=0.1)


def test_texts_are_centred() -> None:
    rows, cols = changed(with_texts(blank(), [(10, 10)], ["888"], INK)).T
    assert (cols.min() + cols.max()) / 2 == pytest.approx(100, abs=3)
    assert (rows.min() + rows.max()) / 2 == pytest.approx(100, abs=3)


def test_marks_far_outside_do_no_harm() -> None:
    canvas = with_dots(blank(), [(1e9, -1e9)], RED)
    canvas = with_lines(canvas, [(0, 0)], [(-1e9, 0.0)], [RED])
    assert canvas.picture.shape == blank().picture.shape


def test_the_given_canvas_stays_as_it_was() -> None:
    canvas = blank()
    with_arrow(canvas, Pose2(5, 5), 50, RED, "2")
    with_dots(canvas, [(1, 1)], RED)
    with_lines(canvas, [(1, 1)], [(5, 5)], [RED])
    with_boxes(canvas, [(1, 1)], RED)
    with_labels(canvas, [(1, 1)], ["x"], INK)
    with_texts(canvas, [(1, 1)], ["x"], INK)
    assert not len(changed(canvas))
