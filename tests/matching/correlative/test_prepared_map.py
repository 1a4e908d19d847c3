import gc
import weakref
from dataclasses import replace

import pytest
from drawing import drawn, office

from mapmeld.matching.correlative.prepared_map import prepare


def test_both_views_are_of_the_same_map() -> None:
    prepared = prepare(office())
    assert prepared is not None
    assert prepared.reduced.area == pytest.approx(12 * 16)
    assert prepared.walls.area == pytest.approx(12 * 16)
    walls = prepared.walls.frame.apply(
        [(prepared.walls.points.mean().real, prepared.walls.points.mean().imag)]
    )
    coarse = prepared.reduced.T_map_mid.apply(prepared.reduced.points.mean(axis=0))
    assert abs(walls - coarse).max() < 0.3


def test_a_map_without_obstacle_has_nothing_to_prepare() -> None:
    assert prepare(drawn("..\n. ")) is None


def test_a_map_is_prepared_once() -> None:
    grid = office()
    assert prepare(grid) is prepare(grid)
    assert prepare(replace(grid)) is not prepare(grid)


def test_what_was_prepared_does_not_keep_the_map_alive() -> None:
    grid = office()
    prepare(grid)
    gone = weakref.ref(grid)
    del grid
    gc.collect()
    assert gone() is None
