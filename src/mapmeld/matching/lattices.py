"""Transforms between the lattices of two maps of one resolution [px], and between their frames [m]."""

from __future__ import annotations

from mapmeld.grid import OccupancyGrid
from mapmeld.se2 import Pose2


def in_metres(T_1_2_px: Pose2, map_1: OccupancyGrid, map_2: OccupancyGrid) -> Pose2:
    """Take a transform between the lattices [px] to the metric frames of the maps (T_a_b).

    Both maps must have the same resolution.
    """
    step = Pose2(T_1_2_px.x * map_1.resolution, T_1_2_px.y * map_1.resolution, T_1_2_px.theta)
    return map_1.origin @ step @ map_2.origin.inverse()


def in_pixels(T_a_b: Pose2, map_1: OccupancyGrid, map_2: OccupancyGrid) -> Pose2:
    """Take a transform between metric frames to one between the lattices [px]; undoes `in_metres`."""
    step = map_1.origin.inverse() @ T_a_b @ map_2.origin
    return Pose2(step.x / map_1.resolution, step.y / map_1.resolution, step.theta)
