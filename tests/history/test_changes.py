from dataclasses import replace

import pytest
from drawing import cut, drawn, office, seen_from
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.history.changes import changed_area, same_map
from mapmeld.se2 import Pose2


def test_the_same_without_borders() -> None:
    grid = office()
    assert same_map(grid, replace(grid, cells=grid.cells.copy(), stamp=5.0))
    assert same_map(grid, grid.extended(2, 0, 1, 7))
    assert not same_map(grid, grid.moved(Pose2(0.05, 0, 0)))
    assert not same_map(grid, grid.moved(Pose2(0.05, 0, 0)).extended(1, 1, 1, 1))
    assert not same_map(grid, replace(grid, resolution=0.06))
    assert not same_map(grid, cut(grid, 0, 0, 15, 12))


BEFORE = """
##.
#..
"""


@pytest.mark.parametrize(
    ("now", "cells"),
    [("##.\n#..", 0), ("##.\n#. ", 1), ("##.\n###", 2), ("##.\n#..\n...", 3)],
)
def test_changed_cells_are_counted(now: str, cells: int) -> None:
    grid = drawn(now, 0.5)
    if grid.shape[0] == 3:  # grown downwards
        grid = grid.moved(Pose2(0.0, -0.5, 0.0))
    assert changed_area(drawn(BEFORE, 0.5), grid) == pytest.approx(cells * 0.25)


def test_percentages_count_when_they_cross_a_threshold() -> None:
    before = drawn("##..", 1.0)
    paler = replace(before, cells=(before.cells * 0.7).astype("int8"))
    undecided = replace(before, cells=(before.cells * 0.5).astype("int8"))
    assert changed_area(before, paler) == 0
    assert changed_area(before, undecided) == 2


@given(*[st.integers(-2, 4)] * 4)
def test_borders_do_not_count_and_what_is_cut_off_does(left: int, bottom: int, right: int, top: int) -> None:
    before = drawn("##.#\n#...\n#..#\n####", 0.1, Pose2(3, -2, 0.4))
    now = before.extended(left, bottom, right, top)
    gone = before.known_area - now.known_area
    assert changed_area(before, now) == pytest.approx(gone)
    assert changed_area(now, before) == pytest.approx(gone)


def test_on_another_lattice_everything_counts() -> None:
    grid = office()
    for other in (
        grid.moved(Pose2(0.02, 0, 0)),
        seen_from(grid, Pose2(1, 2, 0.5)),
        replace(grid, resolution=0.1),
        replace(grid, cells=grid.cells[:0]),
    ):
        assert changed_area(grid, other) == max(grid.known_area, other.known_area)
