"""Random environments as the V-REP map generator draws them (L. Jelinek, 2016).

Rooms of given kinds are laid on a rectangular ground one after the other, later ones over earlier ones;
walls that meet are merged; doors along a spanning tree join all rooms, and further ones may be drawn.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mapmeld.simulation.environment import MAX_SIDE, Environment
from mapmeld.simulation.errors import SimulationError
from mapmeld.simulation.fields import (
    DOOR,
    DOWN,
    LEFT,
    RIGHT,
    UP,
    Fields,
    Rooms,
    codes_of,
    rooms_between,
    sides_of_door,
)
from mapmeld.simulation.furnishing import furnish
from mapmeld.simulation.vrep_files import Configuration

MIN_GROUND = 5

_TRIES = 300  # places tried for a room before the plan is begun anew
_PLANS = 20

Pair = tuple[int, int]
Place = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Settings:
    """What kind of environment to draw.

    Attributes
    ----------
    width, height
        Sides of the ground [fields of 1 m], outer walls included.
    configuration
        Number and kinds of rooms. Each room laid down makes at least one room more.
    extra_doors
        Probability of a door between two neighbouring rooms that need none, 0..1.
    furniture
        How densely rooms are furnished: 0 bare, 1 as usual, up to 3.
    wall, door
        See `Environment` [m].

    Raises
    ------
    SimulationError
        A value out of range.
    """

    width: int = 20
    height: int = 20
    configuration: Configuration = field(default_factory=Configuration)
    extra_doors: float = 0.3
    furniture: float = 1.0
    wall: float = 0.1
    door: float = 0.9

    def __post_init__(self) -> None:
        if not all(MIN_GROUND <= side <= MAX_SIDE for side in (self.width, self.height)):
            raise SimulationError(
                f"the ground needs sides of {MIN_GROUND} to {MAX_SIDE} m, not {self.width} x {self.height}"
            )
        if not 0 <= self.extra_doors <= 1:
            raise SimulationError(f"extra_doors is a probability, 0 to 1, not {self.extra_doors:g}")
        if not 0 <= self.furniture <= 3:
            raise SimulationError(f"furniture is a density from 0 to 3, not {self.furniture:g}")


DEFAULTS = Settings()


def generate(settings: Settings = DEFAULTS, seed: int = 0) -> Environment:
    """Draw a random environment; the same settings and seed give the same one.

    Raises
    ------
    SimulationError
        So many such rooms do not fit on the ground, or the seed is negative.
    """
    if seed < 0:
        raise SimulationError(f"a seed is 0 or more, not {seed}")
    rng = np.random.default_rng((seed, 0))
    for _ in range(_PLANS):
        plan = _drawn_rooms(settings, rng)
        if plan is not None:
            fields = _with_doors(plan, settings.extra_doors, rng)
            bare = Environment(fields, wall=settings.wall, door=settings.door)
            return furnish(bare, seed, settings.furniture)
    wanted = settings.configuration.rooms
    raise SimulationError(
        f"{wanted} rooms of these types do not fit on {settings.width} x {settings.height} m; "
        "take fewer or smaller rooms, or a larger ground"
    )


# ---------------------------------------------------------------------- walls
@dataclass(frozen=True, slots=True, eq=False)
class _Plan:
    """Walls as edges between the middles of neighbouring fields.

    Attributes
    ----------
    across
        (rows, cols - 1): from a field to the one right of it.
    along
        (rows - 1, cols): from a field to the one above it.
    shafts
        (rows - 1, cols - 1): squares between four fields where a room of 2 fields made it narrow.
    """

    across: NDArray[np.bool_]
    along: NDArray[np.bool_]
    shafts: NDArray[np.bool_]

    def with_room(self, x: int, y: int, width: int, height: int) -> _Plan:
        """Lay a room over what is there."""
        across, along, shafts = self.across.copy(), self.along.copy(), self.shafts.copy()
        right, top = x + width - 1, y + height - 1
        across[y + 1 : top, x:right] = False
        along[y:top, x + 1 : right] = False
        across[[y, top], x:right] = True
        along[y:top, [x, right]] = True
        shafts[y:top, x:right] = min(width, height) == 2
        return _Plan(across, along, shafts)

    def has_slit(self) -> bool:
        """Whether two walls run 1 m apart with nothing of use between them."""
        narrow = (self.along[:, :-1] & self.along[:, 1:]) | (self.across[:-1] & self.across[1:])
        return bool((narrow & ~self.shafts).any())

    def rooms(self) -> Rooms:
        return rooms_between(self.across, self.along)

    def arms(self) -> NDArray[np.uint8]:
        arms = np.zeros((self.across.shape[0], self.along.shape[1]), np.uint8)
        arms[:, :-1] |= self.across * np.uint8(RIGHT)
        arms[:, 1:] |= self.across * np.uint8(LEFT)
        arms[:-1] |= self.along * np.uint8(UP)
        arms[1:] |= self.along * np.uint8(DOWN)
        return arms


def _drawn_rooms(settings: Settings, rng: np.random.Generator) -> _Plan | None:
    """Return a plan with all rooms in it, each of which can have a door; None if it got too full."""
    rows, cols = settings.height, settings.width
    empty = _Plan(
        np.zeros((rows, cols - 1), np.bool_),
        np.zeros((rows - 1, cols), np.bool_),
        np.zeros((rows - 1, cols - 1), np.bool_),
    )
    plan = empty.with_room(0, 0, cols, rows)
    types = [t for t in settings.configuration.room_types if t[0] <= cols and t[1] <= rows]
    count = 1
    for _ in range(settings.configuration.rooms):
        for _ in range(_TRIES if types else 0):
            width, height = types[rng.integers(len(types))]
            x, y = rng.integers(cols - width + 1), rng.integers(rows - height + 1)
            tried = plan.with_room(int(x), int(y), width, height)
            if tried.has_slit():
                continue
            rooms = tried.rooms()
            # A room may cover parts of others, but at the end there must be one more.
            if rooms.max() > count and len(_tree(_places(tried, rooms), rng)) == rooms.max() - 1:
                plan, count = tried, int(rooms.max())
                break
        else:
            return None
    return plan


# ---------------------------------------------------------------------- doors
def _places(plan: _Plan, rooms: Rooms) -> dict[Pair, list[Place]]:
    """Return where a door could join two rooms: straight walls, by pair of rooms."""
    arms = plan.arms()
    places: dict[Pair, list[Place]] = {}
    for row, col in zip(*np.nonzero((arms == (LEFT | RIGHT)) | (arms == (UP | DOWN))), strict=True):
        first, other = sorted(sides_of_door(rooms, row, col, int(arms[row, col])))
        if first and first != other:
            places.setdefault((first, other), []).append((int(row), int(col)))
    return places


def _tree(places: Mapping[Pair, list[Place]], rng: np.random.Generator) -> list[Pair]:
    """Return pairs of rooms whose doors join as many rooms as possible without a ring (Kruskal 1956)."""
    pairs = list(places)
    root: dict[int, int] = {}

    def rooted(room: int) -> int:
        while room in root:
            room = root[room]
        return room

    tree = []
    for index in rng.permutation(len(pairs)):
        a, b = map(rooted, pairs[index])
        if a != b:
            root[a] = b
            tree.append(pairs[index])
    return tree


def _with_doors(plan: _Plan, extra: float, rng: np.random.Generator) -> Fields:
    places = _places(plan, plan.rooms())
    tree = _tree(places, rng)
    fields = codes_of(plan.arms())
    for pair, possible in places.items():
        if pair in tree or rng.random() < extra:
            fields[possible[rng.integers(len(possible))]] = DOOR
    return fields
