import math
from dataclasses import replace

import numpy as np
import pytest
from drawing import drawn, office, picture_of, seen_from
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.merging import MergeError, lattice_for_all, merge_aligned
from mapmeld.se2 import Pose2

poses = st.from_type(Pose2)


def test_the_colour_rule_on_an_extended_lattice() -> None:
    a = drawn("#.\n..", origin=Pose2(10, 20))
    b = drawn("..\n#.")
    merged = merge_aligned([a, b], [Pose2(), Pose2(9, 19)])
    assert picture_of(merged) == " #.\n...\n#. "
    assert merged.origin == Pose2(9, 19)


@given(poses, poses)
def test_old_cells_never_move_and_never_change_under_unknown(origin: Pose2, T_a_b: Pose2) -> None:
    a = drawn("#.#\n.. \n #.", resolution=0.5, origin=origin)
    b = drawn("..\n..", resolution=0.5)
    merged = merge_aligned([a, b], [Pose2(), T_a_b], "colour")
    assert merged.origin.theta == a.origin.theta
    # The lattice is a's, extended by whole cells:
    shift = merged.metres_to_lattice((a.origin.x, a.origin.y))
    col, row = np.rint(shift).astype(int)
    np.testing.assert_allclose(shift, (col, row), atol=1e-6)
    old = merged.cells[row : row + a.shape[0], col : col + a.shape[1]]
    assert (old[a.occupied] == 100).all()
    assert (old[a.free] == 0).all()
    # and b is all there: a cell is known where its centre lies in b.
    rows, cols = np.mgrid[0 : merged.shape[0], 0 : merged.shape[1]]
    centres = merged.lattice_to_metres(np.stack([cols, rows], axis=-1) + 0.5)
    in_b = T_a_b.inverse().apply(centres)
    assert (merged.cells[((in_b > 1e-6) & (in_b < 1 - 1e-6)).all(axis=-1)] >= 0).all()


@given(st.floats(-math.pi, math.pi))
def test_a_map_merged_with_itself_turned_doubles_no_wall(theta: float) -> None:
    a = office(0.1)
    T = Pose2(1.234, -0.567, theta)
    merged = merge_aligned([a, seen_from(a, T)], [Pose2(), T.inverse()]).cropped()
    wall = np.count_nonzero(a.occupied)
    # Sampled twice, edges move by at most a cell: walls of one cell grow, never split in two.
    thick = np.zeros(merged.shape, bool)
    row, col = (np.rint(v).astype(int) for v in merged.metres_to_lattice((0.0, 0.0))[::-1])
    thick[row : row + a.shape[0], col : col + a.shape[1]] = a.occupied
    for axis in (0, 1):
        thick |= np.roll(thick, 1, axis) | np.roll(thick, -1, axis)
    assert not (merged.occupied & ~thick).any()
    assert np.count_nonzero(merged.occupied) < 3 * wall


def test_an_unknown_map_extends_nothing() -> None:
    a = drawn("#.")
    assert merge_aligned([a, drawn("    ")], [Pose2(), Pose2(50, 50)]) == a


def test_newest_goes_by_stamps_where_all_maps_have_one() -> None:
    old, new = replace(drawn("#"), stamp=1.0), replace(drawn("."), stamp=2.0)
    for grids in ([old, new], [new, old]):
        merged = merge_aligned(grids, [Pose2(), Pose2()], "newest")
        assert picture_of(merged) == "."
        assert merged.stamp == 2.0
    unstamped = replace(new, stamp=None)
    assert picture_of(merge_aligned([unstamped, old], [Pose2(), Pose2()], "newest")) == "#"


def test_a_finer_map_loses_no_thin_wall() -> None:
    fine = np.zeros((40, 40), np.int8)
    fine[:, 13] = 100
    a = drawn("\n".join(["." * 10] * 10), resolution=0.2)
    b = replace(drawn(".", resolution=0.05), cells=fine)
    assert picture_of(merge_aligned([a, b], [Pose2(), Pose2()])) == "\n".join(["...#......"] * 10)


def test_the_first_pose_must_be_the_identity() -> None:
    with pytest.raises(ValueError, match="identity"):
        merge_aligned([drawn("#")], [Pose2(1)])
    with pytest.raises(ValueError, match="as many"):
        merge_aligned([drawn("#")], [])


# ------------------------------------------------------------------ the lattice for all
def test_unknown_cells_around_a_map_extend_nothing() -> None:
    a, b = drawn("....\n....\n...."), drawn("#.")
    framed = b.extended(left=7, bottom=5, right=9, top=11)
    for inner in (b, framed):
        assert merge_aligned([a, inner], [Pose2(), Pose2(1, 1)]).shape == (3, 4)
        assert lattice_for_all([a, inner], [Pose2(), Pose2(3, 1)]) == a.extended(0, 0, 1, 0)


@pytest.mark.parametrize(
    "T",
    [Pose2(1e7, 1e7), Pose2(-1e7, 1e7, 1.0), Pose2(0, math.nan)],
)
def test_maps_out_of_all_reach_are_an_error_not_a_full_memory(T: Pose2) -> None:
    a = drawn("\n".join(["." * 4] * 4), resolution=0.05)
    for merging in (lattice_for_all, merge_aligned):
        with pytest.raises(MergeError, match="check the poses and resolutions") as refused:
            merging([a, a], [Pose2(), T])
        assert "\n" not in str(refused.value)


def test_the_largest_lattice_is_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mapmeld.merging.aligned.MAX_CELLS", 6)
    assert lattice_for_all([drawn("."), drawn(".")], [Pose2(), Pose2(2, 1)]).shape == (2, 3)
    with pytest.raises(MergeError, match="4 x 2 cells, more than 6"):
        lattice_for_all([drawn("."), drawn(".")], [Pose2(), Pose2(3, 1)])
