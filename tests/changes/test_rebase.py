import numpy as np
import pytest
from drawing import drawn, office, seen_from
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.changes import rebase
from mapmeld.grid import OccupancyGrid
from mapmeld.se2 import Pose2

OLD = drawn("....\n#...", 0.5, Pose2(1, 2, 0.25))


@given(st.from_type(Pose2), st.from_type(Pose2))
def test_only_the_origin_changes(T: Pose2, origin: Pose2) -> None:
    new = OccupancyGrid(np.array([[-1, 0, 37], [100, 66, 1]], np.int8), 0.3, origin, 12.0, "map_2")
    old = OccupancyGrid(OLD.cells, OLD.resolution, OLD.origin, 3.0, "map")
    moved = rebase(new, old, T)
    np.testing.assert_array_equal(moved.cells, new.cells)
    assert (moved.resolution, moved.stamp, moved.frame_id) == (0.3, 12.0, "map")
    corners = [(0, 0), (3, 2)]
    np.testing.assert_allclose(
        moved.lattice_to_metres(corners), T.apply(new.lattice_to_metres(corners)), atol=1e-9
    )


def test_on_the_lattice_cell_lies_on_cell() -> None:
    new = OccupancyGrid(np.array([[37, -1, 100], [0, 66, 1]], np.int8), 0.5, Pose2(), 12.0, "map_2")
    old = OccupancyGrid(OLD.cells, OLD.resolution, OLD.origin, 3.0, "map")
    # Two cells to the right and one down on the earlier map's lattice.
    T = OLD.origin @ Pose2(1.0, -0.5)
    moved = rebase(new, old, T, lattice=True)
    assert (moved.stamp, moved.frame_id) == (12.0, "map")
    assert moved.cells.tolist() == [[-1, -1, 37, -1, 100], [-1, -1, 0, 66, 1], [-1] * 5]
    assert moved.resolution == OLD.resolution
    assert moved.origin.theta == OLD.origin.theta
    np.testing.assert_allclose(OLD.metres_to_lattice((moved.origin.x, moved.origin.y)), (0, -1), atol=1e-9)


@given(st.from_type(Pose2))
def test_the_lattice_is_that_of_the_earlier_map_by_whole_cells(T: Pose2) -> None:
    new = seen_from(office(0.2), T.inverse(), 0.25)
    moved = rebase(new, OLD, T, lattice=True)
    corner = OLD.metres_to_lattice((moved.origin.x, moved.origin.y))
    np.testing.assert_allclose(corner, np.rint(corner), atol=1e-6)
    assert (corner <= 1e-6).all()
    assert (moved.resolution, moved.origin.theta) == (OLD.resolution, OLD.origin.theta)
    assert moved.known_area == pytest.approx(new.known_area, rel=0.3)
