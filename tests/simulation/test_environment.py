import math

import numpy as np
import pytest
from small import fields, hall, two_rooms

from mapmeld.simulation import Box, Environment, Furniture, Kind, SimulationError


def test_walls_are_few_long_boxes() -> None:
    environment = two_rooms()
    walls = environment.walls()
    assert len(walls) == 6  # four outer ones, and one on each side of the door
    bottom = next(w for w in walls if w.y == 0.5 and w.length > w.width)
    assert (bottom.x, bottom.width) == (4.5, 0.1)
    assert bottom.length == pytest.approx(8.1)
    below = next(w for w in walls if w.x == 4.5 and w.y < 2.5 and w.width > w.length)
    # From half a thickness below the outer wall's middle to the door's jamb.
    assert below.y - below.width / 2 == pytest.approx(0.45)
    assert below.y + below.width / 2 == pytest.approx(2.05)


def test_closed_doors_make_whole_walls() -> None:
    assert len(two_rooms().walls(open_doors=False)) == 5
    (door,) = two_rooms().doors()
    assert (door.x, door.y, door.length) == (4.5, 2.5, 0.9)
    assert math.sin(door.theta) == 1


def test_a_door_as_wide_as_its_field_has_no_jambs() -> None:
    wide = Environment(two_rooms().fields, door=1.0)
    assert sorted(w.y + w.width / 2 for w in wide.walls() if w.x == 4.5 and w.width > 0.2)[0] == 2.0


def test_furniture_stands_on_its_legs() -> None:
    table = Furniture(Kind.TABLE, Box(2, 3, 1.2, 0.8, math.pi / 2))
    legs = table.solids()
    assert len(legs) == 4
    assert {(round(leg.x, 3), round(leg.y, 3)) for leg in legs} == {
        (2 + i * 0.375, 3 + j * 0.575) for i in (-1, 1) for j in (-1, 1)
    }
    cabinet = Furniture(Kind.CABINET, Box(1, 1, 1, 0.5))
    assert cabinet.solids() == (cabinet.footprint,)


def test_what_robots_avoid_is_more_than_what_lasers_see() -> None:
    table = Furniture(Kind.TABLE, Box(2, 3, 1.2, 0.8))
    environment = Environment(hall().fields, (table,))
    assert environment.footprints()[-1] == table.footprint
    assert environment.solids()[-4:] == table.solids()


def test_equal_and_unchangeable() -> None:
    assert hall() == hall()
    assert hall() != two_rooms()
    assert hall() != Environment(hall().fields, wall=0.2)
    assert hall() != "hall"
    with pytest.raises(ValueError, match="read-only"):
        hall().fields[0, 0] = 1


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"fields": np.zeros((2, 9), np.int8)}, "3 to 200"),
        ({"fields": np.zeros(9, np.int8)}, "3 to 200"),
        ({"fields": np.full((3, 3), 11, np.int8)}, "-2 to 10"),
        ({"fields": fields("-2:-2:-2\n-2:-1:-2\n-2:-2:-2")}, "in no wall"),
        ({"wall": 0.0}, "not 0$"),
        ({"wall": math.nan}, "thick"),
        ({"door": 1.5}, "1.5"),
    ],
)
def test_what_cannot_be(change: dict[str, object], said: str) -> None:
    with pytest.raises(SimulationError, match=said):
        Environment(**({"fields": hall().fields} | change))  # type: ignore[arg-type]
