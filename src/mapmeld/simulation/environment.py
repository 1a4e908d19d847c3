"""An environment: walls and doors on a grid of metres, and what stands in the rooms."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from mapmeld.simulation.boxes import Box
from mapmeld.simulation.errors import SimulationError
from mapmeld.simulation.fields import DOOR, DOWN, EMPTY, LEFT, RIGHT, UP, Fields, StrayDoorError, arms_of

MIN_SIDE, MAX_SIDE = 3, 200
"""Shortest and longest side of the ground [m]."""

TABLE_LEG, CHAIR_LEG = 0.05, 0.03
"""Sides of a leg [m]."""


class Kind(StrEnum):
    """What a piece of furniture is."""

    CABINET = "cabinet"
    BOX = "box"
    TABLE = "table"
    CHAIR = "chair"


_LEG = {Kind.TABLE: TABLE_LEG, Kind.CHAIR: CHAIR_LEG}


@dataclass(frozen=True, slots=True)
class Furniture:
    """A piece of furniture: solid (cabinet, box) or on four legs (table, chair).

    Attributes
    ----------
    kind
        What it is.
    footprint
        The floor that it takes.
    """

    kind: Kind
    footprint: Box

    def solids(self) -> tuple[Box, ...]:
        """Return what of it a laser near the floor meets."""
        if self.kind not in _LEG:
            return (self.footprint,)
        leg = _LEG[self.kind]
        x, y = (self.footprint.length - leg) / 2, (self.footprint.width - leg) / 2
        return tuple(self.footprint.part(i * x, j * y, leg, leg) for i in (-1, 1) for j in (-1, 1))


@dataclass(frozen=True, slots=True, eq=False)
class Environment:
    """A floor to drive on. Its frame has the lower left corner of the ground as origin, y up.

    Attributes
    ----------
    fields
        Codes (rows, cols) of the fields, one metre each, row 0 at the bottom (see `fields`);
        made read-only.
    furniture
        What stands in the rooms.
    wall
        Thickness of the walls [m].
    door
        Width of a door's opening [m], within its field.
    """

    fields: Fields
    furniture: tuple[Furniture, ...] = ()
    wall: float = 0.1
    door: float = 0.9

    def __post_init__(self) -> None:
        fields = np.array(self.fields, np.int8, order="C")
        sides = " x ".join(map(str, fields.shape[::-1]))
        if fields.ndim != 2 or min(fields.shape) < MIN_SIDE or max(fields.shape) > MAX_SIDE:
            raise SimulationError(f"the ground needs sides of {MIN_SIDE} to {MAX_SIDE} fields, not {sides}")
        if fields.min() < EMPTY or fields.max() > 10:
            raise SimulationError("fields have codes from -2 to 10")
        if not (0.02 <= self.wall <= 0.5):
            raise SimulationError(f"walls are 0.02 to 0.5 m thick, not {self.wall:g}")
        if not (0.5 <= self.door <= 1.0):
            raise SimulationError(f"doors are 0.5 to 1 m wide, not {self.door:g}")
        try:
            arms_of(fields)
        except StrayDoorError as error:
            raise SimulationError(str(error)) from None
        fields.flags.writeable = False
        object.__setattr__(self, "fields", fields)

    def __eq__(self, other: object) -> bool:
        """Report whether both have the same walls, doors and furniture."""
        if not isinstance(other, Environment):
            return NotImplemented
        mine, theirs = (
            (e.furniture, e.wall, e.door, e.fields.shape, e.fields.tobytes()) for e in (self, other)
        )
        return mine == theirs

    __hash__ = None  # type: ignore[assignment]

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the ground [m]."""
        rows, cols = self.fields.shape
        return float(cols), float(rows)

    def walls(self, *, open_doors: bool = True) -> tuple[Box, ...]:
        """Return the walls as few long boxes, which may overlap where they meet."""
        arms = arms_of(self.fields)
        is_door = (self.fields == DOOR) & open_doors
        found = []
        for row in range(arms.shape[0]):
            for start, end in self._runs(arms[row] & LEFT > 0, arms[row] & RIGHT > 0, is_door[row]):
                found.append(Box((start + end) / 2, row + 0.5, end - start, self.wall))
        for col in range(arms.shape[1]):
            for start, end in self._runs(arms[:, col] & DOWN > 0, arms[:, col] & UP > 0, is_door[:, col]):
                found.append(Box(col + 0.5, (start + end) / 2, self.wall, end - start))
        return tuple(found)

    def _runs(self, before: np.ndarray, after: np.ndarray, is_door: np.ndarray) -> list[tuple[float, float]]:
        """Return (start, end) [m] of the walls along one line of fields."""
        runs: list[list[float]] = []
        for field in np.flatnonzero(before | after).tolist():
            jamb = (1 - self.door) / 2 if is_door[field] else 0.5
            # A piece that ends in the middle of its field goes on for half a thickness: corners close.
            low = field if before[field] else field + 0.5 - self.wall / 2
            high = field + 1.0 if after[field] else field + 0.5 + self.wall / 2
            pieces = [(low, field + jamb), (field + 1 - jamb, high)] if is_door[field] else [(low, high)]
            for start, end in pieces:
                if end <= start:
                    continue
                if runs and start <= runs[-1][1] + 1e-9:
                    runs[-1][1] = max(end, runs[-1][1])
                else:
                    runs.append([start, end])
        return [(start, end) for start, end in runs]

    def solids(self) -> tuple[Box, ...]:
        """Return all that a laser meets: walls, and furniture down to the legs."""
        return (*self.walls(), *(box for item in self.furniture for box in item.solids()))

    def footprints(self) -> tuple[Box, ...]:
        """Return all that a robot drives around: walls and the whole floor under furniture."""
        return (*self.walls(), *(item.footprint for item in self.furniture))

    def doors(self) -> tuple[Box, ...]:
        """Return the openings of the doors."""
        arms = arms_of(self.fields)
        found = []
        for row, col in zip(*np.nonzero(self.fields == DOOR), strict=True):
            theta = 0.0 if arms[row, col] & LEFT else math.pi / 2
            found.append(Box(col + 0.5, row + 0.5, self.door, self.wall, theta))
        return tuple(found)
