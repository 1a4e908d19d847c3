"""A finished picture: one panel or several, with names, scale bar, legend and caption below them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from mapmeld.report.canvas import Picture
from mapmeld.report.lettering import draw_text, shortened, text_size, wrapped
from mapmeld.report.palette import FRAME, INK, PAPER, Colour

_MARGIN = 16
_NARROWEST = 560  # room for captions below a narrow picture
_LANDSCAPE = 1.4  # the shape, width over height, that panels are arranged to


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """One picture of a sheet and what it is called."""

    picture: Picture
    name: str = ""


def compose(
    panels: Sequence[Panel],
    caption: str,
    legend: Sequence[tuple[Colour, str]] = (),
    px_per_metre: float | None = None,
) -> Picture:
    """Put panels beside or below one another, and the words under them.

    Parameters
    ----------
    panels
        At least one.
    caption
        Broken into lines as needed.
    legend
        Colours and what they mean.
    px_per_metre
        For a scale bar; None where the pictures have no metres, or different ones.
    """
    block = _arranged(panels)
    width = max(block.shape[1] + 2 * _MARGIN, _NARROWEST)
    scale = 0.5 * min(max(width / 1000, 1.0), 1.6)
    strip = _Strip(width, scale)
    if legend or px_per_metre:
        strip.legend(legend, px_per_metre)
    strip.text(caption)
    words = strip.finished()
    sheet = np.empty((_MARGIN + len(block) + len(words), width, 3), np.uint8)
    sheet[:] = PAPER
    left = (width - block.shape[1]) // 2
    sheet[_MARGIN : _MARGIN + len(block), left : left + block.shape[1]] = block
    sheet[_MARGIN + len(block) :] = words
    return sheet


def _arranged(panels: Sequence[Panel]) -> Picture:
    """Return the panels with their names in a row or in a column, whichever is nearer to landscape."""
    sizes = np.array([panel.picture.shape[:2] for panel in panels])
    beside = sizes[:, 1].sum() / sizes[:, 0].max()
    below = sizes[:, 1].max() / sizes[:, 0].sum()
    in_row = abs(math.log(beside / _LANDSCAPE)) <= abs(math.log(below / _LANDSCAPE))
    scale = 0.5 * min(max((sizes[:, 1].sum() if in_row else sizes[:, 1].max()) / 1000, 1.0), 1.6)
    tallest = int(sizes[:, 0].max())
    names = [wrapped(panel.name, scale, panel.picture.shape[1], bold=True) for panel in panels]
    most = max(map(len, names))
    framed = [
        _framed(
            panel.picture,
            lines,
            scale,
            tallest if in_row else panel.picture.shape[0],
            most if in_row else len(lines),
        )
        for panel, lines in zip(panels, names, strict=True)
    ]
    width = max(f.shape[1] for f in framed)
    parts: list[Picture] = []
    for f in framed:
        if parts:
            parts.append(_blank(len(f), _MARGIN) if in_row else _blank(_MARGIN, width))
        parts.append(f if in_row else np.concatenate([f, _blank(len(f), width - f.shape[1])], axis=1))
    return np.concatenate(parts, axis=1 if in_row else 0)


def _blank(height: int, width: int) -> Picture:
    blank = np.empty((height, width, 3), np.uint8)
    blank[:] = PAPER
    return blank


def _framed(picture: Picture, name: Sequence[str], scale: float, height: int, lines: int) -> Picture:
    """Return a picture in a frame, centred in the height that all have, with its name in lines below."""
    own_height, width = picture.shape[:2]
    line_height = round(44 * scale)
    framed = _blank(height + 2 + lines * line_height, width + 2)
    top = (height - own_height) // 2
    framed[top + 1 : top + own_height + 1, 1 : width + 1] = picture
    cv2.rectangle(framed, (0, top), (width + 1, top + own_height + 1), FRAME, 1)
    for number, line in enumerate(name):
        base = height + 2 + round((number + 0.75) * line_height)
        draw_text(framed, line, (2, base), scale, INK, bold=True)
    return framed


class _Strip:
    """Rows of words, one below the other, as wide as the sheet."""

    def __init__(self, width: int, scale: float) -> None:
        self._width, self._scale = width, scale
        self._row_px = round(46 * scale)
        self._rows: list[Picture] = []

    def _row(self) -> Picture:
        self._rows.append(_blank(self._row_px, self._width))
        return self._rows[-1]

    @property
    def _base(self) -> int:
        return round(0.68 * self._row_px)

    def text(self, text: str) -> None:
        for line in wrapped(text, self._scale, self._width - 2 * _MARGIN):
            draw_text(self._row(), line, (_MARGIN, self._base), self._scale)

    def legend(self, legend: Sequence[tuple[Colour, str]], px_per_metre: float | None) -> None:
        row, x = self._row(), _MARGIN
        side = round(0.4 * self._row_px)
        if px_per_metre:
            metres, px = _bar(px_per_metre, self._width - 2 * _MARGIN)
            middle, tick = self._base - side // 2, side // 2
            cv2.line(row, (x, middle), (x + px, middle), INK, 2)
            cv2.line(row, (x, middle - tick), (x, middle + tick), INK, 2)
            cv2.line(row, (x + px, middle - tick), (x + px, middle + tick), INK, 2)
            text = f"{metres:g} m"
            draw_text(row, text, (x + px + side // 2, self._base), self._scale)
            x += px + side // 2 + text_size(text, self._scale)[0] + 3 * side
        for colour, label in legend:
            label = shortened(label, self._scale, self._width - 2 * _MARGIN - 2 * side)
            needed = round(1.5 * side) + text_size(label, self._scale)[0]
            if x > _MARGIN and x + needed > self._width - _MARGIN:
                row, x = self._row(), _MARGIN
            top = self._base - side
            cv2.rectangle(row, (x, top), (x + side, top + side), colour, -1)
            cv2.rectangle(row, (x, top), (x + side, top + side), FRAME, 1)
            draw_text(row, label, (x + round(1.5 * side), self._base), self._scale)
            x += needed + 2 * side

    def finished(self) -> Picture:
        edge = _blank(_MARGIN // 2, self._width)
        return np.concatenate([edge, *self._rows, edge])


def _bar(px_per_metre: float, room_px: int) -> tuple[float, int]:
    """Return a round length [m], one of 1, 2, 5 times a power of ten, and how long it is [px]."""
    wished = 160 / px_per_metre
    power = 10.0 ** math.floor(math.log10(wished))
    metres = max(step * power for step in (1, 2, 5) if step * power <= wished)
    return metres, min(max(round(metres * px_per_metre), 1), room_px)
