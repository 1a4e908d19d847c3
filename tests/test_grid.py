import math

import numpy as np
import pytest
from drawing import drawn, office, picture_of, seen_from
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

import mapmeld
from mapmeld.grid import OccupancyGrid, ResolutionError, at_resolution, overlap_share, resample
from mapmeld.se2 import Pose2

poses = st.from_type(Pose2)
resolutions = st.sampled_from([0.02, 0.05, 0.1, 1.0])
small_cells = arrays(np.int8, st.tuples(st.integers(1, 8), st.integers(1, 8)), elements=st.integers(-1, 100))
grids = st.builds(OccupancyGrid, small_cells, resolutions, poses)

L_SHAPE = """
#..
#..
###
"""


# ------------------------------------------------------------------ what a grid is
def test_row_0_is_the_bottom_row() -> None:
    grid = drawn(L_SHAPE)
    assert grid.cells[0].tolist() == [100, 100, 100]
    assert grid.cells[2].tolist() == [100, 0, 0]


@pytest.mark.parametrize(
    "cells",
    [np.zeros(3, np.int8), np.zeros((2, 2)), np.full((2, 2), 101, np.int16), np.full((2, 2), -2, np.int8)],
)
def test_cells_that_are_no_occupancy_are_refused(cells: np.ndarray) -> None:
    with pytest.raises(ValueError, match="cells"):
        OccupancyGrid(cells, 0.05)


@pytest.mark.parametrize("resolution", [0.0, -0.05, math.nan, math.inf])
def test_a_resolution_must_be_a_length(resolution: float) -> None:
    with pytest.raises(ValueError, match="resolution"):
        OccupancyGrid(np.zeros((1, 1), np.int8), resolution)


def test_an_origin_must_be_finite() -> None:
    with pytest.raises(ValueError, match="origin"):
        OccupancyGrid(np.zeros((1, 1), np.int8), 1.0, Pose2(math.nan))


def test_a_grid_does_not_change_with_the_array_that_it_was_made_from() -> None:
    cells = np.zeros((2, 2), np.int8)
    grid = OccupancyGrid(cells, 1.0)
    cells[0, 0] = 100
    assert grid.cells[0, 0] == 0
    with pytest.raises(ValueError, match="read-only"):
        grid.cells[0, 0] = 100


def test_a_read_only_view_of_a_writable_array_is_copied() -> None:
    cells = np.zeros((2, 2), np.int8)
    view = cells[:]
    view.flags.writeable = False
    grid = OccupancyGrid(view, 1.0)
    cells[0, 0] = 100
    assert grid.cells[0, 0] == 0
    # What nobody can write is shared: moving a map copies no cells.
    assert np.shares_memory(grid.moved(Pose2(1)).cells, grid.cells)


def test_a_writable_view_of_a_read_only_array_does_not_reach_a_grid() -> None:
    cells = np.zeros((2, 3), np.int8)
    view = cells[:]
    cells.flags.writeable = False
    grid = OccupancyGrid(cells, 1.0)
    view[0, 0] = 100
    assert not grid.occupied.any()
    assert not grid.cells.flags.writeable


def test_percentages_between_the_thresholds_are_known_but_neither_wall_nor_floor() -> None:
    grid = OccupancyGrid(np.array([[-1, 0, 25, 26, 64, 65, 100]], np.int8), 1.0)
    assert grid.known.tolist() == [[False, True, True, True, True, True, True]]
    assert grid.free.tolist() == [[False, True, True, False, False, False, False]]
    assert grid.occupied.tolist() == [[False, False, False, False, False, True, True]]


def test_equality_looks_at_cells_and_place() -> None:
    assert drawn(L_SHAPE) == drawn(L_SHAPE)
    assert drawn(L_SHAPE) != drawn(L_SHAPE, resolution=2.0)
    assert drawn(L_SHAPE) != drawn(L_SHAPE, origin=Pose2(1.0))
    assert drawn(L_SHAPE) != drawn("###\n#..\n#..")


# ------------------------------------------------------------------ cells <-> metres
def test_the_centre_of_the_first_cell_is_half_a_cell_from_the_origin() -> None:
    grid = drawn(L_SHAPE, resolution=0.5, origin=Pose2(10, 20, math.pi / 2))
    first = np.zeros(grid.shape, bool)
    first[0, 0] = True
    np.testing.assert_allclose(grid.centres(first), [(9.75, 20.25)])
    first[0, 1] = True  # the next column lies up the y axis: the lattice is turned
    np.testing.assert_allclose(grid.centres(first)[1], (9.75, 20.75))


@given(grids, st.tuples(st.floats(-20, 20), st.floats(-20, 20)))
def test_lattice_and_metres_are_inverse(grid: OccupancyGrid, lattice: tuple[float, float]) -> None:
    back = grid.metres_to_lattice(grid.lattice_to_metres(lattice))
    np.testing.assert_allclose(back, lattice, atol=1e-6)


@given(grids, poses)
def test_moving_a_map_moves_its_points(grid: OccupancyGrid, T: Pose2) -> None:
    everything = np.ones(grid.shape, bool)
    np.testing.assert_allclose(
        grid.moved(T).centres(everything), T.apply(grid.centres(everything)), atol=1e-6
    )


# ------------------------------------------------------------------ crop and extend
@given(grids, *[st.integers(0, 4)] * 4)
def test_added_border_is_unknown_and_moves_nothing(
    grid: OccupancyGrid, left: int, bottom: int, right: int, top: int
) -> None:
    bigger = grid.extended(left, bottom, right, top)
    assert bigger.shape == (grid.shape[0] + bottom + top, grid.shape[1] + left + right)
    assert bigger.known_area == grid.known_area
    np.testing.assert_allclose(bigger.centres(bigger.known), grid.centres(grid.known), atol=1e-6)
    back = bigger.extended(-left, -bottom, -right, -top)
    np.testing.assert_array_equal(back.cells, grid.cells)


@given(st.integers(-2000, 2000), st.integers(0, 2000))
def test_a_border_leaves_no_rounding_errors_in_the_origin(cells: int, added: int) -> None:
    grid = OccupancyGrid(np.zeros((1, 1), np.int8), 0.05, Pose2(cells / 20, 0.1, 0.0))
    assert grid.extended(added, 0, 0, 0).origin == Pose2((cells - added) / 20, 0.1, 0.0)


def test_a_border_keeps_what_is_no_rounding_error() -> None:
    origin = Pose2(1 / 3, 2e-10, 0.0)
    assert OccupancyGrid(np.zeros((1, 1), np.int8), 0.05, origin).extended(0, 0, 1, 1).origin == origin


@given(grids, st.integers(0, 3))
def test_cropping_keeps_what_is_known_where_it_is(grid: OccupancyGrid, margin: int) -> None:
    cropped = grid.cropped(margin)
    np.testing.assert_allclose(cropped.centres(cropped.known), grid.centres(grid.known), atol=1e-6)
    np.testing.assert_array_equal(cropped.cells[cropped.known], grid.cells[grid.known])
    if margin == 0 and grid.known.any():
        border = (cropped.known[0], cropped.known[-1], cropped.known[:, 0], cropped.known[:, -1])
        assert all(side.any() for side in border)


def test_cropping_an_unknown_map_returns_it() -> None:
    grid = drawn("   \n   ")
    assert grid.cropped() == grid


# ------------------------------------------------------------------ resampling
@given(grids)
def test_a_map_sampled_on_its_own_lattice_is_itself(grid: OccupancyGrid) -> None:
    np.testing.assert_array_equal(resample(grid, Pose2(), grid), grid.cells)


@given(grids, poses)
def test_a_map_moved_with_its_target_is_itself(grid: OccupancyGrid, T: Pose2) -> None:
    np.testing.assert_array_equal(resample(grid, T, grid.moved(T)), grid.cells)


@pytest.mark.parametrize("quarter_turns", [1, 2, 3])
def test_quarter_turns_move_every_cell_exactly(quarter_turns: int) -> None:
    grid = drawn("#..\n#. ")
    turned = seen_from(grid, Pose2(0, 0, quarter_turns * math.pi / 2)).cropped()
    np.testing.assert_array_equal(turned.cells, np.rot90(grid.cells[::-1], quarter_turns)[::-1])


def test_what_the_map_does_not_reach_is_unknown() -> None:
    target = drawn("...\n...\n...")
    shifted = OccupancyGrid(resample(drawn("#"), Pose2(1, 2), target), 1.0)
    assert picture_of(shifted) == " # \n   \n   "


@given(st.floats(-math.pi, math.pi), st.floats(0, 1), st.floats(0, 1))
def test_a_turned_floor_has_no_holes_and_no_doubled_walls(theta: float, x: float, y: float) -> None:
    room = drawn("\n".join(["#" * 40] * 3 + ["#" * 3 + "." * 34 + "#" * 3] * 34 + ["#" * 40] * 3))
    turned = seen_from(room, Pose2(x, y, theta))
    # Each cell answers for what lies under its centre, so areas stay as they were:
    assert np.count_nonzero(turned.known) == pytest.approx(40 * 40, rel=0.03)
    assert np.count_nonzero(turned.occupied) == pytest.approx(40 * 40 - 34 * 34, rel=0.06)
    # and a cell is a wall exactly where its own centre lies in the wall.
    where = Pose2(x, y, theta).inverse().apply(turned.centres(np.ones(turned.shape, bool)))
    inside = ((where > 0) & (where < 40)).all(axis=-1)
    floor = ((where > 3) & (where < 37)).all(axis=-1)
    np.testing.assert_array_equal(turned.known.ravel(), inside)
    np.testing.assert_array_equal(turned.free.ravel(), floor)


def test_coarser_cells_keep_thin_walls() -> None:
    wall = np.zeros((40, 40), np.int8)
    wall[:, 17] = 100
    coarse = at_resolution(OccupancyGrid(wall, 0.05), 0.2)
    assert coarse.shape == (10, 10)
    assert coarse.occupied[:, 4].all()
    assert np.count_nonzero(coarse.occupied) == 10


@pytest.mark.parametrize("resolution", [0.06, 0.07, 0.074, 0.11, 0.12])
def test_no_thin_wall_slips_between_coarser_cells(resolution: float) -> None:
    # Less than half a cell more than a whole ratio: asking at that many places would not be enough.
    for col in range(30):
        wall = np.zeros((30, 30), np.int8)
        wall[:, col] = 100
        coarse = at_resolution(OccupancyGrid(wall, 0.05), resolution)
        assert coarse.occupied.any(axis=1).all(), col


@pytest.mark.parametrize("keep", ["walls", "mean"])
@pytest.mark.parametrize("block", [1, 20, 45, 100])
def test_blocks_of_rows_do_not_change_the_sample(
    keep: str, block: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(5)
    grid = OccupancyGrid(rng.integers(-1, 101, (60, 60)).astype(np.int8), 0.5, Pose2(-10, -18, 0.3))
    target = OccupancyGrid(np.zeros((23, 20), np.int8), 0.8, Pose2(-6, -7))
    whole = resample(grid, Pose2(0.4, 0.2, 0.7), target, keep=keep)
    assert (whole[-1] >= 0).any()  # there is something to get wrong in the last rows
    monkeypatch.setattr("mapmeld.grid._BLOCK_CELLS", block)
    np.testing.assert_array_equal(resample(grid, Pose2(0.4, 0.2, 0.7), target, keep=keep), whole)


@pytest.mark.parametrize(("fine", "coarse"), [(0.05, 5.001), (0.01, 1.5)])
def test_cell_sizes_a_hundred_times_apart_are_a_mistake(fine: float, coarse: float) -> None:
    a, b = drawn("#.", resolution=fine), drawn("#.", resolution=coarse)
    for one, other in ((a, b), (b, a)):
        for mistaken in (
            lambda one=one, other=other: resample(one, Pose2(), other),
            lambda one=one, other=other: mapmeld.match(one, other, method="alphabet"),
        ):
            with pytest.raises(ResolutionError, match="check the resolutions") as refused:
                mistaken()
            assert f"{fine:g} m" in str(refused.value)
            assert f"{coarse:g} m" in str(refused.value)
            assert "\n" not in str(refused.value)


def test_cell_sizes_just_a_hundred_times_apart_are_laid_over_one_another() -> None:
    a, b = drawn("#.", resolution=0.05), drawn("#.", resolution=5.0)
    assert resample(a, Pose2(), b).tolist() == [[100, -1]]
    assert resample(b, Pose2(), a).tolist() == [[100, 100]]


def test_coarser_cells_may_take_the_mean() -> None:
    fine = OccupancyGrid(np.array([[0, 100], [-1, 50]], np.int8), 1.0)
    target = OccupancyGrid(np.zeros((1, 1), np.int8), 2.0)
    assert resample(fine, Pose2(), target, keep="mean").tolist() == [[50]]
    with pytest.raises(ValueError, match="keep"):
        resample(fine, Pose2(), target, keep="some")


def test_finer_cells_repeat() -> None:
    assert picture_of(at_resolution(drawn("#.", resolution=1.0), 0.5)) == "##..\n##.."


# ------------------------------------------------------------------ overlap
def test_overlap_is_the_share_of_the_smaller_map() -> None:
    a, b = drawn("." * 10), drawn("." * 4)
    assert overlap_share(a, b, Pose2()) == 1.0
    assert overlap_share(a, b, Pose2(8, 0)) == 0.5
    assert overlap_share(b, a, Pose2(8, 0).inverse()) == 0.5
    assert overlap_share(a, b, Pose2(0, 5)) == 0.0
    assert overlap_share(a, drawn("  "), Pose2()) == 0.0


def test_overlap_looks_at_the_middles_of_cells() -> None:
    a, b = drawn("." * 10), drawn("." * 4)
    # Middles of b's cells at 9.1, 10.1, ... on a's 0 to 10: one of four. Two corners are inside.
    assert overlap_share(a, b, Pose2(8.6, 0)) == 0.25
    assert overlap_share(a, b, Pose2(8.4, 0)) == 0.5
    # Turned half around, the corners of the outermost cells lie on the far edges.
    assert overlap_share(a, b, Pose2(10, 1, math.pi)) == 1.0


@given(poses, poses)
def test_overlap_does_not_depend_on_the_frames(T_a: Pose2, T_b: Pose2) -> None:
    a, b = office(0.2), office(0.25)
    T_a_b = Pose2(3.0, 2.0, 0.5)
    moved = overlap_share(a.moved(T_a), b.moved(T_b), T_a @ T_a_b @ T_b.inverse())
    assert moved == pytest.approx(overlap_share(a, b, T_a_b), abs=2e-3)


# ------------------------------------------------------------------ pictures
def test_pictures_are_grey_as_in_the_paper_with_the_top_row_first() -> None:
    assert drawn("#. \n...").to_image().tolist() == [[0, 254, 205], [254, 254, 254]]


def test_what_is_displaced_is_taken_from_where_it_came_from() -> None:
    grid = drawn("#....\n.#...\n..#..")

    def displacement(col: NDArray[np.float64], row: NDArray[np.float64]) -> NDArray[np.complex128]:
        # Everything comes from a cell to the left, the middle row from the row above as well.
        return np.where((row > 1) & (row < 2), 1 - 1j, 1.0).astype(np.complex128)

    moved = resample(grid, Pose2(), grid, displacement=displacement)
    assert picture_of(OccupancyGrid(moved, 1.0)) == " #...\n #...\n ..#."
    still = resample(grid, Pose2(), grid, displacement=lambda col, row: np.zeros(col.shape, np.complex128))
    np.testing.assert_array_equal(still, grid.cells)
