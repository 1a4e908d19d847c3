import numpy as np
import pytest
from drawing import drawn
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mapmeld.changes import Change
from mapmeld.changes.classes import classify, distance_to
from mapmeld.grid import OccupancyGrid

SIGNS = " =+-!?"  # in the order of `Change`


def compared(old: str, new: str, tolerance: float = 1.0) -> str:
    classes = classify(drawn(old), drawn(new), tolerance)
    return "\n".join("".join(SIGNS[c] for c in row) for row in classes[::-1])


def test_every_class() -> None:
    old = "..#.. ..  #"
    new = "..... ..#.#"
    #      0123456789
    assert compared(old, new) == "==-== ==!!="
    assert compared(new, old) == "==+== ==??="


def test_an_obstacle_needs_floor_under_it_to_have_appeared() -> None:
    assert compared("....   ", "...#  #", 0.0) == "===+  !"
    assert compared("...#  #", "....   ", 0.0) == "===-  ?"


@pytest.mark.parametrize(("tolerance", "said"), [(0.9, "===-+=="), (1.0, "======="), (5.0, "=======")])
def test_a_wall_drawn_beside_is_the_same_within_the_tolerance(tolerance: float, said: str) -> None:
    assert compared("...#...", "....#..", tolerance) == said


def test_what_is_neither_floor_nor_obstacle_is_no_change() -> None:
    half = OccupancyGrid(np.full((1, 3), 50, np.int8), 1.0)
    assert (classify(half, drawn(".#."), 0.0) == Change.SAME).all()
    assert (classify(drawn(".#."), half, 0.0) == Change.SAME).all()


def test_the_tolerance_is_in_metres() -> None:
    old, new = drawn("...#...", 0.05), drawn(".....#.", 0.05)
    assert (classify(old, new, 0.1) == Change.SAME).all()
    assert (classify(old, new, 0.09) != Change.SAME).sum() == 2


cells = arrays(np.int8, (6, 7), elements=st.sampled_from([-1, 0, 20, 50, 80, 100]))


@given(cells, cells, st.floats(0, 4))
def test_with_roles_swapped_what_appeared_has_vanished(
    a: np.ndarray, b: np.ndarray, tolerance: float
) -> None:
    one, other = OccupancyGrid(a, 1.0), OccupancyGrid(b, 1.0)
    there, back = classify(one, other, tolerance), classify(other, one, tolerance)
    swapped = {
        Change.APPEARED: Change.VANISHED,
        Change.VANISHED: Change.APPEARED,
        Change.EXPLORED: Change.UNSEEN,
        Change.UNSEEN: Change.EXPLORED,
    }
    for change in Change:
        np.testing.assert_array_equal(there == change, back == swapped.get(change, change))


@given(cells, cells, st.floats(0, 4))
def test_every_cell_is_what_the_two_maps_say(a: np.ndarray, b: np.ndarray, tolerance: float) -> None:
    classes = classify(OccupancyGrid(a, 1.0), OccupancyGrid(b, 1.0), tolerance)
    both = np.isin(classes, (Change.SAME, Change.APPEARED, Change.VANISHED))
    np.testing.assert_array_equal(both, (a >= 0) & (b >= 0))
    np.testing.assert_array_equal(classes == Change.UNKNOWN, (a < 0) & (b < 0))
    assert not (classes[a == b] == Change.APPEARED).any()
    for row, col in np.argwhere(classes == Change.APPEARED):
        assert b[row, col] >= 65
        assert 0 <= a[row, col] <= 25
        # No obstacle of before within the tolerance.
        r, c = np.nonzero(a >= 65)
        assert not (np.hypot(r - row, c - col) <= tolerance - 1e-6).any()


def test_distance_to_nothing_is_infinite() -> None:
    assert np.isinf(distance_to(np.zeros((2, 3), bool))).all()
