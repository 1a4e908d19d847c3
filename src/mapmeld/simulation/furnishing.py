"""Furniture and clutter at random, such that a robot still gets everywhere."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmeld.grid import Mask
from mapmeld.simulation.boxes import Box
from mapmeld.simulation.environment import Environment, Furniture, Kind
from mapmeld.simulation.fields import Rooms, rooms_of
from mapmeld.simulation.true_map import cover

PASSAGE = 0.6
"""Width [m] of the ways that stay free."""

_NARROWEST = 0.55  # [m] a way to a door; less than PASSAGE, as cells round obstacles up
_CELLS = 20  # of the working lattice in a metre
_GAP = 0.03  # between two pieces, and to the walls [m]
_DOOR_ZONE = 0.9  # radius around a door where nothing stands [m]
_AREA_PER_PIECE = 9.0  # [m^2]
_SURROUNDINGS = 1.5  # around a piece, in which the way past it is looked for [m]
_LARGEST_POCKET = 0.3  # [m^2] of floor that a piece may cut off


def furnish(environment: Environment, seed: int, density: float = 1.0) -> Environment:
    """Return the environment with other furniture; the same seed gives the same.

    Parameters
    ----------
    environment
        Its own furniture is taken out.
    seed
        0 or more.
    density
        1 is a piece (a table with its chairs counts as one) for every 9 square metres.
    """
    rng = np.random.default_rng((seed, 1))
    rooms = rooms_of(environment.fields)
    furniture: list[Furniture] = []
    for number in range(1, int(rooms.max(initial=0)) + 1):
        room = _Room(environment, rooms, number)
        for _ in range(rng.poisson(density * room.area / _AREA_PER_PIECE)):
            furniture += room.add_something(rng)
    return replace(environment, furniture=tuple(furniture))


class _Room:
    """One room while it is being furnished: its floor on a lattice of small cells."""

    def __init__(self, environment: Environment, rooms: Rooms, number: int) -> None:
        self.wall = environment.wall
        self.squares = np.argwhere(rooms == number)  # (row, col) of the squares between four fields
        self.area = float(len(self.squares))
        (row0, col0), (row1, col1) = self.squares.min(axis=0), self.squares.max(axis=0) + 1
        self.corner = np.array((col0, row0), np.float64)  # a margin of half a metre, into the walls and doors
        shape = ((row1 - row0 + 1) * _CELLS, (col1 - col0 + 1) * _CELLS)
        half = _CELLS // 2
        inside = np.kron(rooms[row0:row1, col0:col1] == number, np.ones((_CELLS, _CELLS), np.bool_))
        self.floor = np.zeros(shape, np.bool_)
        self.floor[half:-half, half:-half] = inside
        walls = np.zeros(shape, np.bool_)
        cover(walls, self._here(environment.walls()), 1 / _CELLS)
        self.doors = [
            centre
            for centre in (np.array((door.x, door.y)) for door in environment.doors())
            if self._at(centre, np.pad(self.floor, 1), 1)
        ]
        self.blocked = walls | ~self.floor
        self.taken = self.blocked.copy()
        for centre in self.doors:
            x, y = centre - self.corner
            zone = self._around(Box(x, y, 2 * _DOOR_ZONE, 2 * _DOOR_ZONE))
            v, u = np.mgrid[zone] + 0.5
            self.taken[zone] |= np.hypot(u / _CELLS - x, v / _CELLS - y) < _DOOR_ZONE
            # The room ends in its doors, where nothing stands: they count as floor that must be reached.
            row, col, half = int(y * _CELLS), int(x * _CELLS), _CELLS // 2
            self.blocked[max(0, row - half) : row + half + 1, max(0, col - half) : col + half + 1] = False
        self.pieces: list[Furniture] = []
        self.joined = self._joined_doors(self.blocked)

    def _here(self, boxes: Iterable[Box]) -> list[Box]:
        return [replace(box, x=box.x - self.corner[0], y=box.y - self.corner[1]) for box in boxes]

    def _at(self, point: NDArray[np.float64], mask: Mask, margin: int) -> bool:
        """Whether the mask holds within 2 cells of a point [m]."""
        col, row = np.floor((point - self.corner) * _CELLS).astype(int) + margin
        if not (-2 <= row < mask.shape[0] + 2 and -2 <= col < mask.shape[1] + 2):
            return False
        return bool(mask[max(0, row - 2) : row + 3, max(0, col - 2) : col + 3].any())

    def add_something(self, rng: np.random.Generator) -> list[Furniture]:
        """Try to add a random piece (a table comes with chairs); return what was added."""
        draw = rng.random()
        before = len(self.pieces)
        if draw < 0.45:
            self._try(lambda: self._at_wall(rng))
        elif draw < 0.8:
            if self._try(lambda: self._table(rng)):
                table = self.pieces[-1].footprint
                for _ in range(rng.integers(1, 5)):
                    self._try(lambda: self._chair_at(table, rng))
        elif draw < 0.9:
            self._try(lambda: self._anywhere(Kind.CHAIR, 0.42, 0.42, rng))
        else:
            self._try(lambda: self._anywhere(Kind.BOX, rng.uniform(0.2, 0.45), rng.uniform(0.2, 0.45), rng))
        return self.pieces[before:]

    def _try(self, drawn: Callable[[], Furniture]) -> bool:
        return any(self._added(drawn()) for _ in range(8))

    def _added(self, piece: Furniture) -> bool:
        """Add a piece if nothing is in its place and the robot still gets everywhere."""
        (footprint,) = self._here([piece.footprint.grown(_GAP)])
        # All that matters is near: who could get past its surroundings before must still be able to.
        window = self._around(footprint)
        blocked, taken = self.blocked[window], self.taken[window]
        mask = np.zeros(blocked.shape, np.bool_)
        row, col = window[0].start, window[1].start
        cover(
            mask, [replace(footprint, x=footprint.x - col / _CELLS, y=footprint.y - row / _CELLS)], 1 / _CELLS
        )
        if not mask.any() or (mask & taken).any() or not _passable(blocked, blocked | mask):
            return False
        # What looks like a pocket there may be the way to a door.
        with_piece = self.blocked.copy()
        with_piece[window] |= mask
        if not self.joined <= self._joined_doors(with_piece):
            return False
        blocked |= mask
        taken |= mask
        self.pieces.append(piece)
        return True

    def _joined_doors(self, blocked: Mask) -> set[int]:
        """Return which of the doors lead to the largest part of the floor that hangs together."""
        _, parts, statistics, _ = cv2.connectedComponentsWithStats(_wide(blocked, _NARROWEST), connectivity=4)
        areas = statistics[1:, cv2.CC_STAT_AREA]
        largest = 1 + int(areas.argmax()) if len(areas) else -1
        cells = [np.floor((centre - self.corner) * _CELLS).astype(int) for centre in self.doors]
        return {number for number, (col, row) in enumerate(cells) if parts[row, col] == largest}

    def _around(self, box: Box) -> tuple[slice, slice]:
        reach_x, reach_y = (reach + _SURROUNDINGS for reach in box.reach())
        rows, cols = self.floor.shape
        bounds = (
            (max(0, math.floor((middle - reach) * _CELLS)), min(size, math.ceil((middle + reach) * _CELLS)))
            for middle, reach, size in ((box.y, reach_y, rows), (box.x, reach_x, cols))
        )
        (row0, row1), (col0, col1) = bounds
        return slice(row0, max(row0, row1)), slice(col0, max(col0, col1))

    # ------------------------------------------------------------------ what and where
    def _somewhere(self, rng: np.random.Generator) -> tuple[float, float]:
        row, col = self.squares[rng.integers(len(self.squares))]
        return float(col + 0.5 + rng.random()), float(row + 0.5 + rng.random())

    def _anywhere(self, kind: Kind, length: float, width: float, rng: np.random.Generator) -> Furniture:
        return Furniture(kind, Box(*self._somewhere(rng), length, width, rng.uniform(0, math.pi)))

    def _table(self, rng: np.random.Generator) -> Furniture:
        # Most tables stand along the walls' directions, hardly any exactly.
        theta = float(rng.integers(2) * math.pi / 2 + rng.normal(0, math.radians(4)))
        if rng.random() < 0.2:
            theta = rng.uniform(0, math.pi)
        return Furniture(
            Kind.TABLE, Box(*self._somewhere(rng), rng.uniform(0.9, 1.8), rng.uniform(0.6, 0.9), theta)
        )

    def _chair_at(self, table: Box, rng: np.random.Generator) -> Furniture:
        along, away = rng.uniform(-0.5, 0.5) * table.length, table.width / 2 + rng.uniform(0.27, 0.6)
        chair = table.part(along, rng.choice((-1.0, 1.0)) * away, 0.42, 0.42)
        return Furniture(Kind.CHAIR, replace(chair, theta=table.theta + rng.normal(0, 0.4)))

    def _at_wall(self, rng: np.random.Generator) -> Furniture:
        """Return a cabinet with its back to the next wall in a random direction."""
        x, y = self._somewhere(rng)
        length, depth = rng.uniform(0.6, 1.8), rng.uniform(0.3, 0.5)
        ahead = np.array(((1, 0), (0, 1), (-1, 0), (0, -1)), np.float64)[rng.integers(4)]
        point = np.array((x, y))
        while self._at(point, self.floor, 0) and np.abs(point - self.corner).max() < 1e3:
            point = point + ahead * 0.5
        # Walls run through the middles of fields.
        centre = np.array((x, y))
        axis = int(abs(ahead[1]))
        wall = round(float(point[axis]) - 0.5) + 0.5
        centre[axis] = wall - ahead[axis] * (self.wall / 2 + depth / 2 + 2 * _GAP)
        sides = (depth, length) if axis == 0 else (length, depth)
        return Furniture(Kind.CABINET, Box(float(centre[0]), float(centre[1]), *sides))


def _passable(before: Mask, after: Mask) -> bool:
    """Whether what hung together before still does, except for tiny pockets."""
    was, now = _wide(before), _wide(after)
    count, parts = cv2.connectedComponents(was, connectivity=4)
    for number in range(1, count):
        left = np.where(parts == number, now, 0).astype(np.uint8)
        areas = cv2.connectedComponentsWithStats(left, connectivity=4)[2][1:, cv2.CC_STAT_AREA]
        if (areas > _LARGEST_POCKET * _CELLS**2).sum() > 1 or (
            not len(areas) and (parts == number).sum() > _LARGEST_POCKET * _CELLS**2
        ):
            return False
    return True


def _wide(blocked: Mask, passage: float = PASSAGE) -> NDArray[np.uint8]:
    """Return where the middle of something of the width of a passage can be, as 0 and 1."""
    clearance = cv2.distanceTransform((~blocked).astype(np.uint8), cv2.DIST_L2, 5)
    wide: NDArray[np.uint8] = (clearance > passage / 2 * _CELLS).astype(np.uint8)
    return wide
