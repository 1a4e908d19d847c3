import math

import numpy as np
import pytest
from drawing import drawn

from mapmeld.simulation.planning import Planner, discs

PLAN = """
####################
#........#.........#
#........#.........#
#..................#
#........#.........#
#........#.........#
####################
"""


def planner(picture: str = PLAN, radius: float = 0.3, spacing: float = 0.5) -> Planner:
    grid = drawn(picture, 0.5)
    return Planner(grid, grid.occupied, radius, spacing=spacing)


def test_a_way_goes_through_the_door_and_keeps_clear() -> None:
    path = planner().path((1.2, 1.1), (8.6, 2.6))
    assert path is not None
    assert path[0] == pytest.approx((1.25, 1.25))  # the middle of the cell nearest to the start
    assert path[-1] == pytest.approx((8.75, 2.75))
    grid = drawn(PLAN, 0.5)
    col, row = np.floor(grid.metres_to_lattice(path)).astype(int).T
    assert not grid.occupied[row, col].any()
    assert ((col == 9) & (row == 3)).any()
    steps = np.hypot(*np.diff(path, axis=0).T)
    assert steps.max() <= 0.5 * math.sqrt(2) + 1e-9


def test_a_robot_too_wide_for_the_door_has_no_way() -> None:
    wide = planner(radius=0.6)
    assert wide.any_floor
    assert wide.path((1.5, 1.5), (8.0, 1.5)) is None
    costs = wide.costs((1.5, 1.5), [(2.0, 2.0), (8.0, 1.5)])
    assert math.isfinite(costs[0])
    assert math.isinf(costs[1])


def test_the_main_floor_is_the_larger_part() -> None:
    places = planner(radius=0.6).main_floor()
    assert (places[:, 0] > 4.5).all()
    assert len(planner().main_floor()) == len(planner().nodes())


def test_ways_keep_to_the_middle_where_they_can() -> None:
    path = planner("#" * 40 + "\n" + ("#" + "." * 38 + "#\n") * 9 + "#" * 40, spacing=0.5).path(
        (1.0, 2.5), (18.0, 2.5)
    )
    assert path is not None
    assert np.abs(path[4:-4, 1] - 2.75).max() < 1.0


def test_starts_in_a_wall_begin_at_the_nearest_floor() -> None:
    path = planner().path((0.0, 0.0), (2.0, 2.0))
    assert path is not None
    assert path[0] == pytest.approx((0.75, 0.75))


def test_no_floor_no_way() -> None:
    nothing = planner("###\n###")
    assert not nothing.any_floor
    assert nothing.path((0, 0), (1, 1)) is None


def test_only_passable_cells_are_driven_on() -> None:
    grid = drawn(PLAN, 0.5)
    passable = np.ones(grid.shape, np.bool_)
    passable[:, 9] = False
    assert Planner(grid, grid.occupied, 0.3, passable, spacing=0.5).path((1, 1), (8, 2)) is None


def test_discs() -> None:
    mask = discs(drawn(PLAN, 0.5), [(5.0, 1.75), (-50.0, 0.0)], 1.0)
    assert mask[3, 10]
    assert mask[3, 8:13].all()
    assert not mask[3, 13]
    assert mask.sum() < 16
