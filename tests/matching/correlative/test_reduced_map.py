import math

import numpy as np
import pytest
from drawing import built, drawn, office, school, seen_from
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from ready import reduced

from mapmeld.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mapmeld.matching.correlative.reduced_map import places, pooled, shares
from mapmeld.se2 import Pose2


@pytest.mark.parametrize(
    ("resolution", "cell"), [(0.02, 0.2), (0.05, 0.2), (0.07, 0.21), (0.1, 0.2), (0.2, 0.2), (0.5, 0.5)]
)
def test_cells_are_a_whole_multiple_of_the_maps_own(resolution: float, cell: float) -> None:
    m = reduced(built(10, 5, [(1, 1, 9, 2)], resolution))
    assert m.cell == pytest.approx(cell)


def test_any_obstacle_makes_a_wall_and_most_of_it_known_a_floor() -> None:
    cells = np.full((20, 20), UNKNOWN, np.int8)
    cells[0:4, 0:4] = FREE
    cells[4, 4] = OCCUPIED  # one of sixteen
    cells[8:12, 8:10] = FREE  # half of the cell
    cells[12:16, 12] = FREE  # a quarter
    cells[19, 19] = OCCUPIED
    m = reduced(OccupancyGrid(cells, 0.05))
    margin = (len(m.wall) - 5) // 2
    inside = np.s_[margin : margin + 5, margin : margin + 5]
    assert (m.wall[inside] > 0).tolist() == [
        [False] * 5,
        [False, True, False, False, False],
        [False] * 5,
        [False] * 5,
        [False] * 4 + [True],
    ]
    assert [int(m.floor[inside][k, k]) for k in range(5)] == [255, 0, 128, 64, 0]
    assert [bool(m.known[inside][k, k]) for k in range(5)] == [True, True, True, False, True]
    assert m.area == pytest.approx(4 * 0.04)
    for raster in (m.wall, m.floor, m.known):
        assert np.count_nonzero(raster) == np.count_nonzero(raster[inside])


@pytest.mark.parametrize("turn", [0.0, 0.5, 2.0])
def test_points_are_the_walls_in_metres(turn: float) -> None:
    T = Pose2(30, -7, turn)
    m = reduced(office().moved(T))
    walls = m.T_map_mid.apply(m.points)
    grid = office().moved(T)
    expected = grid.centres(grid.occupied)
    gap = np.hypot(*(walls[:, None] - expected[None]).transpose(2, 0, 1)).min(axis=1)
    assert gap.max() < 0.25
    assert len(m.points) == np.count_nonzero(m.wall)


def test_the_mid_frame_has_its_zero_in_the_middle_of_the_walls_box() -> None:
    place = school()
    for degrees in (0, 30, 120):
        T = Pose2(5, 5, math.radians(degrees))
        m = reduced(seen_from(place, T))
        middle = m.T_map_mid.apply((0, 0))
        np.testing.assert_allclose(middle, T.apply((10, 4.5)), atol=0.25)
        # The rasters' own account of that place.
        rows, cols = m.wall.shape
        assert 0 < m.middle[0] < cols
        assert 0 < m.middle[1] < rows
        at = np.argwhere(m.wall)[:, ::-1] + 0.5 - np.array(m.middle)
        np.testing.assert_allclose(np.sort(at * m.cell, axis=0), np.sort(m.points, axis=0), atol=1e-3)


def test_unknown_borders_and_far_frames_change_nothing() -> None:
    one, other = reduced(office()), reduced(office().extended(7, 3, 1, 13))
    for name in ("wall", "floor", "known", "spectrum", "points"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert one.T_map_mid.distance_to(other.T_map_mid) == pytest.approx((0, 0), abs=1e-9)
    far = reduced(office().moved(Pose2(1e5, 1e5, 1)))
    np.testing.assert_array_equal(one.points, far.points)


@pytest.mark.parametrize("k", [1, 2, 3, 16, 20])
def test_blocks_are_averaged_and_the_last_filled_up_with_nothing(k: int) -> None:
    image = np.zeros((7, 25), np.uint8)
    image[6, 24] = 255
    small = pooled(image, k)
    assert small.shape == (-(-7 // k), -(-25 // k))
    assert np.count_nonzero(small) == 1  # however large the blocks
    assert small[-1, -1] == pytest.approx(255 / k**2, abs=1)
    ones = pooled(np.full((2 * k, 3 * k), 255, np.uint8), k)
    assert (ones == 255).all()


@pytest.mark.parametrize("k", [1, 2, 3, 4, 5, 8, 10, 16, 20])
@pytest.mark.parametrize("shape", [(1, 1), (40, 80), (163, 77)])
def test_shares_of_a_mask_are_its_averages_to_the_last_bit(k: int, shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(k)
    # From few cells in a block on the left to nearly all on the right, and some blocks half full.
    mask = np.where(rng.random(shape) < np.linspace(0, 1, shape[1]), 255, 0).astype(np.uint8)
    mask[: shape[0] // 2] = np.where(np.arange(shape[1]) // max(k // 2, 1) % 2, 255, 0)
    np.testing.assert_array_equal(shares(mask, k), pooled(mask, k))


@given(
    arrays(np.uint8, array_shapes(min_dims=2, max_dims=2, max_side=20), elements=st.sampled_from([0, 255]))
)
def test_places_are_where_a_mask_holds(mask: np.ndarray) -> None:
    for found, expected in zip(places(mask), np.nonzero(mask), strict=True):
        np.testing.assert_array_equal(found, expected)


def test_a_single_obstacle_is_enough() -> None:
    m = reduced(drawn("#", 0.05))
    assert len(m.points) == 1
    np.testing.assert_allclose(m.points, 0, atol=1e-6)
    assert math.isfinite(m.main_direction)
