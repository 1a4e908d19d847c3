"""Where little fixes a mode along one direction, it goes to the middle of where it may lie."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from drawing import office, seen_from
from ready import walls_of

from mapmeld.grid import FREE, OCCUPIED, OccupancyGrid
from mapmeld.matching import match
from mapmeld.matching.correlative.evidence import Evidence, weigh
from mapmeld.matching.correlative.matcher import SLIDE_SOFTNESS, Mode, _centred, _fitted
from mapmeld.matching.correlative.probability import ProbabilityModel
from mapmeld.matching.correlative.wall_map import WallMap
from mapmeld.se2 import Pose2


def corridor() -> OccupancyGrid:
    """20 m of corridor along x, open at both ends."""
    cells = np.full((44, 400), FREE, np.int8)
    cells[[0, 43]] = OCCUPIED
    return OccupancyGrid(cells, 0.05)


@dataclass(frozen=True, slots=True)
class Plateau(ProbabilityModel):
    """Says that all places along x from `low` to `high` are equally good, `gain` better than the others."""

    low: float = 0.0
    high: float = 0.0
    gain: float = 0.0

    def score(self, evidence: Evidence) -> float:
        x = float(evidence.unbent[0])
        return self.gain if self.low - 0.01 < x < self.high + 0.01 else 0.0


def at_rest(walls: WallMap, model: ProbabilityModel) -> Mode:
    (evidence,) = weigh(walls, walls, np.zeros((1, 3)))
    return Mode(np.zeros(3), evidence, model.score(evidence))


def plateau(low: float, high: float, gain: float) -> Plateau:
    return Plateau(0.0, {}, 0.0, low, high, gain)


@pytest.mark.parametrize(("low", "high"), [(0.2, 0.6), (-0.7, -0.1), (0.1, 0.3)])
def test_a_mode_goes_to_the_middle_of_a_plateau(low: float, high: float) -> None:
    walls, model = walls_of(corridor()), plateau(low, high, 30.0)
    moved = _centred(walls, walls, at_rest(walls, model), model)
    assert moved.local == pytest.approx([(low + high) / 2, 0.0, 0.0], abs=0.02)
    n = round((high - low) / 0.1) + 1  # equally likely steps of 0.1 m
    assert moved.spread == pytest.approx(0.1 * math.sqrt((n * n - 1) / 12), abs=0.01)
    assert moved.score == 30.0


def test_where_nothing_is_gained_a_mode_stays() -> None:
    walls, model = walls_of(corridor()), plateau(-0.5, 0.3, 30.0)
    mode = at_rest(walls, model)
    assert _centred(walls, walls, mode, model) is mode


def test_where_it_may_as_well_be_elsewhere_it_goes_to_the_middle_for_no_gain() -> None:
    walls, model = walls_of(corridor()), plateau(-0.2, 1.0, 30.0)
    moved = _centred(walls, walls, at_rest(walls, model), model)
    assert moved.local == pytest.approx([0.4, 0.0, 0.0], abs=0.02)


def test_a_mode_that_is_better_where_it_lies_stays() -> None:
    walls, model = walls_of(corridor()), plateau(-0.05, 0.05, 5 * SLIDE_SOFTNESS)
    mode = at_rest(walls, model)
    assert _centred(walls, walls, mode, model) is mode


def test_along_a_corridor_least_is_fixed() -> None:
    walls = walls_of(corridor())
    (evidence,) = weigh(walls, walls, np.zeros((1, 3)))
    assert abs(evidence.free.real) == pytest.approx(1, abs=0.01)
    assert abs(evidence.free.imag) == pytest.approx(0, abs=0.05)
    assert evidence.middle == pytest.approx(complex(walls.points.mean()), abs=0.2)


def test_the_covariance_knows_the_spread() -> None:
    grid = corridor().__class__(corridor().cells, 0.05, Pose2(3.0, 4.0, 0.5))
    walls, model = walls_of(grid), plateau(0.2, 0.6, 30.0)
    mode = at_rest(walls, model)
    moved = Mode(mode.local, mode.evidence, mode.score, 0.3)
    more = _fitted(walls, walls, moved)[1] - _fitted(walls, walls, mode)[1]
    along = np.array([math.cos(0.5), math.sin(0.5), 0.0])
    assert along @ more @ along == pytest.approx(0.09, rel=0.01)
    assert np.trace(more) == pytest.approx(0.09, rel=0.01)


def test_what_walls_fix_stays_exact() -> None:
    T_b_a = Pose2(3.0, -2.0, 0.7)
    found = match(office(), seen_from(office(), T_b_a)).T_a_b
    assert found is not None
    there = found @ T_b_a
    assert math.hypot(there.x, there.y) < 0.1
