"""Driving by commands from elsewhere, as robots' bases take them from ``cmd_vel``."""

from __future__ import annotations

import math

from mapmeld.simulation.driving import STOP, Command, Driver, Sight


class CommandedDriver:
    """Does what it was told last; until it is told anything, what another driver does.

    A drive of it never ends. The other driver is asked all the same: it may map on the way.

    Parameters
    ----------
    until_told
        Drives at first; None: the robot stands.
    """

    def __init__(self, until_told: Driver | None = None) -> None:
        self._other = until_told
        self._told: Command | None = None

    def tell(self, v: float, w: float) -> None:
        """Drive with this speed [m/s] and turn rate [rad/s] until told otherwise; from any thread.

        Raises
        ------
        ValueError
            They are not finite.
        """
        if not (math.isfinite(v) and math.isfinite(w)):
            raise ValueError(f"speeds must be finite, not {v}, {w}")
        self._told = Command(v, w)

    def command(self, sight: Sight) -> Command:
        """Return what the robot shall do."""
        others = None if self._other is None else self._other.command(sight)
        return self._told or others or STOP
