import numpy as np
import pytest
from drawing import around, built, office, seen_from
from floors import bowed, with_box
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmeld.changes.local_bending import Bending, bend_onto, no_bending
from mapmeld.grid import OccupancyGrid, resample
from mapmeld.se2 import Pose2

OFFICE = office(0.05)


def wall_gap(old: OccupancyGrid, cells: np.ndarray) -> float:
    """Share of the walls in `cells` that are over 0.1 m off those of the map."""
    from mapmeld.changes.classes import distance_to

    away = distance_to(old.occupied) * old.resolution
    return float((away[cells >= 65] > 0.1).mean())


@pytest.mark.parametrize("amount", [0.35, -0.4])
def test_a_bow_is_straightened(amount: float) -> None:
    wide = OFFICE.extended(20, 20, 20, 20)
    bent = bowed(OFFICE, amount)
    bending = bend_onto(OFFICE, bent, Pose2(), 0.6)
    assert 0.5 * abs(amount) < bending.greatest < 1.3 * abs(amount)
    assert wall_gap(wide, resample(bent, Pose2(), wide)) > 0.1
    assert wall_gap(wide, bending.laid(bent, Pose2(), wide)) < 0.02


def test_in_whatever_frames_the_maps_are() -> None:
    T_old, T_new = Pose2(30, -7, 0.4), Pose2(-3, 12, 2.0)
    old, bent = OFFICE.moved(T_old), bowed(OFFICE, 0.3).moved(T_new)
    wide = old.extended(20, 20, 20, 20)
    T = T_old @ T_new.inverse()
    bending = bend_onto(old, bent, T, 0.6)
    assert wall_gap(wide, bending.laid(bent, T, wide)) < 0.02


def test_what_fits_is_not_bent() -> None:
    assert bend_onto(OFFICE, OFFICE, Pose2(), 0.5).greatest < 1e-6


def test_furniture_that_was_moved_pulls_nothing_along() -> None:
    old, new = with_box(OFFICE, 1.0, 9.0, 2.2, 9.6), with_box(OFFICE, 1.3, 9.3, 2.5, 9.9)
    assert bend_onto(old, new, Pose2(), 0.5).greatest < 0.03


def test_no_further_than_the_limit() -> None:
    bent = bowed(OFFICE, 0.4)
    assert bend_onto(OFFICE, bent, Pose2(), 0.1).greatest == pytest.approx(0.1)
    assert bend_onto(OFFICE, bent, Pose2(), 0.0).greatest == 0


@pytest.mark.parametrize("cells", [np.zeros((4, 4), np.int8), np.full((4, 4), -1, np.int8)])
def test_without_walls_nothing_is_bent(cells: np.ndarray) -> None:
    bare = OccupancyGrid(cells, 0.05)
    assert bend_onto(bare, OFFICE, Pose2(), 0.5).greatest == 0
    assert bend_onto(OFFICE, bare, Pose2(), 0.5).greatest == 0


def test_a_single_obstacle_is_enough_to_try() -> None:
    dot = OccupancyGrid(np.array([[0, 100, 0]], np.int8), 0.05)
    assert np.isfinite(bend_onto(dot, dot, Pose2(), 0.5).nodes).all()


def test_maps_that_lie_far_apart_are_no_trouble() -> None:
    assert np.isfinite(bend_onto(OFFICE, OFFICE, Pose2(300, -400, 1), 0.5).nodes).all()


@given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-50, 50), st.floats(-50, 50))
def test_the_displacement_is_linear_between_nodes_and_held_outside(
    x: float, y: float, at_x: float, at_y: float
) -> None:
    nodes = np.array([[0, 1], [2j, 1 + 2j]]) * complex(x, 0) + complex(0, y)
    bending = Bending(Pose2(), 1 + 1j, 4.0, nodes)
    u, v = np.clip((at_x - 1) / 4, 0, 1), np.clip((at_y - 1) / 4, 0, 1)
    expected = x * (u + 2j * v) + 1j * y
    assert abs(complex(bending.at(np.array([complex(at_x, at_y)]))[0]) - expected) < 1e-9


@settings(max_examples=25)
@given(st.from_type(Pose2), st.from_type(Pose2))
def test_what_is_laid_down_comes_from_where_the_displacement_says(frame: Pose2, corner: Pose2) -> None:
    """Whatever turn the lattice has, and the frame in which the displacement is told."""
    pattern = np.add.outer(7 * np.arange(40), 3 * np.arange(60)) % 101
    lattice = OccupancyGrid(np.full((40, 60), -1, np.int8), 0.25, corner)
    new = OccupancyGrid(pattern.astype(np.int8), 0.25, corner)
    bending = Bending(frame, 0j, 1.0, np.array([[1.5 + 0.5j, 1.5 + 0.5j], [1.5 + 0.5j, 1.5 + 0.5j]]))
    laid = bending.laid(new, Pose2(), lattice)
    shift = Pose2(0.0, 0.0, frame.theta).apply((1.5, 0.5))
    at = np.floor(new.metres_to_lattice(lattice.centres(np.ones(lattice.shape, bool)) - shift)).astype(int)
    col, row = at.T
    inside = (col >= 0) & (col < 60) & (row >= 0) & (row < 40)
    expected = np.full(at.shape[0], -1)
    expected[inside] = pattern[row[inside], col[inside]]
    assert (laid.ravel() == expected).mean() > 0.97, "but for rounding"


@settings(max_examples=25)
@given(st.floats(-3, 3), st.from_type(Pose2))
def test_where_on_the_lattice_a_place_of_the_frame_lies(turn: float, frame: Pose2) -> None:
    """A displacement that differs from place to place, on a lattice that lies askew in the frame."""
    lattice = OccupancyGrid(np.full((30, 30), -1, np.int8), 0.5, frame @ Pose2(4.0, -2.0, turn))
    # To the right of x = 5 m of the frame, everything comes from 200 m away: from nowhere.
    nodes = np.zeros((2, 1001), complex)
    nodes[:, 501:] = 200
    bending = Bending(frame, -45.0 - 50j, 0.1, nodes)
    laid = bending.laid(OccupancyGrid(np.zeros((30, 30), np.int8), 0.5, lattice.origin), Pose2(), lattice)
    x = frame.inverse().apply(lattice.centres(np.ones(lattice.shape, bool)))[:, 0].reshape(lattice.shape)
    sure = np.abs(x - 5) > 0.3
    np.testing.assert_array_equal(laid[sure] == 0, x[sure] < 5)


@pytest.mark.parametrize("T_old", [Pose2(), Pose2(30, -7, 0.4)])
def test_the_displacement_is_that_of_the_place_where_things_belong(T_old: Pose2) -> None:
    """Not of the place where they are drawn, which has a displacement of its own."""
    partitions = [
        (x, (0, 2, 1, 3)[k % 4], x + 0.1, (0, 2, 1, 3)[k % 4] + 2.2)
        for k, x in enumerate(np.arange(1.2, 23, 1.3))
    ]
    floor = built(24, 6, [*around(24, 6), *partitions])
    wide = floor.extended(20, 20, 20, 20)

    def stretched(x: np.ndarray) -> np.ndarray:
        return np.asarray(0.4 * np.sin(x * 2 * np.pi / 16))

    def displacement(col: np.ndarray, row: np.ndarray) -> np.ndarray:
        return np.asarray(stretched((col - 20) * 0.05) / 0.05 + 0j * row)

    bent = OccupancyGrid(resample(floor, Pose2(), wide, displacement=displacement), 0.05, wide.origin)
    bending = bend_onto(floor.moved(T_old), bent, T_old, 1.0)
    belongs = np.linspace(1, 23, 200)
    drawn_at = belongs
    for _ in range(50):
        drawn_at = belongs + stretched(drawn_at)
    places = (bending.frame.inverse() @ T_old).apply(np.stack([belongs, np.full(200, 3.0)], axis=1))
    found = bending.at(places @ np.array([1, 1j]))
    expected = (belongs - drawn_at) * np.exp(1j * (T_old.theta - bending.frame.theta))
    assert np.abs(found - expected).mean() < 0.0145


@settings(max_examples=20)
@given(st.from_type(Pose2))
def test_no_bending_is_plain_sampling(T: Pose2) -> None:
    new = seen_from(OFFICE, T, 0.1)
    np.testing.assert_array_equal(
        no_bending().laid(new, T.inverse(), OFFICE), resample(new, T.inverse(), OFFICE)
    )
