import numpy as np
import pytest
from small import HALL, TWO_ROOMS, fields

from mapmeld.simulation.fields import (
    ARMS,
    DOWN,
    LEFT,
    RIGHT,
    UP,
    StrayDoorError,
    arms_of,
    codes_of,
    rooms_of,
    sides_of_door,
)


def test_codes_stand_for_arms_and_back() -> None:
    codes = np.arange(11, dtype=np.int8).reshape(1, -1)
    assert arms_of(codes).ravel().tolist() == list(ARMS)
    assert np.array_equal(codes_of(arms_of(codes)), codes)


def test_a_piece_with_one_arm_has_no_code() -> None:
    with pytest.raises(ValueError, match="ends in the middle"):
        codes_of(np.array([[UP]], np.uint8))


def test_the_codes_of_the_small_plan_are_those_of_its_neighbours() -> None:
    arms = arms_of(fields(TWO_ROOMS))
    assert arms[0, 0] == UP | RIGHT
    assert arms[4, 4] == LEFT | RIGHT | DOWN
    assert arms[2, 4] == UP | DOWN  # the door, from the wall it is in


def test_rooms_are_parted_by_walls_and_closed_doors() -> None:
    rooms = rooms_of(fields(TWO_ROOMS))
    assert rooms.shape == (4, 8)
    assert (rooms[:, :4] == 1).all()
    assert (rooms[:, 4:] == 2).all()
    assert (rooms_of(fields(HALL)) == 1).all()
    assert sides_of_door(rooms, 2, 4, UP | DOWN) == (1, 2)
    assert sides_of_door(rooms, 0, 2, LEFT | RIGHT) == (0, 1)
    assert sides_of_door(rooms, 2, 8, UP | DOWN) == (2, 0)


def test_parallel_walls_in_neighbouring_fields_stay_apart() -> None:
    plan = fields("8:7:8:7\n0:0:0:0\n9:6:9:6")
    rooms = rooms_of(plan)
    assert rooms[0].tolist() == rooms[1].tolist()
    assert len(set(rooms[0].tolist())) == 3


def test_a_door_takes_its_direction_from_its_neighbours() -> None:
    plan = fields("8:-1:7\n-1:-2:0\n9:1:6")
    arms = arms_of(plan)
    assert arms[2, 1] == LEFT | RIGHT
    assert arms[1, 0] == UP | DOWN


def test_a_door_in_no_wall() -> None:
    with pytest.raises(StrayDoorError) as caught:
        arms_of(fields("8:1:1:7\n0:-2:-2:0\n0:-1:-2:0\n0:-2:-2:0\n9:1:1:6"))
    assert (caught.value.row, caught.value.col) == (2, 1)
