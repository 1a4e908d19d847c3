"""Random floor plans, and maps of parts of them, for what needs thousands of maps.

A plan is a rectangle split again and again into rooms with doors, with cabinets in them. A map of it is
what lies within some metres' way of a start point: its floor and the walls around that, with a part of
the wall cells missing or thickened, in a frame of its own at any angle. The same seed gives the same maps.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmeld.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, resample
from mapmeld.se2 import Pose2

RESOLUTION = 0.05  # [m]
WALL = 2  # cells
DOOR = 18  # cells
LEAST_ROOM = 50, 90  # cells: no room is split to less than a size drawn from these


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """A floor: 255 where there is wall, 0 where there is floor, (rows, cols)."""

    wall: NDArray[np.uint8]


def random_plan(seed: int) -> Plan:
    """Draw a floor plan of 9 to 30 m by 7 to 20 m."""
    rng = np.random.default_rng((1, seed))
    rows, cols = int(rng.integers(140, 400)), int(rng.integers(180, 600))
    wall = np.zeros((rows, cols), np.uint8)
    wall[:WALL] = wall[-WALL:] = 255
    wall[:, :WALL] = wall[:, -WALL:] = 255
    least = int(rng.integers(*LEAST_ROOM))
    rooms = [(0, 0, rows, cols)]
    done: list[tuple[int, int, int, int]] = []
    while rooms:
        r0, c0, r1, c1 = rooms.pop()
        height, width = r1 - r0, c1 - c0
        across = width >= height  # the longer side is split
        side = width if across else height
        if side < 2 * least or (side < 4 * least and rng.random() < 0.12):
            done.append((r0, c0, r1, c1))
            continue
        at = int(rng.integers(least, side - least + 1))
        if across:
            wall[r0:r1, c0 + at : c0 + at + WALL] = 255
            rooms += [(r0, c0, r1, c0 + at), (r0, c0 + at, r1, c1)]
        else:
            wall[r0 + at : r0 + at + WALL, c0:c1] = 255
            rooms += [(r0, c0, r0 + at, c1), (r0 + at, c0, r1, c1)]
        doors = 1 + int(rng.random() < 0.3)
        for _ in range(doors):
            along = height if across else width
            if along > DOOR + 4 * WALL:
                d = int(rng.integers(2 * WALL, along - DOOR - WALL))
                if across:
                    wall[r0 + d : r0 + d + DOOR, c0 + at : c0 + at + WALL] = 0
                else:
                    wall[r0 + at : r0 + at + WALL, c0 + d : c0 + d + DOOR] = 0
    for r0, c0, r1, c1 in done:
        for _ in range(int(rng.integers(0, 5))):
            _furnish(wall, rng, r0, c0, r1, c1)
    return Plan(wall)


def _furnish(wall: NDArray[np.uint8], rng: np.random.Generator, r0: int, c0: int, r1: int, c1: int) -> None:
    h, w = (int(v) for v in rng.integers(4, 22, 2))
    if r1 - r0 < h + 12 or c1 - c0 < w + 12:
        return
    r, c = int(rng.integers(r0 + WALL, r1 - h)), int(rng.integers(c0 + WALL, c1 - w))
    if rng.random() < 0.7:  # against a wall
        if rng.random() < 0.5:
            r = r0 + WALL if rng.random() < 0.5 else r1 - h
        else:
            c = c0 + WALL if rng.random() < 0.5 else c1 - w
    angle = 0.0 if rng.random() < 0.8 else float(rng.uniform(0, 90))
    box = cv2.boxPoints(((c + w / 2, r + h / 2), (w, h), angle))
    cv2.fillPoly(wall, [np.round(box).astype(np.int32)], 255)


def map_of(plan: Plan, seed: int, reach: tuple[float, float] = (8.0, 22.0)) -> OccupancyGrid:
    """Map the part of a plan within a way of `reach` [m] (a range to draw from) of a random start."""
    rng = np.random.default_rng((2, seed))
    floor = (plan.wall == 0).astype(np.uint8)
    cells = np.flatnonzero(floor)
    start = int(rng.choice(cells))
    # The way grows by steps of 0.5 m: wide enough to be quick, too narrow to jump over a wall's doors.
    seen = np.zeros_like(floor)
    seen[start // floor.shape[1], start % floor.shape[1]] = 1
    step = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
    small = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    for number in range(round(float(rng.uniform(*reach)) / RESOLUTION / 1.7)):
        grown = cv2.dilate(seen, step if number % 3 else small)
        seen = cv2.bitwise_and(grown, floor)
    near = cv2.dilate(seen, np.ones((2 * WALL + 1, 2 * WALL + 1), np.uint8))
    wall = (plan.wall > 0) & (near > 0)
    noise = rng.random(floor.shape)
    ragged = cv2.dilate(((noise < 0.05) & wall).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    occupied = ((wall & (noise < 0.85)) | (ragged & (near > 0))) & (noise < 0.99)
    occupied |= (seen > 0) & (noise > 0.9995)
    grid = np.full(floor.shape, UNKNOWN, np.int8)
    grid[seen > 0] = FREE
    grid[occupied] = OCCUPIED
    theta, x, y = float(rng.uniform(-math.pi, math.pi)), *(float(v) for v in rng.uniform(-20, 20, 2))
    return _turned(OccupancyGrid(grid, RESOLUTION).cropped(2), Pose2(x, y, theta))


def _turned(grid: OccupancyGrid, T_new_old: Pose2) -> OccupancyGrid:
    rows, cols = grid.shape
    corners = T_new_old.apply(grid.lattice_to_metres([(0, 0), (cols, 0), (0, rows), (cols, rows)]))
    low = corners.min(axis=0)
    width, height = np.ceil((corners.max(axis=0) - low) / grid.resolution).astype(int) + 1
    lattice = OccupancyGrid(
        np.full((height, width), UNKNOWN, np.int8), grid.resolution, Pose2(float(low[0]), float(low[1]))
    )
    return OccupancyGrid(resample(grid, T_new_old, lattice), grid.resolution, lattice.origin)


def synthetic_maps(count: int, seed: int, per_plan: int = 2) -> Iterator[tuple[int, OccupancyGrid]]:
    """Yield (number of the plan, map), `per_plan` maps of each plan."""
    for number in range(count):
        plan_number, part = divmod(number, per_plan)
        plan = random_plan(seed * 1_000_003 + plan_number)
        yield plan_number, map_of(plan, (seed * 1_000_003 + plan_number) * 16 + part)
