"""Pictures of maps, matches and merges, drawn with OpenCV.

Everything here returns pictures, uint8 (height, width, 3), blue-green-red as OpenCV has them, row 0 at
the top; only `write_picture` touches a file.
"""

from mapmeld.report.canvas import Canvas, Picture, Window, paint, paint_map, with_turn
from mapmeld.report.changes import changes
from mapmeld.report.explain import FIGURE_NAMES, POSSIBLE_NAMES, Explanation, Figure, explain
from mapmeld.report.overlay import overlay
from mapmeld.report.png import PictureError, check_picture_path, write_picture
from mapmeld.report.references import references
from mapmeld.report.sheet import Panel, compose

__all__ = [
    "FIGURE_NAMES",
    "POSSIBLE_NAMES",
    "Canvas",
    "Explanation",
    "Figure",
    "Panel",
    "Picture",
    "PictureError",
    "Window",
    "changes",
    "check_picture_path",
    "compose",
    "explain",
    "overlay",
    "paint",
    "paint_map",
    "references",
    "with_turn",
    "write_picture",
]
