"""The fields of an environment: what stands on each square metre, and which way its walls run.

The codes are those of the V-REP map generator's map text. A wall piece runs from the middle of its
field to the sides named by its *arms*; a door is a wall piece with an opening in the middle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

Fields = NDArray[np.int8]
"""(rows, cols) codes, row 0 at the bottom; field (row, col) covers [col, col + 1] x [row, row + 1] m."""

Rooms = NDArray[np.int32]
"""(rows - 1, cols - 1): number of the room, from 1, that holds the point (col + 1, row + 1) [m]."""

EMPTY, DOOR = -2, -1
UP, DOWN, LEFT, RIGHT = 1, 2, 4, 8

ARMS = (
    UP | DOWN,
    LEFT | RIGHT,
    UP | DOWN | LEFT,
    UP | DOWN | RIGHT,
    LEFT | RIGHT | DOWN,
    LEFT | RIGHT | UP,
    UP | LEFT,
    DOWN | LEFT,
    RIGHT | DOWN,
    UP | RIGHT,
    UP | DOWN | LEFT | RIGHT,
)
"""Where the wall piece of each code, 0 to 10, reaches to."""


class StrayDoorError(ValueError):
    """A door that is in no wall.

    Attributes
    ----------
    row, col
        Its field, row 0 at the bottom.
    """

    def __init__(self, row: int, col: int) -> None:
        super().__init__(f"the door in row {row}, column {col} (from 0, lower left) is in no wall")
        self.row, self.col = row, col


_CODES = np.full(16, EMPTY, np.int8)
_CODES[list(ARMS)] = np.arange(len(ARMS))


def codes_of(arms: NDArray[np.uint8]) -> Fields:
    """Return the codes of fields with these arms (rows, cols); none is empty ground.

    Raises
    ------
    ValueError
        A wall ends in a field: no code stands for a piece with one arm.
    """
    codes: Fields = _CODES[arms]
    if ((codes == EMPTY) & (arms != 0)).any():
        raise ValueError("a wall ends in the middle of a field")
    return codes


def arms_of(fields: Fields) -> NDArray[np.uint8]:
    """Return the arms (rows, cols) of all fields; a door's are those of the wall that it is in.

    Raises
    ------
    StrayDoorError
        A door is in no wall.
    """
    table = np.array([*ARMS, 0, 0], np.uint8)  # codes -2 and -1 are the last two
    arms = table[fields]
    around = np.pad(arms, 1)
    for row, col in zip(*np.nonzero(fields == DOOR), strict=True):
        across = int(around[row + 1, col] & RIGHT > 0) + int(around[row + 1, col + 2] & LEFT > 0)
        along = int(around[row, col + 1] & UP > 0) + int(around[row + 2, col + 1] & DOWN > 0)
        if not across and not along:
            raise StrayDoorError(int(row), int(col))
        arms[row, col] = LEFT | RIGHT if across >= along else UP | DOWN
    return arms


def edges_of(arms: NDArray[np.uint8]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return where walls join neighbours: (rows, cols - 1) to the right, (rows - 1, cols) upwards."""
    across = (arms[:, :-1] & RIGHT > 0) | (arms[:, 1:] & LEFT > 0)
    along = (arms[:-1] & UP > 0) | (arms[1:] & DOWN > 0)
    return across, along


def rooms_between(across: NDArray[np.bool_], along: NDArray[np.bool_]) -> Rooms:
    """Return the rooms that walls and (closed) doors part, numbered from 1; see `edges_of`."""
    rows, cols = along.shape[0], across.shape[1]
    # A lattice of squares with what lies between them: a square is a room where nothing parts it.
    lattice = np.zeros((2 * rows - 1, 2 * cols - 1), np.bool_)
    lattice[::2, ::2] = True
    lattice[::2, 1::2] = ~along[:, 1:-1]
    lattice[1::2, ::2] = ~across[1:-1]
    numbers, _ = label(lattice)
    rooms: Rooms = np.ascontiguousarray(numbers[::2, ::2], np.int32)
    return rooms


def rooms_of(fields: Fields) -> Rooms:
    """Return the rooms of an environment; numbered from 1, row by row from the bottom."""
    return rooms_between(*edges_of(arms_of(fields)))


def sides_of_door(rooms: Rooms, row: int, col: int, arms: int) -> tuple[int, int]:
    """Return the rooms on the two sides of a straight piece of wall or a door; 0 is outside."""
    around = np.pad(rooms, 1)  # the squares about field (row, col) are [row : row + 2, col : col + 2]
    first = int(around[row, col])
    other = around[row + 1, col] if arms == LEFT | RIGHT else around[row, col + 1]
    return first, int(other)
