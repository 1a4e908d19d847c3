"""Marks on a canvas: dots, lines, arrows and labels at lattice positions.

Every function returns a new canvas and leaves the given one as it was.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mapmeld.report.canvas import Canvas
from mapmeld.report.lettering import draw_text, text_size
from mapmeld.report.palette import FLOOR_WHITE, Colour
from mapmeld.se2 import Pose2

_SHIFT = 4  # OpenCV takes coordinates in 1/16 of a pixel


def _fixed(places: NDArray[np.float64]) -> NDArray[np.int32]:
    """Return places (..., 2) as OpenCV's fixed-point numbers, in which pixel *centres* are whole."""
    return np.rint((np.clip(places, -20_000, 20_000) - 0.5) * (1 << _SHIFT)).astype(np.int32)


def with_dots(
    canvas: Canvas, lattice: ArrayLike, colour: Colour, radius_px: float = 4, *, hollow: bool = False
) -> Canvas:
    """Draw a disc, or a ring if `hollow`, with a white rim at every position (n, 2)."""
    picture = canvas.picture.copy()
    radius = round(radius_px * (1 << _SHIFT))
    for x, y in _fixed(canvas.place(lattice)).reshape(-1, 2).tolist():
        if hollow:
            cv2.circle(picture, (x, y), radius, FLOOR_WHITE, 4, cv2.LINE_AA, _SHIFT)
            cv2.circle(picture, (x, y), radius, colour, 2, cv2.LINE_AA, _SHIFT)
        else:
            cv2.circle(picture, (x, y), radius + (3 << _SHIFT) // 2, FLOOR_WHITE, -1, cv2.LINE_AA, _SHIFT)
            cv2.circle(picture, (x, y), radius, colour, -1, cv2.LINE_AA, _SHIFT)
    return replace(canvas, picture=picture)


def with_lines(
    canvas: Canvas, start: ArrayLike, end: ArrayLike, colours: Sequence[Colour], thickness_px: int = 1
) -> Canvas:
    """Draw straight lines from `start` to `end` (n, 2), one colour each."""
    picture = canvas.picture.copy()
    starts = _fixed(canvas.place(start)).reshape(-1, 2).tolist()
    ends = _fixed(canvas.place(end)).reshape(-1, 2).tolist()
    for from_, to, colour in zip(starts, ends, colours, strict=True):
        cv2.line(picture, from_, to, colour, thickness_px, cv2.LINE_AA, _SHIFT)
    return replace(canvas, picture=picture)


def with_boxes(canvas: Canvas, lattice: ArrayLike, colour: Colour, thickness_px: int = 2) -> Canvas:
    """Frame the cells whose lower left corners are given (n, 2)."""
    picture = canvas.picture.copy()
    cells = np.asarray(lattice, dtype=np.float64).reshape(-1, 2)
    low, high = np.rint(canvas.place(cells)), np.rint(canvas.place(cells + 1))
    for (x0, y1), (x1, y0) in zip(low.astype(int).tolist(), high.astype(int).tolist(), strict=True):
        cv2.rectangle(picture, (x0 - 1, y0 - 1), (x1, y1), colour, thickness_px)
    return replace(canvas, picture=picture)


def with_arrow(canvas: Canvas, pose_px: Pose2, length_px: float, colour: Colour, label: str) -> Canvas:
    """Draw an arrow whose base, a disc that holds the label, lies at a pose on the lattice.

    Parameters
    ----------
    pose_px
        (col, row) [px] and heading [rad], counter-clockwise from the lattice's x axis.
    length_px
        Length in the picture.
    """
    base = canvas.place((pose_px.x, pose_px.y))
    along = np.array([math.cos(pose_px.theta), -math.sin(pose_px.theta)])  # y down
    across = np.array([-along[1], along[0]])
    head = min(0.34 * length_px, 22)
    tip, neck = base + length_px * along, base + (length_px - head) * along
    picture = canvas.picture.copy()
    triangle = np.stack([tip, neck + 0.5 * head * across, neck - 0.5 * head * across])
    centre, end = _fixed(base).tolist(), _fixed(neck).tolist()
    radius = 11 << _SHIFT
    # White below, so that the arrow stands out from black walls as from white floor.
    cv2.line(picture, centre, end, FLOOR_WHITE, 10, cv2.LINE_AA, _SHIFT)
    cv2.polylines(picture, [_fixed(triangle)], True, FLOOR_WHITE, 6, cv2.LINE_AA, _SHIFT)
    cv2.circle(picture, centre, radius + (3 << _SHIFT), FLOOR_WHITE, -1, cv2.LINE_AA, _SHIFT)
    cv2.line(picture, centre, end, colour, 5, cv2.LINE_AA, _SHIFT)
    cv2.fillConvexPoly(picture, _fixed(triangle), colour, cv2.LINE_AA, _SHIFT)
    cv2.circle(picture, centre, radius, colour, -1, cv2.LINE_AA, _SHIFT)
    width, height = text_size(label, 0.5)
    draw_text(
        picture, label, (round(base[0] - width / 2), round(base[1] + height / 2)), 0.5, FLOOR_WHITE, bold=True
    )
    return replace(canvas, picture=picture)


def with_labels(
    canvas: Canvas, lattice: ArrayLike, texts: Sequence[str], colour: Colour, scale: float = 0.5
) -> Canvas:
    """Write a label beside every position (n, 2), off the other positions and labels if there is room."""
    picture = canvas.picture.copy()
    places = canvas.place(lattice).reshape(-1, 2)
    taken: list[tuple[float, float, float, float]] = [(x - 4, y - 4, x + 4, y + 4) for x, y in places]
    for (x, y), text in zip(places.tolist(), texts, strict=True):
        width, height = text_size(text, scale)
        boxes = [
            (cx - width / 2 - 2, cy - height / 2 - 2, cx + width / 2 + 2, cy + height / 2 + 2)
            for cx, cy in _beside(x, y, width, height)
        ]
        box = min(boxes, key=lambda b: _covered(b, taken, picture.shape))
        taken.append(box)
        x0, y0, x1, y1 = (round(v) for v in box)
        cv2.rectangle(picture, (x0, y0), (x1, y1), FLOOR_WHITE, -1)
        draw_text(picture, text, (x0 + 2, y1 - 2), scale, colour)
    return replace(canvas, picture=picture)


def with_texts(
    canvas: Canvas, lattice: ArrayLike, texts: Sequence[str], colour: Colour, scale: float = 0.45
) -> Canvas:
    """Write texts centred on their positions (n, 2), whatever lies there."""
    picture = canvas.picture.copy()
    places = canvas.place(lattice).reshape(-1, 2)
    for (x, y), text in zip(places.tolist(), texts, strict=True):
        width, height = text_size(text, scale)
        draw_text(picture, text, (round(x - width / 2), round(y + height / 2)), scale, colour)
    return replace(canvas, picture=picture)


def _beside(x: float, y: float, width: float, height: float) -> list[tuple[float, float]]:
    """Return centres for a label around a mark, the usual place (above right) first."""
    dx, dy = width / 2 + 8, height / 2 + 8
    return [
        (x + dx, y - dy),
        (x + dx, y + dy),
        (x - dx, y - dy),
        (x - dx, y + dy),
        (x, y - dy - 3),
        (x, y + dy + 3),
        (x + dx + 3, y),
        (x - dx - 3, y),
    ]


def _covered(
    box: tuple[float, float, float, float],
    taken: Sequence[tuple[float, float, float, float]],
    shape: tuple[int, ...],
) -> float:
    """Return how much of what is taken a box would cover, and of itself lose beyond the picture."""
    x0, y0, x1, y1 = box

    def shared(other: tuple[float, float, float, float]) -> float:
        return max(0.0, min(x1, other[2]) - max(x0, other[0])) * max(
            0.0, min(y1, other[3]) - max(y0, other[1])
        )

    outside = (x1 - x0) * (y1 - y0) - shared((0, 0, shape[1], shape[0]))
    return sum(map(shared, taken)) + 10 * outside
