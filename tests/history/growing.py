"""Histories drawn for tests: what a robot has seen of a place after each state, in a frame of its own."""

from collections.abc import Sequence
from dataclasses import replace

from drawing import cut, office, seen_from

from mapmeld.grid import OccupancyGrid
from mapmeld.se2 import Pose2

T_2_PLACE = Pose2(3.0, -2.0, 0.7)
T_1_2 = T_2_PLACE.inverse()  # process 1 has the frame of the place itself


def grown(
    place: OccupancyGrid,
    rectangles: Sequence[tuple[float, float, float, float]],
    T_own_place: Pose2 | None = None,
    *,
    begin: float = 0.0,
    period: float = 10.0,
) -> list[OccupancyGrid]:
    """The place cut to each rectangle [m], on a lattice of its own size every time."""
    T = T_own_place or Pose2()
    maps = [cut(place, *rectangle) for rectangle in rectangles]
    maps = [grid if Pose2() == T else seen_from(grid, T) for grid in maps]
    return [replace(grid, stamp=begin + k * period) for k, grid in enumerate(maps)]


def two_robots() -> tuple[list[OccupancyGrid], list[OccupancyGrid]]:
    """Robot 1 comes from the left of the office, robot 2 from the right; they meet."""
    office_map = office()
    first = [(0.0, 0.0, x, 12.0) for x in (3.0, 6.0, 9.0, 12.0, 16.0)]
    second = [(x, 0.0, 16.0, 12.0) for x in (13.0, 10.0, 7.0, 4.0, 0.0)]
    return grown(office_map, first), grown(office_map, second, T_2_PLACE, begin=5.0)
