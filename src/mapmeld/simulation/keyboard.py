"""Driving with the keys of teleop_twist_keyboard."""

from __future__ import annotations

from collections.abc import Callable

from mapmeld.simulation.driving import STOP, Command, Sight
from mapmeld.simulation.robot import MECABOT, Robot

QUIT = "\x03"
"""What Ctrl-C sends."""

# Speed ahead and turn as parts of the set speeds.
MOVES = {
    "i": (1, 0),
    "o": (1, -1),
    "j": (0, 1),
    "l": (0, -1),
    "u": (1, 1),
    ",": (-1, 0),
    ".": (-1, 1),
    "m": (-1, -1),
}
"""The keys that drive. With Shift, teleop_twist_keyboard moves sideways, which these wheels cannot:
there they do the same, but pure sideways (J and L) stops."""

_SHIFTED = {"I": "i", "O": "o", "U": "u", "<": ",", ">": ".", "M": "m"}

SPEEDS = {
    "q": (1.1, 1.1),
    "z": (0.9, 0.9),
    "w": (1.1, 1.0),
    "x": (0.9, 1.0),
    "e": (1.0, 1.1),
    "c": (1.0, 0.9),
}
"""Keys that change the set speed and turn rate by a tenth."""

HELP = """\
Moving around:        q/z : all speeds up/down by 10%
   u    i    o        w/x : only speed ahead
   j    k    l        e/c : only turn rate
   m    ,    .        any other key : stop       Ctrl-C : finish"""


class KeyboardDriver:
    """Turns key presses into commands; a command holds until the next key.

    Parameters
    ----------
    keys
        Returns the keys pressed since it was called last.
    robot
        Starts with its full speeds, which the paper drove with; they cannot be exceeded.
    """

    def __init__(self, keys: Callable[[], str], robot: Robot = MECABOT) -> None:
        self._keys, self._robot = keys, robot
        self.speed, self.turn = robot.max_v, robot.max_w
        self._move = (0, 0)
        self._over = False

    def press(self, key: str) -> None:
        """Take in one key."""
        key = _SHIFTED.get(key, key)
        if key == QUIT:
            self._over = True
        elif key in SPEEDS:
            ahead, turning = SPEEDS[key]
            self.speed = min(self.speed * ahead, self._robot.max_v)
            self.turn = min(self.turn * turning, self._robot.max_w)
        else:
            self._move = MOVES.get(key, (0, 0))

    def command(self, sight: Sight) -> Command | None:
        """Return what the keys say; None after Ctrl-C."""
        del sight  # the one at the keyboard has eyes
        for key in self._keys():
            self.press(key)
        if self._over:
            return None
        if self._move == (0, 0):
            return STOP
        return Command(self._move[0] * self.speed, self._move[1] * self.turn)
