"""Recorded routes: places to pass, or the commands of an earlier drive."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mapmeld.io import AnyPath, MapFileError
from mapmeld.io.images import open_regular
from mapmeld.simulation.driving import STOP, Command, Sight

MAX_LINES = 200_000
_MAX_BYTES = 1 << 24


@dataclass(frozen=True, slots=True)
class Route:
    """What a route file holds: one of the two.

    Attributes
    ----------
    waypoints
        Places (x, y) [m] in the environment's frame.
    commands
        Stamps [s after the start] and what to do from then on.
    """

    waypoints: tuple[tuple[float, float], ...] = ()
    commands: tuple[tuple[float, Command], ...] = ()


def read_route(path: AnyPath) -> Route:
    """Read a route: lines of two numbers are waypoints, of three a log of commands.

    ``x y`` [m], or ``t v w`` [s, m/s, rad/s] in order of time. Numbers stand apart by spaces or commas;
    blank lines and what follows a ``#`` do not count.

    Raises
    ------
    MapFileError
        It cannot be read, or a line is not of that form; the message has its number.
    """
    with open_regular(path) as (file, size):
        if size > _MAX_BYTES:
            raise MapFileError.of(path, f"is too large ({size:,} bytes, {_MAX_BYTES:,} at most)")
        data = file.read(_MAX_BYTES)
    try:
        lines = data.decode("utf-8").splitlines()
    except UnicodeDecodeError:
        raise MapFileError.of(path, "is no route (it is not UTF-8 text)") from None
    if len(lines) > MAX_LINES:
        raise MapFileError.of(path, f"has too many lines ({len(lines):,}, {MAX_LINES:,} at most)")
    rows: list[tuple[float, ...]] = []
    for number, line in enumerate(lines, 1):
        words = line.partition("#")[0].replace(",", " ").split()
        if not words:
            continue
        try:
            row = tuple(map(float, words))
        except ValueError:
            raise MapFileError.of(path, f"line {number}: numbers are needed, not {line[:40]!r}") from None
        if len(row) not in (2, 3) or not all(map(math.isfinite, row)):
            raise MapFileError.of(
                path, f"line {number}: 'x y' or 't v w' is needed (finite numbers), not {line[:40]!r}"
            )
        if rows and len(row) != len(rows[0]):
            raise MapFileError.of(
                path, f"line {number} has {len(row)} numbers, those before it {len(rows[0])}"
            )
        if len(row) == 3 and (row[0] < 0 or (rows and row[0] < rows[-1][0])):
            raise MapFileError.of(path, f"line {number}: times start at 0 or later and do not go back")
        rows.append(row)
    if not rows:
        raise MapFileError.of(path, "holds no waypoints and no commands")
    if len(rows[0]) == 2:
        return Route(waypoints=tuple((x, y) for x, y in rows))
    return Route(commands=tuple((t, Command(v, w)) for t, v, w in rows))


class CommandLogDriver:
    """Repeats logged commands at their times; over with the last one, which should be a stop."""

    def __init__(self, commands: tuple[tuple[float, Command], ...]) -> None:
        self._commands = commands
        self._next = 0
        self._now = STOP
        self._begun: float | None = None

    def command(self, sight: Sight) -> Command | None:
        """Return the command that holds at this moment."""
        if self._begun is None:
            self._begun = sight.stamp
        after = sight.stamp - self._begun + 1e-9
        while self._next < len(self._commands) and self._commands[self._next][0] <= after:
            self._now = self._commands[self._next][1]
            self._next += 1
        return None if self._next == len(self._commands) else self._now
