"""Pictures of maps: the environment (Figure 8a), overlays (8b to d), further mappings (9), failures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mapmeld.experiment.rows import JoinRow, MatchingRow
from mapmeld.experiment.stages.mapped import mapped, true_environment
from mapmeld.grid import UNKNOWN, OccupancyGrid, resample
from mapmeld.report.canvas import Canvas, Picture, Window, paint, paint_map, whole_scale
from mapmeld.report.overlay import overlay_labels
from mapmeld.report.palette import FLOOR_WHITE, GREEN, UNKNOWN_GREY, colour_of_map
from mapmeld.report.sheet import Panel, compose
from mapmeld.se2 import Pose2

_MARGIN = 0.5  # around what is drawn [m]
_LARGE_PX, _SMALL_PX = 750, 480


def true_map_picture(root: Path, environment: int) -> Picture:
    """Draw the true environment in the paper's greys (Figure 8a)."""
    truth = true_environment(root, environment)
    canvas = paint_map(truth)
    return compose([Panel(canvas.picture)], "", (), canvas.px_per_cell / truth.resolution)


def overlay_picture(
    root: Path,
    environment: int,
    members: Sequence[int],
    poses: Sequence[Pose2],
) -> Picture:
    """Draw mappings over one another: 1 red, 2 blue, walls that two or more share green.

    As the environment lies: map 1 where it truly is, the others where the poses T_first_member lay them.
    """
    canvas, resolution = _overlaid(root, environment, members, poses, _LARGE_PX)
    legend = [(colour_of_map(i), f"mapping {number}") for i, number in enumerate(members)]
    legend.append((GREEN, "walls in both" if len(members) == 2 else "walls in two or more"))
    return compose([Panel(canvas.picture)], "", legend, canvas.px_per_cell / resolution)


def join_picture(root: Path, row: JoinRow, size: int) -> Picture:
    """Draw the first so many of the mappings that were joined (Figure 9)."""
    poses = [Pose2(*pose) for pose in row.poses[:size]]
    return overlay_picture(root, row.environment, row.members[:size], poses)


def matching_picture(root: Path, row: MatchingRow) -> Picture:
    """Draw what a matching found (Figure 8b)."""
    assert row.T_1_2 is not None
    return overlay_picture(
        root, row.environment, (row.mapping_1, row.mapping_2), (Pose2(), Pose2(*row.T_1_2))
    )


def failure_picture(root: Path, row: MatchingRow) -> Picture:
    """Draw what was found beside what is true, small."""
    members = (row.mapping_1, row.mapping_2)
    panels = []
    for name, pose in (("found", row.T_1_2), ("true", row.truth)):
        if pose is not None:
            canvas, _ = _overlaid(root, row.environment, members, (Pose2(), Pose2(*pose)), _SMALL_PX)
            panels.append(Panel(canvas.picture, name))
    legend = [(colour_of_map(i), f"mapping {number}") for i, number in enumerate(members)]
    return compose(panels, "", [*legend, (GREEN, "walls in both")])


def _overlaid(
    root: Path, environment: int, members: Sequence[int], poses: Sequence[Pose2], long_side_px: int
) -> tuple[Canvas, float]:
    maps = [mapped(root, environment, number) for number in members]
    T_world_first = maps[0].T_world_map
    placed = [(m.grid, T_world_first @ pose) for m, pose in zip(maps, poses, strict=True)]
    lattice = _lattice(placed)
    labels = overlay_labels([resample(grid, T, lattice) for grid, T in placed])
    colours = [colour_of_map(i) for i in range(len(maps))]
    rows, cols = lattice.shape
    scale = whole_scale(max(rows, cols), long_side_px)
    return (
        paint(labels, [UNKNOWN_GREY, FLOOR_WHITE, *colours, GREEN], Window(0, 0, cols, rows), scale),
        lattice.resolution,
    )


def _lattice(placed: Sequence[tuple[OccupancyGrid, Pose2]]) -> OccupancyGrid:
    """Return a lattice along the environment's axes that holds the known cells of all maps."""
    resolution = placed[0][0].resolution
    points = np.concatenate([T.apply(grid.centres(grid.known)) for grid, T in placed])
    low = np.floor((points.min(axis=0) - _MARGIN) / resolution) * resolution
    cols, rows = (math.ceil(side) for side in (points.max(axis=0) + _MARGIN - low) / resolution)
    first = placed[0][0]
    return replace(
        first,
        cells=np.full((rows, cols), UNKNOWN, np.int8),
        origin=Pose2(float(low[0]), float(low[1])),
    )
