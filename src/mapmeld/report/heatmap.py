"""The matrix gamma as a heat map."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mapmeld.matching.alphabet import Candidate
from mapmeld.report.canvas import Canvas, Window, paint, whole_scale
from mapmeld.report.marks import with_boxes, with_lines, with_texts
from mapmeld.report.palette import BLUE, FRAME, GREEN, INK, heat_palette

_LONG_SIDE_PX = 800
_MARGIN_PX = 44  # for the numbers along the edges


def with_gamma(gamma: NDArray[np.int64], candidates: Sequence[Candidate], winner: Candidate | None) -> Canvas:
    """Paint gamma, corner i of map 1 upwards and corner z of map 2 to the right, numbered from 1.

    The darker a cell, the more votes. First points of candidates are framed blue, the two matching
    points of the winner green.
    """
    rows, cols = gamma.shape
    heat = np.zeros(gamma.shape, np.uint8)
    if gamma.size and gamma.max() > 0:
        # Few votes must still differ from none.
        heat = np.where(gamma > 0, 20 + np.rint(gamma * (235 / gamma.max())), 0).astype(np.uint8)
    scale = whole_scale(max(rows, cols), _LONG_SIDE_PX)
    margin = round(_MARGIN_PX / scale)
    window = Window(-margin, -margin, cols + margin + margin // 3 + 1, rows + margin + margin // 3 + 1)
    canvas = paint(heat, heat_palette(), window, scale)
    edges = [(0, 0), (cols, 0), (cols, rows), (0, rows)]
    canvas = with_lines(canvas, edges, [*edges[1:], edges[0]], [FRAME] * 4)
    thickness = 3 if scale >= 12 else 1
    if candidates:
        canvas = with_boxes(canvas, [_cell(c.first) for c in candidates], BLUE, thickness)
    if winner is not None:
        canvas = with_boxes(canvas, [_cell(winner.first), _cell(winner.second)], GREEN, thickness)
    every = max(1, round(60 / scale / 5) * 5)
    below = [(z - 0.5, -16 / scale) for z in _ticks(cols, every)]
    canvas = with_texts(canvas, below, [str(z) for z in _ticks(cols, every)], INK)
    left = [(-20 / scale, i - 0.5) for i in _ticks(rows, every)]
    return with_texts(canvas, left, [str(i) for i in _ticks(rows, every)], INK)


def _cell(point: tuple[int, int]) -> tuple[int, int]:
    row, col = point
    return col, row


def _ticks(number: int, every: int) -> list[int]:
    return [n for n in range(1, number + 1) if n == 1 or n % every == 0]
