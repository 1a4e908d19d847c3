"""Small environments, drawn by the V-REP generator's codes; the top line is the top row."""

from __future__ import annotations

import numpy as np

from mapmeld.simulation import Environment

TWO_ROOMS = """
8:1:1:1:4:1:1:1:7
0:-2:-2:-2:0:-2:-2:-2:0
0:-2:-2:-2:-1:-2:-2:-2:0
0:-2:-2:-2:0:-2:-2:-2:0
9:1:1:1:5:1:1:1:6
"""
"""Two rooms of 3.9 x 3.9 m side by side, joined by a door at (4.5, 2.5)."""

HALL = """
8:1:1:1:1:1:1:1:1:7
0:-2:-2:-2:-2:-2:-2:-2:-2:0
0:-2:-2:-2:-2:-2:-2:-2:-2:0
0:-2:-2:-2:-2:-2:-2:-2:-2:0
0:-2:-2:-2:-2:-2:-2:-2:-2:0
0:-2:-2:-2:-2:-2:-2:-2:-2:0
9:1:1:1:1:1:1:1:1:6
"""


def fields(text: str) -> np.ndarray:
    rows = [list(map(int, line.split(":"))) for line in text.split()]
    return np.array(rows[::-1], np.int8)


def two_rooms() -> Environment:
    return Environment(fields(TWO_ROOMS))


def hall() -> Environment:
    return Environment(fields(HALL))
