"""Shared patches: every map is what it would be on its own, and shares what it can."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mapmeld.grid import OccupancyGrid
from mapmeld.se2 import Pose2
from mapmeld.slam.kernels import PATCH
from mapmeld.slam.shared_maps import MAX_SIDE, MapTooLargeError, SharedMaps

NOWHERE = np.zeros(2)
COUNT = 3

Actions = list[tuple[int, ...]]
actions = st.lists(
    st.one_of(
        st.tuples(st.just(0), st.integers(0, COUNT - 1), st.integers(-40, 39), st.integers(-40, 39)),
        st.tuples(st.just(1), *[st.integers(0, COUNT - 1)] * COUNT),
        st.tuples(st.just(2), st.integers(1, 4)),
    ),
    max_size=25,
)


def beam(maps: SharedMaps, number: int, x: int, y: int) -> None:
    """A beam from cell (0, 0) to cell (x, y)."""
    maps.enter(number, np.array([0.5, 0.5, 0.0]), NOWHERE, np.array([[x, y]], float), np.array([True]))


def spread(maps: SharedMaps, number: int) -> NDArray[np.int64]:
    """Hits and visits of a map on a lattice of its own, from cell (-320, -320) on."""
    hits, visits, (col, row) = maps.counts(number)
    whole = np.zeros((2, 640, 640), np.int64)
    if hits.size:
        rows, cols = hits.shape
        whole[:, row + 320 : row + 320 + rows, col + 320 : col + 320 + cols] = hits, visits
    return whole


@settings(max_examples=40)
@given(actions)
def test_every_map_is_what_it_would_be_on_its_own(doing: Actions) -> None:
    shared = SharedMaps(COUNT, 1.0, (-PATCH, -PATCH), (PATCH, PATCH))
    # On their own: what was entered into each, entered again into a map that nobody shares.
    pasts: list[list[tuple[int, int]]] = [[] for _ in range(COUNT)]
    for kind, *rest in doing:
        if kind == 0:
            number, x, y = rest
            beam(shared, number, x, y)
            pasts[number] = [*pasts[number], (x, y)]
        elif kind == 1:
            shared.keep(np.array(rest))
            pasts = [pasts[number] for number in rest]
        else:
            reach = float(PATCH * rest[0])
            shared.reach((-reach, 0.0), (0.0, reach))
    for number, past in enumerate(pasts):
        alone = SharedMaps(1, 1.0, (-PATCH, -PATCH), (PATCH, PATCH))
        for x, y in past:
            beam(alone, 0, x, y)
        np.testing.assert_array_equal(spread(shared, number), spread(alone, 0))
    # Nothing is lost and nothing counted wrongly: each patch is used or spare, and never both.
    used = np.unique(shared.tables[shared.tables > 0])
    spare = shared._spare[: shared._spares]
    assert len(used) + len(spare) == len(shared.cells) - 1
    assert len(np.unique([*used, *spare])) == len(shared.cells) - 1
    for patch in used:
        assert shared._references[patch] == np.count_nonzero(shared.tables == patch)
    assert not shared.cells[0].any()


def test_maps_of_one_past_share_their_patches_until_they_differ() -> None:
    maps = SharedMaps(COUNT, 1.0, (-PATCH, -PATCH), (PATCH, PATCH))
    beam(maps, 0, 30, 0)
    beam(maps, 1, 30, 0)
    assert maps.patches == 2  # each its own
    maps.keep(np.zeros(COUNT, np.intp))
    assert maps.patches == 1
    beam(maps, 2, -5, 0)  # starts in the shared one, ends in one beside it
    assert maps.patches == 3
    beam(maps, 2, -5, 0)
    assert maps.patches == 3


def test_memory_that_is_free_again_is_used_again() -> None:
    maps = SharedMaps(2, 1.0, (-PATCH, -PATCH), (PATCH, PATCH))
    for _ in range(200):
        beam(maps, 0, 30, 30)
        beam(maps, 1, -30, 30)
        maps.keep(np.zeros(2, np.intp))
    assert len(maps.cells) < 50
    assert maps.counts(1)[0].sum() == 200


def test_tables_grow_to_all_sides_and_cells_stay_where_they_are() -> None:
    maps = SharedMaps(1, 0.5, (-1.0, -1.0), (1.0, 1.0))
    maps.enter(0, np.array([0.25, 0.25, 0.0]), NOWHERE, np.array([[3.0, 1.0]]), np.array([True]))
    before = maps.grid(0, 0.25)
    maps.reach((-100.0, -30.0), (50.0, 200.0))
    assert maps.grid(0, 0.25) == before
    low = maps.lattice(np.array([[-100.0, -30.0, 0.0]]))[0]
    high = maps.lattice(np.array([[50.0, 200.0, 0.0]]))[0]
    _, rows, cols = maps.tables.shape
    assert (low[:2] >= PATCH).all()
    assert high[0] <= (cols - 1) * PATCH
    assert high[1] <= (rows - 1) * PATCH
    there = np.array([[3.0, -2.0, 0.7]])
    np.testing.assert_allclose(maps.metres(maps.lattice(there)), there)


def test_a_jump_of_the_odometry_is_refused_and_leaves_the_map_as_it_was() -> None:
    maps = SharedMaps(1, 0.05, (-1.0, -1.0), (1.0, 1.0))
    beam(maps, 0, 3, 3)
    before = maps.grid(0, 0.25)
    with pytest.raises(MapTooLargeError, match="the odometry jumps"):
        maps.reach((0.0, 0.0), (MAX_SIDE * PATCH * 0.05, 0.0))
    with pytest.raises(MapTooLargeError):
        maps.reach((-1e300, 0.0), (0.0, 0.0))
    assert maps.grid(0, 0.25) == before


def test_the_grid_has_the_published_values_and_place() -> None:
    maps = SharedMaps(1, 0.5, (-1.0, -1.0), (1.0, 1.0))
    for _ in range(3):
        maps.enter(0, np.array([0.25, 0.25, 0.0]), NOWHERE, np.array([[4.0, 0.0]]), np.array([False]))
    for x in (2.0, 3.0):
        maps.enter(0, np.array([0.25, 0.25, 0.0]), NOWHERE, np.array([[x, 0.0]]), np.array([True]))
    grid = maps.grid(0, 0.2, 7.5)
    # The cell at 2 was met once and passed four times: 0.2 is not more than 0.2; that at 3: 1 of 4.
    expected = OccupancyGrid(np.array([[0, 0, 0, 100]]), 0.5, Pose2(), 7.5)
    assert grid == expected
    assert grid.stamp == 7.5
    assert (maps.grid(0, 0.19).cells == [[0, 0, 100, 100]]).all()


def test_an_empty_map_is_no_grid() -> None:
    with pytest.raises(ValueError, match="nothing was entered"):
        SharedMaps(1, 0.05, (-1.0, -1.0), (1.0, 1.0)).grid(0, 0.25)
