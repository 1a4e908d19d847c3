import math

import numpy as np
import pytest
from drawing import drawn, office

from mapmeld.grid import OccupancyGrid
from mapmeld.matching.correlative.masks import map_masks
from mapmeld.se2 import Pose2


def test_a_map_is_cut_to_what_is_known() -> None:
    masks = map_masks(drawn("      \n  .#. \n   .  \n      ", 0.5, Pose2(1, 2, math.pi / 2)))
    assert masks is not None
    assert (masks.wall / 255).tolist() == [[0, 0, 0], [0, 1, 0]]
    assert (masks.floor / 255).tolist() == [[0, 1, 0], [1, 0, 1]]
    assert (masks.known / 255).tolist() == [[0, 1, 0], [1, 1, 1]]
    assert masks.resolution == 0.5
    # The cut starts at column 2 and row 1: a metre along and half a metre across, in a turned lattice.
    assert masks.origin.distance_to(Pose2(1 - 0.5, 2 + 1, math.pi / 2)) == pytest.approx((0, 0), abs=1e-12)


def test_thresholds_are_those_of_the_grid() -> None:
    cells = np.array([[-1, 0, 25, 26, 64, 65, 100]], np.int8)
    grid = OccupancyGrid(cells, 1.0)
    masks = map_masks(grid)
    assert masks is not None
    for mask, expected in ((masks.wall, grid.occupied), (masks.floor, grid.free), (masks.known, grid.known)):
        assert mask.dtype == np.uint8
        np.testing.assert_array_equal(mask, np.where(expected, 255, 0)[:, 1:])


@pytest.mark.parametrize("picture", ["", " ", ".", "  \n  ", ". .\n. ."])
def test_there_are_none_without_an_obstacle(picture: str) -> None:
    grid = drawn(picture) if picture else OccupancyGrid(np.zeros((0, 0), np.int8), 1.0)
    assert map_masks(grid) is None


@pytest.mark.parametrize("borders", [(0, 0, 0, 1), (3, 0, 0, 0), (5, 4, 3, 2)])
def test_unknown_borders_leave_no_trace(borders: tuple[int, int, int, int]) -> None:
    one, other = map_masks(office()), map_masks(office().extended(*borders))
    assert one is not None
    assert other is not None
    assert one.origin.distance_to(other.origin) == pytest.approx((0, 0), abs=1e-12)
    for name in ("wall", "floor", "known"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
