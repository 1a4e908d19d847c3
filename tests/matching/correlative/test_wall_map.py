import math

import numpy as np
import pytest
from drawing import built, drawn, office, seen_from
from ready import walls_of

from mapmeld.grid import FREE, OCCUPIED, OccupancyGrid
from mapmeld.matching.correlative import wall_map as module
from mapmeld.matching.correlative.wall_map import BORDER
from mapmeld.se2 import Pose2


# ---------------------------------------------------------------------- wall points
@pytest.mark.parametrize("upright", [False, True])
@pytest.mark.parametrize("first", [20, 21, 23])
@pytest.mark.parametrize(
    ("resolution", "thickness"),
    [
        *[(0.02, n) for n in (1, 2, 3, 5)],
        *[(0.05, n) for n in (1, 2)],
        (0.1, 1),
    ],
)
def test_points_lie_on_the_middle_line_of_a_wall(
    resolution: float, first: int, thickness: int, upright: bool
) -> None:
    cells = np.full((50, 120), FREE, np.int8)
    cells[first : first + thickness, 10:110] = OCCUPIED
    walls = walls_of(OccupancyGrid(cells.T if upright else cells, resolution))
    z, normals = walls.points, walls.normals
    if upright:
        z, normals = z.imag + 1j * z.real, normals.imag + 1j * normals.real
    middle = (first + thickness / 2) * resolution
    inside = (z.real > 14 * resolution) & (z.real < 106 * resolution)  # the ends are rather blobs
    np.testing.assert_allclose(z.imag[inside], middle, atol=1e-5)
    np.testing.assert_allclose(np.abs(normals.imag[inside]), 1, atol=1e-5)
    np.testing.assert_allclose(np.abs(normals), 1, atol=1e-5)
    assert z.real.min() >= 10 * resolution
    assert z.real.max() <= 110 * resolution


@pytest.mark.parametrize(("resolution", "thickness"), [(0.05, 4), (0.1, 2), (0.02, 10)])
def test_thick_walls_are_walls_and_have_a_middle(resolution: float, thickness: int) -> None:
    cells = np.full((50, 120), FREE, np.int8)
    cells[20 : 20 + thickness] = OCCUPIED
    walls = walls_of(OccupancyGrid(cells, resolution))
    inside = (walls.points.real > 0.4) & (walls.points.real < 120 * resolution - 0.4)
    assert walls.straight[inside].min() > 0.3
    np.testing.assert_allclose(walls.points.imag[inside], (20 + thickness / 2) * resolution, atol=1e-5)
    np.testing.assert_allclose(walls.metres[inside].sum(), 120 * resolution - 0.8, rtol=0.15)


def test_a_solid_block_is_no_wall() -> None:
    cells = np.full((60, 60), FREE, np.int8)
    cells[20:40, 20:40] = OCCUPIED
    walls = walls_of(OccupancyGrid(cells, 0.1))
    deep = (np.abs(walls.points.real - 3) < 0.6) & (np.abs(walls.points.imag - 3) < 0.6)
    assert deep.any()
    assert walls.straight[deep].max() <= 0.3


@pytest.mark.parametrize("degrees", [7, 30, 45, 80])
@pytest.mark.parametrize(
    ("resolution", "thickness", "metres", "tilted"),
    [(0.02, 0.06, 0.005, 5), (0.05, 0.02, 0.01, 10), (0.05, 0.06, 0.015, 12), (0.1, 0.01, 0.05, 30)],
)
def test_points_lie_on_the_middle_line_of_a_wall_that_crosses_the_lattice(
    degrees: int, resolution: float, thickness: float, metres: float, tilted: float
) -> None:
    wall = built(10, 1, [(1, 0.5 - thickness / 2, 9, 0.5 + thickness / 2)], 0.01)
    T = Pose2(0, 0, math.radians(degrees))
    walls = walls_of(seen_from(wall, T, resolution))
    # Back into the frame in which the wall runs along y = 0.5.
    back = (T.inverse() @ walls.frame).matrix()
    along, across, _ = back @ [walls.points.real, walls.points.imag, np.ones(len(walls.points))]
    normal = back[:2, :2] @ [walls.normals.real, walls.normals.imag]
    inside = (along > 1.3) & (along < 8.7)
    assert np.count_nonzero(inside) > 50
    assert walls.straight[inside].min() > 0.3
    assert np.abs(across[inside] - 0.5).max() < metres
    tilt = np.degrees(np.arccos(np.minimum(np.abs(normal[1, inside]), 1)))
    assert tilt.max() < tilted


def test_straightness_tells_walls_from_blobs() -> None:
    cells = np.full((60, 60), FREE, np.int8)
    cells[20:30, 20:30] = OCCUPIED  # a block
    cells[50, 5:55] = OCCUPIED  # a wall
    cells[5, 5] = OCCUPIED  # a speck
    walls = walls_of(OccupancyGrid(cells, 0.1))
    of_wall = walls.points.imag > 4
    speck = np.abs(walls.points - (0.55 + 0.55j)) < 0.1
    inner = np.abs(walls.points - (2.5 + 2.5j)) < 0.3
    assert walls.straight[of_wall & (np.abs(walls.points.real - 3) < 2)] == pytest.approx(1)
    assert walls.straight[speck] == pytest.approx(0)
    assert walls.straight[inner] == pytest.approx(0)
    assert inner.sum() >= 4
    # A block has no middle line: its points stay where its cells are.
    np.testing.assert_allclose(walls.points[inner].real / 0.1 % 1, 0.5, atol=1e-4)
    np.testing.assert_allclose(walls.points[inner].imag / 0.1 % 1, 0.5, atol=1e-4)


def test_there_is_one_point_for_each_field_cell_with_wall() -> None:
    cells = np.full((40, 40), FREE, np.int8)
    cells[10, 3:21] = OCCUPIED  # touches field cells 1..10 of two cells each
    walls = walls_of(OccupancyGrid(cells, 0.05))
    assert walls.cell == pytest.approx(0.1)
    assert len(walls.points) == 10
    assert walls.metres.sum() == pytest.approx(0.9, abs=0.05)


@pytest.mark.parametrize("T", [Pose2(0, 0, 0.3), Pose2(0, 0, 0.785)])
def test_the_length_of_a_wall_does_not_depend_on_how_it_lies(T: Pose2) -> None:
    wall = built(10, 1, [(1, 0.5, 9, 0.6)], 0.01)
    walls = walls_of(seen_from(wall, T, 0.05))
    assert walls.metres.sum() == pytest.approx(8, rel=0.2)


def test_every_beginning_of_the_points_is_a_fair_sample() -> None:
    walls = walls_of(office())
    for n in (100, 200, 400):
        some, everything = walls.points[:n], walls.points
        assert abs(some.mean() - everything.mean()) < 4 * 8 / math.sqrt(n)
        for box in (everything.real < 8, everything.imag < 6):
            assert np.mean(box[:n]) == pytest.approx(np.mean(box), abs=2.5 * 0.5 / math.sqrt(n))


# ---------------------------------------------------------------------- fields
PICTURE = """
........
........
..#.....
........
.....  .
"""


def field(values: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    return values.reshape(shape)[BORDER:-BORDER, BORDER:-BORDER]


def test_depth_is_the_distance_to_what_is_not_free() -> None:
    walls = walls_of(drawn(PICTURE, 0.1))
    depth = walls.depth.reshape(walls.shape)
    rows, cols = walls.shape
    assert (rows, cols) == (5 + 2 * BORDER, 8 + 2 * BORDER)
    inside = field(walls.depth, walls.shape)
    assert inside[2, 2] == 0  # the wall
    assert (inside[0, 5:7] == -1).all()  # never seen
    assert depth[:BORDER].max() == depth[:, -BORDER:].max() == -1  # the border is unknown
    assert inside[2, 3] == pytest.approx(0.1)
    assert inside[2, 4] == pytest.approx(0.2)
    assert inside[3, 3] == pytest.approx(0.1 * math.sqrt(2), rel=0.02)
    assert inside[4, 0] == pytest.approx(0.1)  # next to the unknown outside
    assert inside[2, 6] == pytest.approx(0.2)


def test_nearest_is_the_index_of_the_nearest_wall_point() -> None:
    cells = np.full((30, 40), FREE, np.int8)
    rng = np.random.default_rng(3)
    places = np.unique(rng.integers(0, (30, 40), (12, 2)), axis=0)
    cells[places[:, 0], places[:, 1]] = OCCUPIED
    walls = walls_of(OccupancyGrid(cells, 0.1))
    cell = walls.cell
    at = np.arange(walls.shape[0] * walls.shape[1])
    centres = ((at % walls.shape[1]) - BORDER + 0.5 + 1j * (at // walls.shape[1] - BORDER + 0.5)) * cell
    distance = np.abs(centres[:, None] - walls.points)
    found = distance[at, walls.nearest]
    # OpenCV's distances on a 5 x 5 mask are a few percent off.
    assert (found <= 1.05 * distance.min(axis=1) + 1e-6).all()
    assert len(walls.points) == len(places)


@pytest.mark.parametrize("resolution", [0.05, 0.1, 0.2])
def test_places_are_looked_up_in_metres(resolution: float) -> None:
    cells = np.full((20, 30), FREE, np.int8)
    cells[0, 0] = OCCUPIED
    walls = walls_of(OccupancyGrid(cells, resolution))
    z = np.array([0.0, 0.5 * walls.cell, 1.01 * walls.cell, 2.5j * walls.cell], np.complex64)
    width = walls.shape[1]
    base = BORDER * width + BORDER
    assert walls.at(z).tolist() == [base, base, base + 1, base + 2 * width]
    outside = np.array([-5, 1000, -5j, 1000j, 1e6 + 1e6j, -1e6], np.complex64)
    assert (walls.depth[walls.at(outside)] == -1).all()


def test_small_cells_are_taken_together() -> None:
    # Half of a field cell of 2 x 2 or more must be free for it to be floor.
    cells = np.full((40, 40), -1, np.int8)
    cells[0, :] = OCCUPIED
    cells[10:30, 10:30] = FREE
    walls = walls_of(OccupancyGrid(cells, 0.02))
    assert walls.cell == pytest.approx(0.1)
    inside = field(walls.depth, walls.shape)
    assert inside.shape == (6, 8)  # rows above 30 are unknown
    expected = np.full((6, 8), -1.0)
    expected[0] = 0
    expected[2:6, 2:6] = 0.1
    expected[3:5, 3:5] = 0.2
    np.testing.assert_allclose(inside, expected, atol=1e-6)


def test_large_maps_get_coarser_fields(monkeypatch: pytest.MonkeyPatch) -> None:
    usual = walls_of(office())
    monkeypatch.setattr(module, "MAX_FIELD_CELLS", 5000)
    coarse = walls_of(office())
    assert len(coarse.depth) < 6000 < len(usual.depth)
    assert coarse.cell > usual.cell
    assert coarse.area == usual.area


# ---------------------------------------------------------------------- the rest
def test_area_and_sample_of_the_floor() -> None:
    walls = walls_of(drawn(PICTURE, 0.1))
    assert walls.area == pytest.approx(0.38)
    assert len(walls.floor) == 38  # few enough to take all of it
    known = walls.depth[walls.at(walls.floor)]
    assert (known >= 0).all()
    many = walls_of(office())
    assert 1000 <= len(many.floor) < 2000
    assert abs(many.floor.mean() - (8 + 6j)) < 0.3


def test_the_local_frame_is_the_corner_of_the_known_part() -> None:
    grid = drawn("     \n  #. \n     ", 0.5, Pose2(10, 20, math.pi / 2))
    assert walls_of(grid).frame.distance_to(Pose2(9.5, 21, math.pi / 2)) == pytest.approx((0, 0), abs=1e-9)


def test_unknown_borders_and_far_frames_change_nothing() -> None:
    usual = walls_of(office())
    other = walls_of(office().extended(3, 14, 15, 9).moved(Pose2(1e5, -1e5, 1.0)))
    for name in ("depth", "nearest", "points", "normals", "straight", "floor"):
        np.testing.assert_array_equal(getattr(usual, name), getattr(other, name))
    assert (usual.cell, usual.shape, usual.area) == (other.cell, other.shape, other.area)
