"""What can be driven on a map: floor for a robot's centre, the ways planned on it, and which are wrong."""

from __future__ import annotations

import numpy as np

from mapmeld.evaluation.navigability import Navigability, drivable
from mapmeld.grid import OCCUPIED_FROM, OccupancyGrid, resample
from mapmeld.report.canvas import Picture, known_window, paint, with_turn
from mapmeld.report.marks import with_dots, with_lines
from mapmeld.report.palette import BLUE, FLOOR_WHITE, GREEN, ORANGE, RED, UNKNOWN_GREY, WALL_BLACK, Colour
from mapmeld.report.sheet import Panel, compose
from mapmeld.se2 import Pose2

_DRIVABLE_TINT: Colour = (222, 242, 222)
_PALETTE: tuple[Colour, ...] = (UNKNOWN_GREY, FLOOR_WHITE, _DRIVABLE_TINT, WALL_BLACK, ORANGE)
_FLOOR, _DRIVABLE, _WALL, _LACKING = 1, 2, 3, 4


def navigability(
    grid: OccupancyGrid,
    radius: float,
    found: Navigability | None = None,
    truth: tuple[OccupancyGrid, Pose2] | None = None,
    caption: str = "",
) -> Picture:
    """Draw where a robot can be on a map and, where there is a truth, how right the ways on it are.

    Parameters
    ----------
    grid
        The map.
    radius
        Of the robot [m].
    found
        The ways that were planned.
    truth
        The true environment and how the map lies on it, T_truth_grid: its obstacles that are free on the map
        are drawn.
    caption
        Words below the picture.
    """
    labels = np.zeros(grid.shape, np.uint8)
    labels[grid.free] = _FLOOR
    labels[drivable(grid, radius)] = _DRIVABLE
    labels[grid.occupied] = _WALL
    legend = [
        (WALL_BLACK, "obstacle"),
        (_DRIVABLE_TINT, f"where a robot of radius {radius:g} m can be"),
    ]
    if truth is not None:
        there, T_truth_grid = truth
        # What truth has on cells that are free on the map; walls' edges are half a cell off everywhere.
        lacking = (resample(there, T_truth_grid.inverse(), grid) >= OCCUPIED_FROM) & drivable(grid, radius)
        labels[lacking] = _LACKING
        legend.append((ORANGE, "obstacle in truth there"))
    canvas = paint(labels, _PALETTE, known_window(grid))
    if found is not None:
        for colour, words, ways in (
            (GREEN, "way that can be driven", [way for way in found.ways if way.drivable]),
            (RED, "false passage", [way for way in found.ways if way.false_passage]),
        ):
            for way in ways:
                assert way.path is not None
                at = grid.metres_to_lattice(way.path)
                canvas = with_lines(
                    canvas, at[:-1], at[1:], [colour] * (len(at) - 1), 1 if colour == GREEN else 2
                )
            legend.append((colour, f"{words} ({len(ways)})"))
        blocked = [place for way in found.ways if way.false_block for place in (way.start, way.goal)]
        if blocked:
            canvas = with_dots(canvas, grid.metres_to_lattice(blocked), BLUE, 4, hollow=True)
        legend.append((BLUE, f"no way between, but in truth ({found.false_blocks})"))
    return compose(
        [Panel(canvas.picture)], with_turn(caption, grid), legend, canvas.px_per_cell / grid.resolution
    )
