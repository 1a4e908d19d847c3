"""What changed between two maps, in colours: what appeared red, what vanished blue, what is new green."""

from __future__ import annotations

import numpy as np

from mapmeld.changes import Change, MapDiff
from mapmeld.changes.classes import distance_to
from mapmeld.report.canvas import Labels, Picture, known_window, paint, with_turn
from mapmeld.report.marks import with_labels
from mapmeld.report.palette import BLUE, FLOOR_WHITE, INK, RED, UNKNOWN_GREY, WALL_BLACK, Colour
from mapmeld.report.sheet import Panel, compose

NUMBERED = 20
"""So many of the greatest changes carry their number in the picture."""

_HALO = 0.25  # [m] around changed cells, so that a chair is seen in the picture of a floor

# What must not be lost where a picture is shrunk comes last.
_PALETTE: tuple[Colour, ...] = (
    UNKNOWN_GREY,
    (225, 232, 235),  # floor not seen again
    FLOOR_WHITE,
    (222, 242, 222),  # floor newly explored
    (250, 222, 198),  # around what vanished
    (205, 205, 255),  # around what appeared
    (150, 160, 165),  # obstacle not seen again
    (70, 140, 60),  # obstacle newly explored
    WALL_BLACK,
    BLUE,
    RED,
)
_UNKNOWN, _UNSEEN, _FLOOR, _EXPLORED, _NEAR_VANISHED, _NEAR_APPEARED = 0, 1, 2, 3, 4, 5
_WALL_UNSEEN, _WALL_EXPLORED, _WALL, _VANISHED, _APPEARED = 6, 7, 8, 9, 10


def change_labels(diff: MapDiff) -> Labels:
    """Return the number of each cell's colour."""
    classes, old, new = diff.classes, diff.old, diff.new
    same = classes == Change.SAME
    labels = np.zeros(classes.shape, np.uint8)
    labels[classes == Change.UNSEEN] = _UNSEEN
    labels[classes == Change.EXPLORED] = _EXPLORED
    labels[same] = _FLOOR
    for change, near in ((Change.VANISHED, _NEAR_VANISHED), (Change.APPEARED, _NEAR_APPEARED)):
        around = distance_to(classes == change) * old.resolution <= _HALO
        labels[around & (labels > 0)] = near
    labels[(classes == Change.UNSEEN) & old.occupied] = _WALL_UNSEEN
    labels[(classes == Change.EXPLORED) & new.occupied] = _WALL_EXPLORED
    labels[same & old.occupied] = _WALL
    labels[classes == Change.VANISHED] = _VANISHED
    labels[classes == Change.APPEARED] = _APPEARED
    return labels


def changes(diff: MapDiff, caption: str = "") -> Picture:
    """Draw what changed, on the earlier map; the greatest changes carry the numbers of their regions, from 1.

    Parameters
    ----------
    diff
        The comparison.
    caption
        Words below the picture; where the lattice has a yaw, a sentence about that is added.
    """
    known = diff.old.known | diff.new.known
    window = known_window(type(diff.old)(np.where(known, 0, -1), diff.old.resolution))
    canvas = paint(change_labels(diff), _PALETTE, window)
    marked = diff.regions[:NUMBERED]
    if marked:
        places = diff.old.metres_to_lattice([region.centroid for region in marked])
        canvas = with_labels(canvas, places, [str(n) for n, _ in enumerate(marked, start=1)], INK, 0.45)
    legend = [
        (_PALETTE[label], words)
        for label, words in (
            (_APPEARED, "appeared"),
            (_VANISHED, "vanished"),
            (_WALL, "obstacle in both"),
            (_FLOOR, "floor in both"),
            (_WALL_EXPLORED, "obstacle newly explored"),
            (_EXPLORED, "floor newly explored"),
            (_WALL_UNSEEN, "obstacle not seen again"),
            (_UNSEEN, "floor not seen again"),
            (_UNKNOWN, "unknown"),
        )
    ]
    return compose(
        [Panel(canvas.picture)],
        with_turn(caption, diff.old),
        legend,
        canvas.px_per_cell / diff.old.resolution,
    )
