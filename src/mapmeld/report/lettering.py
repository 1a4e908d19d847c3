"""Text in pictures: OpenCV's own font, measured so that lines break where they must."""

from __future__ import annotations

import cv2

from mapmeld.report.canvas import Picture
from mapmeld.report.palette import INK, Colour

_FONT = cv2.FONT_HERSHEY_SIMPLEX


def plain(text: str) -> str:
    """Return the text in the letters that OpenCV's font has before version 5: those of ASCII."""
    return text.encode("ascii", "replace").decode()


def text_size(text: str, scale: float, *, bold: bool = False) -> tuple[int, int]:
    """Return (width, height above the base line) [px]."""
    (width, height), _ = cv2.getTextSize(plain(text), _FONT, scale, 2 if bold else 1)
    return width, height


def draw_text(
    picture: Picture,
    text: str,
    base_left: tuple[int, int],
    scale: float,
    colour: Colour = INK,
    *,
    bold: bool = False,
) -> None:
    """Write one line into the picture itself; `base_left` is (x, y) of the base line's left end."""
    cv2.putText(picture, plain(text), base_left, _FONT, scale, colour, 2 if bold else 1, cv2.LINE_AA)


def wrapped(text: str, scale: float, width_px: int, *, bold: bool = False) -> list[str]:
    """Break a text between words into lines that fit; a word that does not fit is cut in the middle."""
    lines: list[str] = []
    for word in text.split():
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and text_size(longer, scale, bold=bold)[0] <= width_px:
            lines[-1] = longer
        else:
            lines.append(shortened(word, scale, width_px, bold=bold))
    return lines


def shortened(text: str, scale: float, width_px: int, *, bold: bool = False) -> str:
    """Return a text that fits on one line, its middle replaced by dots if need be."""
    keep = len(text)
    short = text
    while keep > 2 and text_size(short, scale, bold=bold)[0] > width_px:
        keep -= 1
        short = f"{text[: (keep + 1) // 2]}..{text[len(text) - keep // 2 :]}"
    return short
