import math

import numpy as np
import pytest
from drawing import picture_of
from hypothesis import given
from hypothesis import strategies as st
from small import fields, hall, two_rooms

from mapmeld.grid import UNKNOWN
from mapmeld.simulation import Box, Environment, Furniture, Kind, SimulationError, true_map
from mapmeld.simulation.true_map import cover, outside


def test_the_true_map_of_two_rooms() -> None:
    grid = true_map(Environment(two_rooms().fields, wall=0.5, door=1.0), 0.5)
    # Walls of 0.5 m run through the middles of fields of 1 m: each shares two rows of cells.
    assert picture_of(grid).splitlines() == [
        "##################",
        "##################",
        "##......##......##",
        "##......##......##",
        "##..............##",
        "##..............##",
        "##......##......##",
        "##......##......##",
        "##################",
        "##################",
    ]


def test_finer_walls_lie_in_the_middle_of_their_fields() -> None:
    grid = true_map(two_rooms(), 0.05)
    assert grid.shape == (100, 180)
    assert np.flatnonzero(grid.occupied[50]).tolist() == [9, 10, 169, 170]  # through the door
    assert np.flatnonzero(grid.occupied[30]).tolist() == [9, 10, 89, 90, 169, 170]
    assert (grid.cells[:9] == UNKNOWN).all()
    assert (grid.cells[11:89, 11:89] == 0).all()


def test_legs_are_in_it_and_the_floor_under_a_table_is_floor() -> None:
    table = Furniture(Kind.TABLE, Box(3, 3, 1.0, 0.6, 0.3))
    grid = true_map(Environment(hall().fields, (table,)), 0.05)
    assert grid.cells[60, 60] == 0
    assert 4 <= np.count_nonzero(grid.occupied[40:80, 40:80]) <= 36


def test_a_door_to_the_outside_counts_as_closed_for_what_is_outside() -> None:
    plan = fields("8:1:-1:1:7\n0:-2:-2:-2:0\n0:-2:-2:-2:0\n9:1:1:1:6")
    grid = true_map(Environment(plan), 0.1)
    assert grid.cells[20, 20] == 0
    assert grid.cells[38, 25] == UNKNOWN


def test_walls_that_enclose_nothing_have_all_outside() -> None:
    plan = fields("-2:-2:-2\n-2:1:-2\n-2:-2:-2")
    assert outside(Environment(plan), 0.1).sum() == 900 - 10 * 2


@given(
    st.floats(0.2, 1.8),
    st.floats(0.2, 1.8),
    st.floats(0.05, 0.8),
    st.floats(0.05, 0.8),
    st.floats(-4, 4),
)
def test_a_cell_is_covered_exactly_if_it_shares_area(
    x: float, y: float, length: float, width: float, theta: float
) -> None:
    box = Box(x, y, length, width, theta)
    mask = np.zeros((20, 20), np.bool_)
    cover(mask, [box], 0.1)
    # Points of the box, dense enough to have one in all cells but those that share a sliver.
    u, v = np.meshgrid(np.linspace(-0.5, 0.5, 60), np.linspace(-0.5, 0.5, 60))
    points = box.pose.apply(np.stack([u * length, v * width], axis=-1).reshape(-1, 2)) * (1 - 1e-9)
    inside = points[((points > 0) & (points < 2)).all(axis=1)]
    col, row = np.floor(inside / 0.1 + 1e-7).astype(int).clip(0, 19).T
    near = np.abs(inside / 0.1 - np.rint(inside / 0.1)).min(axis=1) > 1e-3
    assert mask[row[near], col[near]].all()
    # And none whose corners and centre are all clearly outside of the grown box.
    rows, cols = np.nonzero(mask)
    centres = box.pose.inverse().apply((np.stack([cols, rows], axis=-1) + 0.5) * 0.1)
    assert (np.abs(centres) <= np.array([length, width]) / 2 + 0.1 * math.sqrt(0.5) + 1e-9).all()


@pytest.mark.parametrize("resolution", [0.0, -1.0, math.nan, math.inf, 2.0, 1e-6])
def test_resolutions_that_cannot_be(resolution: float) -> None:
    with pytest.raises(SimulationError, match=r"cells of"):
        true_map(hall(), resolution)
