"""A terminal to drive in: single keys in, the floor plan around the robot out."""

from __future__ import annotations

import math
import os
import select
import shutil
import signal
import sys
import termios
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from mapmeld.errors import MapmeldError

if TYPE_CHECKING:
    from mapmeld.grid import OccupancyGrid
    from mapmeld.se2 import Pose2

_ARROWS = "→↗↑↖←↙↓↘"
_CELL = 0.25, 0.5  # width and height [m] of a character of the plan
_HOME, _CLEAR_LINE, _CLEAR_BELOW = "\x1b[H", "\x1b[K", "\x1b[J"


class TerminalError(MapmeldError):
    """There is no terminal to drive from."""


@contextmanager
def single_keys() -> Iterator[Keys]:
    """Read keys one by one, Ctrl-C among them, until the block ends.

    Who closes the terminal, or ends the process, presses Ctrl-C: what was done so far is not lost.

    Raises
    ------
    TerminalError
        Standard input or output is no terminal.
    """
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise TerminalError("driving by keyboard needs a terminal; take another --drive, or run it in one")
    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)
    changed = termios.tcgetattr(descriptor)
    changed[3] &= ~(termios.ICANON | termios.ECHO | termios.ISIG)
    keys = Keys(descriptor)
    handlers = {
        number: signal.signal(number, lambda *_: keys.end()) for number in (signal.SIGHUP, signal.SIGTERM)
    }
    try:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, changed)
        yield keys
    finally:
        with suppress(termios.error):  # the terminal is gone
            termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
        for number, handler in handlers.items():
            signal.signal(number, handler)


class Keys:
    """The keys of a terminal."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._ended = False

    def end(self) -> None:
        """Let Ctrl-C be pressed."""
        self._ended = True

    def pressed(self) -> str:
        """Return the keys pressed since the last call, without waiting; Ctrl-C if the terminal is gone."""
        if self._ended:
            return "\x03"
        if not select.select([self._descriptor], [], [], 0)[0]:
            return ""
        try:
            data = os.read(self._descriptor, 1024)
        except OSError:
            data = b""
        return data.decode("utf-8", "replace") or "\x03"


class Screen:
    """Shows where the robot is, a few times a second."""

    def __init__(self, plan: OccupancyGrid, help_text: str) -> None:
        self._plan, self._help = plan, help_text
        self._shown = -math.inf

    def show(self, pose: Pose2, status: str) -> None:
        """Draw plan and status anew, if the last time is long enough ago."""
        now = time.monotonic()
        if now - self._shown < 0.15:
            return
        self._shown = now
        columns, lines = shutil.get_terminal_size()
        words = [*self._help.splitlines(), status[: columns - 1]]
        picture = plan_around(self._plan, pose, columns - 1, max(3, lines - len(words) - 1))
        text = "".join(f"{line}{_CLEAR_LINE}\r\n" for line in (*picture, *words))
        with suppress(OSError):  # the terminal is gone; the drive ends with the next look at the keys
            sys.stdout.write(_HOME + text + _CLEAR_BELOW)
            sys.stdout.flush()


def plan_around(plan: OccupancyGrid, pose: Pose2, columns: int, lines: int) -> list[str]:
    """Return the plan around a robot in characters: walls and furniture full blocks, the robot an arrow."""
    import numpy as np

    width, height = _CELL
    across, down = width / plan.resolution, height / plan.resolution
    col, row = plan.metres_to_lattice((pose.x, pose.y))
    left, top = col - columns // 2 * across, row + lines // 2 * down
    occupied = plan.occupied
    picture = []
    for line in range(lines):
        r0, r1 = (int(np.clip(top - (line + k) * down, 0, plan.shape[0])) for k in (1, 0))
        signs = []
        for column in range(columns):
            c0, c1 = (int(np.clip(left + (column + k) * across, 0, plan.shape[1])) for k in (0, 1))
            signs.append("█" if occupied[r0:r1, c0:c1].any() else " ")
        picture.append(signs)
    arrow = _ARROWS[round(pose.theta / (math.pi / 4)) % 8]
    picture[lines // 2][columns // 2] = arrow
    return ["".join(signs).rstrip() for signs in picture]


class Clock:
    """Keeps simulated time in step with the time of day."""

    def __init__(self) -> None:
        self._begun = time.monotonic()

    def wait_until(self, stamp: float) -> None:
        """Sleep until `stamp` [s] after the clock was made; not at all where that is past."""
        rest = self._begun + stamp - time.monotonic()
        if rest > 0:
            time.sleep(rest)
        elif rest < -1.0:
            self._begun -= rest  # the machine was too slow, or asleep: do not race after it
