"""A map as it grows: one state per second in which it changed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from mapmeld.grid import OccupancyGrid
from mapmeld.recording import Laser, Scan
from mapmeld.slam.gmapping import GMapping
from mapmeld.slam.parameters import GMappingParameters

_ROUNDING = 1e-6  # [s] that stamps may lack; counted from 1970, they cannot say less either


def second_of(stamp: float, start: float, every: float = 1.0) -> int:
    """Return in which second of the length `every` [s] after `start` a stamp lies, from 0."""
    return math.floor((stamp - start + _ROUNDING) / every)


def map_history(
    laser: Laser,
    scans: Iterable[Scan],
    parameters: GMappingParameters | None = None,
    seed: int = 0,
    every: float = 1.0,
) -> Iterator[OccupancyGrid]:
    """Map, and give the states of the map as `states` does."""
    return states(GMapping(laser, parameters, seed), scans, every)


def states(slam: GMapping, scans: Iterable[Scan], every: float = 1.0) -> Iterator[OccupancyGrid]:
    """Give scans to `slam`, and the map at the end of every second in which it changed.

    The history of a mapping process as "Map Matching for SLAM with Multiple Robots in Different Moments"
    stores it. The last state is the finished map.

    Parameters
    ----------
    slam
        Takes the scans; afterwards it has the trajectory.
    scans
        In time order; taken one by one.
    every
        Length of a second [s], counted from the first scan.

    Yields
    ------
    OccupancyGrid
        Its stamp is that of the last scan in it.
    """
    if not every > 0:
        raise ValueError(f"every must be more than 0 seconds, not {every}")
    start: float | None = None
    changed_in: int | None = None
    for scan in scans:
        start = scan.stamp if start is None else start
        second = second_of(scan.stamp, start, every)
        if changed_in is not None and second > changed_in and slam.has_map:
            yield slam.map()
            changed_in = None
        if slam.add(scan):
            changed_in = second
    if changed_in is not None and slam.has_map:
        yield slam.map()
