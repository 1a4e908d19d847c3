"""SLAM on board of a simulated robot: what it explores with, and the maps that it publishes."""

from __future__ import annotations

import math

import numpy as np

from mapmeld.grid import UNKNOWN, OccupancyGrid
from mapmeld.recording import Laser, Scan
from mapmeld.se2 import Pose2
from mapmeld.simulation.driving import Command, Driver, Sight
from mapmeld.slam import GMapping, GMappingParameters
from mapmeld.slam.history import second_of


def onboard_parameters(laser: Laser) -> GMappingParameters:
    """Return settings for mapping while driving.

    A scan is used every 0.3 m or 0.25 rad (a frontier driver decides by what is mapped), every third beam
    is matched, and beams that meet nothing free their way.
    """
    return GMappingParameters(
        linearUpdate=0.3, angularUpdate=0.25, lskip=2, maxRange=math.inf, maxUrange=laser.max_range
    )


class SlamMapper:
    """GMapping as a `Mapper`: it never looks at the true pose.

    The map's frame is that of odometry at the start, where the robot is set down.

    Parameters
    ----------
    laser
        Of the robot.
    parameters
        None: `onboard_parameters`.
    seed
        0 or more.

    Raises
    ------
    MissingExtraError
        numba is not installed.
    """

    def __init__(self, laser: Laser, parameters: GMappingParameters | None = None, seed: int = 0) -> None:
        self.slam = GMapping(laser, parameters or onboard_parameters(laser), seed)
        self._grid: OccupancyGrid | None = None  # as it is now, once asked for
        self._start: float | None = None
        self._changed_in: int | None = None
        self._state: OccupancyGrid | None = None

    def add(self, scan: Scan, T_world_base: Pose2) -> None:
        """Take in a scan with its odometry."""
        self._start = scan.stamp if self._start is None else self._start
        second = second_of(scan.stamp, self._start)
        if self._changed_in is not None and second > self._changed_in:
            self.finish()
        if self.slam.add(scan):
            self._grid, self._changed_in = None, second

    def grid(self) -> OccupancyGrid:
        """Return the map so far; a single unknown cell if nothing was met yet."""
        if self._grid is None:
            if not self.slam.has_map:
                return OccupancyGrid(np.full((1, 1), UNKNOWN, np.int8), self.slam.parameters.delta)
            self._grid = self.slam.map()
        return self._grid

    def pose(self) -> Pose2:
        """Return where the robot believes to be in its map."""
        return self.slam.pose

    def finish(self) -> None:
        """End the second that is running, if the map changed in it: there is a state to take."""
        if self._changed_in is not None and self.slam.has_map:
            self._state, self._changed_in = self.grid(), None

    def take_state(self) -> OccupancyGrid | None:
        """Return the map at the end of the last second if it changed in it, once; else None."""
        state, self._state = self._state, None
        return state


class MappingDriver:
    """Another driver, and a mapper that is fed on the way."""

    def __init__(self, driver: Driver, mapper: SlamMapper) -> None:
        self._driver, self._mapper = driver, mapper

    def command(self, sight: Sight) -> Command | None:
        """Return what the driver does."""
        if sight.scan is not None:
            self._mapper.add(sight.scan, sight.T_world_base)
        return self._driver.command(sight)
