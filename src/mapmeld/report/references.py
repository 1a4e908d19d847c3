"""The merged map with the start pose of every robot as an arrow (paper, Figure 7)."""

from __future__ import annotations

import math
from collections.abc import Sequence

from mapmeld.grid import OccupancyGrid
from mapmeld.report.canvas import Canvas, Picture, known_window, paint_map, with_turn
from mapmeld.report.marks import with_arrow
from mapmeld.report.palette import colour_of_map
from mapmeld.report.sheet import Panel, compose
from mapmeld.se2 import Pose2

_ARROW_SHARE = 0.07  # of the picture's long side
# A start farther off than this share of the map's size would leave the map a speck in its picture.
_REACH_SHARE = 0.5


def with_references(grid: OccupancyGrid, starts: Sequence[Pose2 | None]) -> tuple[Canvas, list[int]]:
    """Paint a map and an arrow per robot: its base is the start position, its direction the heading.

    Parameters
    ----------
    grid
        The map.
    starts
        Start poses in the map's frame; None for a robot that has none there.

    Returns
    -------
    The canvas, and the indices of robots that start too far away to be drawn on it.
    """
    window = known_window(grid)
    size = max(window.rows, window.cols)
    length, reach = _ARROW_SHARE * size, _REACH_SHARE * size
    arrows: dict[int, Pose2] = {}
    far: list[int] = []
    for i, start in enumerate(starts):
        if start is None:
            continue
        col, row = (float(v) for v in grid.metres_to_lattice((start.x, start.y)))
        if (
            window.col - reach <= col <= window.col + window.cols + reach
            and window.row - reach <= row <= window.row + window.rows + reach
        ):
            arrows[i] = Pose2(col, row, start.theta - grid.origin.theta)
        else:
            far.append(i)
    for arrow in arrows.values():
        tip = (arrow.x + length * math.cos(arrow.theta), arrow.y + length * math.sin(arrow.theta))
        window = window.reaching([(arrow.x, arrow.y), tip], margin=1 + size // 40)
    canvas = paint_map(grid, window)
    for i, arrow in arrows.items():
        canvas = with_arrow(canvas, arrow, length * canvas.px_per_cell, colour_of_map(i), str(i + 1))
    return canvas, far


def references(
    grid: OccupancyGrid, starts: Sequence[Pose2 | None], names: Sequence[str], caption: str = ""
) -> Picture:
    """Draw a merged map with the global reference of every robot: robot 1 red, robot 2 blue.

    Parameters
    ----------
    grid, starts
        As a `mapmeld.merging.MergeResult` has them.
    names
        What to call the maps in the legend.
    caption
        A sentence below the picture; where the grid has a yaw, one about that is added.
    """
    canvas, far = with_references(grid, starts)
    drawn = [i for i, start in enumerate(starts) if start is not None and i not in far]
    legend = [(colour_of_map(i), f"start of robot {i + 1}: {names[i]}") for i in drawn]
    caption = with_turn(caption, grid)
    if far:
        robots = ", ".join(str(i + 1) for i in far)
        caption = f"{caption} Outside the picture starts robot {robots}.".strip()
    return compose([Panel(canvas.picture)], caption, legend, canvas.px_per_cell / grid.resolution)
