import numpy as np
from drawing import office
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.evaluation.turning import turned
from mapmeld.grid import OccupancyGrid
from mapmeld.se2 import Pose2

seeds = st.integers(0, 2**48)


@given(seeds, st.floats(-3, 3))
def test_the_turned_map_shows_the_same_place(seed: int, yaw: float) -> None:
    old = OccupancyGrid(office(0.2).cells, 0.2, Pose2(40.0, -7.0, yaw))
    new, T_new_old = turned(old, seed)
    assert new.resolution == old.resolution
    # Every known cell of the new map is the cell of the old one on which its centre lies.
    cols, rows = np.floor(old.metres_to_lattice(T_new_old.inverse().apply(new.centres(new.known)))).T
    inside = old.cells[np.clip(rows, 0, 59).astype(int), np.clip(cols, 0, 79).astype(int)]
    assert np.mean(inside == new.cells[new.known]) > 0.999  # centres on a cell's edge may round either way
    assert abs(new.known_area - old.known_area) < 0.02 * old.known_area


@given(seeds)
def test_the_same_seed_gives_the_same_map(seed: int) -> None:
    assert turned(office(0.4), seed) == turned(office(0.4), seed)


def test_angles_cover_the_circle_and_lattices_follow_the_new_axes() -> None:
    motions = [turned(office(0.4), seed) for seed in range(40)]
    angles = np.sort([T_new_old.theta for _, T_new_old in motions])
    assert np.diff(np.append(angles, angles[0] + 2 * np.pi)).max() < 1.0
    assert all(grid.origin.theta == 0 for grid, _ in motions)


def test_a_map_with_nothing_in_it_can_be_turned() -> None:
    new, _ = turned(OccupancyGrid(np.full((3, 4), -1), 0.1), 5)
    assert not new.known.any()
