"""Shares of wall, on hand-made cases. (`test_evidence.py` is that of the baselines.)"""

import math
from dataclasses import replace

import numpy as np
import pytest
from drawing import Walls, around, built, cut, office, seen_from
from ready import rows, walls_of

from mapmeld.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mapmeld.matching.correlative.alignment import to_local
from mapmeld.matching.correlative.evidence import Evidence, quick_scores, weigh
from mapmeld.matching.correlative.wall_map import WallMap
from mapmeld.se2 import Pose2

IDENTITY = rows(Pose2())


def room(*more: tuple[float, float, float, float]) -> WallMap:
    """A room of 10 x 8 m."""
    walls: Walls = [*around(10, 8), *more]
    return walls_of(built(10, 8, walls))


def weighed(a: WallMap, b: WallMap, T: Pose2 | None = None) -> Evidence:
    (evidence,) = weigh(a, b, rows(T or Pose2()), 5000)
    return evidence


def test_a_map_explains_itself() -> None:
    walls = room((3, 2, 3.1, 6))
    e = weighed(walls, walls)
    length = 2 * (10 + 8) + 4
    assert e.wall == pytest.approx(2 * length, rel=0.02)  # of both maps
    assert e.hit == pytest.approx(e.wall, rel=0.02)
    assert e.hit_bent == pytest.approx(e.wall, rel=0.02)
    assert e.contra == e.contra_bent == 0
    assert e.bend == pytest.approx(0, abs=1e-3)
    assert e.overlap == pytest.approx(1, abs=0.01)
    assert e.shares == pytest.approx((1, 0), abs=0.02)
    np.testing.assert_allclose(e.unbent, 0, atol=1e-3)
    assert e.surplus > 10


def test_a_wall_deep_in_free_space_is_contradicted() -> None:
    # 3 m in the middle of what the other map has seen to be free; one map's wall, tested once.
    e = weighed(room(), room((3.5, 4, 6.5, 4.1)))
    assert e.contra == pytest.approx(3, abs=0.2)
    assert e.contra_bent == pytest.approx(3, abs=0.2)
    assert e.wall == pytest.approx(2 * 36 + 3, rel=0.02)
    assert e.hit == pytest.approx(e.wall - 3, rel=0.02)
    swapped = weighed(room((3.5, 4, 6.5, 4.1)), room())
    assert swapped.contra == pytest.approx(e.contra, abs=1e-4)


def test_a_wall_next_to_a_wall_is_neither_explained_nor_contradicted() -> None:
    e = weighed(room((3, 2, 3.1, 6)), room((3.2, 2, 3.3, 6)))
    assert e.contra == 0
    assert e.hit == pytest.approx(e.wall - 8, rel=0.02)


def test_a_crossing_wall_does_not_explain() -> None:
    # Every wall of a grid of bars is near one of the same grid turned by a right angle.
    bars = np.full((60, 60), FREE, np.int8)
    bars[::6] = OCCUPIED
    a, b = (walls_of(OccupancyGrid(cells, 0.05)) for cells in (bars, bars.T))
    along, across = weighed(a, a), weighed(a, b)
    assert along.hit / along.wall > 0.95
    assert across.hit / across.wall < 0.2


def test_what_the_other_map_does_not_know_is_not_tested() -> None:
    cells = np.full((160, 200), UNKNOWN, np.int8)
    cells[:2] = cells[-2:] = OCCUPIED  # only two walls are known, nothing between
    a = walls_of(OccupancyGrid(cells, 0.05))
    e = weighed(a, room((3.5, 4, 6.5, 4.1)))
    assert e.contra == 0
    assert e.wall == pytest.approx(4 * 10, rel=0.06)
    assert e.hit == pytest.approx(4 * 10, rel=0.06)


def test_the_overlap_is_the_area_known_in_both() -> None:
    e = weighed(room(), room(), Pose2(5, 0, 0))
    assert e.overlap == pytest.approx(0.5, abs=0.02)
    small = walls_of(cut(built(10, 8, around(10, 8)), 0, 0, 10, 4))
    assert weighed(room(), small).overlap == pytest.approx(1, abs=0.01)
    nothing = weighed(room(), room(), Pose2(50, 0, 0))
    assert nothing.overlap == 0
    assert nothing.hit == 0
    assert nothing.surplus == pytest.approx(0, abs=1e-3)


def test_chance_is_the_share_of_the_floor_by_a_wall() -> None:
    e = weighed(room(), room())
    # Within 0.1 m of the middle line of a wall 0.05 m inside the border: a rim of about 0.15 m.
    assert e.chance == pytest.approx(1 - (9.7 * 7.7) / 80, abs=0.03)
    # Free and more than 0.3 m from the walls.
    assert e.chance_deep == pytest.approx(9.2 * 7.2 / 80, abs=0.05)


def test_corridors_fix_one_direction_only() -> None:
    corridor = walls_of(built(20, 2.2, [(0, 0, 20, 0.1), (0, 2.1, 20, 2.2)]))
    along, both = weighed(corridor, corridor), weighed(room(), room())
    assert along.weak < 0.05 * along.hit
    assert both.weak > 0.3 * both.hit


def test_a_bent_map_is_explained_after_bending() -> None:
    grid = office()
    T = Pose2(0, 0, 0)
    b = walls_of(seen_from(grid, Pose2(), 0.05))
    # Turned by 0.8 degrees about a corner, as a bend that a narrow tolerance does not forgive.
    turned = Pose2(0, 0, math.radians(0.8))
    t = to_local(walls_of(grid), b, T @ turned)
    (e,) = weigh(walls_of(grid), b, t[None])
    assert e.hit < 0.9 * e.wall
    assert e.hit_bent > 0.95 * e.wall
    assert e.bend > 0.05
    found = Pose2(*e.unbent)
    truth = to_local(walls_of(grid), b, T)
    assert found.distance_to(Pose2(*truth))[1] < math.radians(0.3)


def test_both_maps_play_the_same_part() -> None:
    T = Pose2(2, -7, 0.7)
    a, b = walls_of(cut(office(), 0, 0, 12, 12)), walls_of(seen_from(cut(office(), 4, 0, 16, 12), T))
    t = Pose2(*to_local(a, b, T.inverse()))
    one, other = weighed(a, b, t), weighed(b, a, t.inverse())
    for name in ("wall", "hit", "hit_bent", "contra", "chance", "chance_deep", "overlap", "weak"):
        assert getattr(one, name) == pytest.approx(getattr(other, name), rel=0.02, abs=0.3), name


def test_many_transforms_are_weighed_as_one_by_one() -> None:
    walls = walls_of(office())
    t = rows(Pose2(), Pose2(0.2, 0.1, 0.02), Pose2(5, 5, 2))
    for together, alone in zip(
        weigh(walls, walls, t), (weigh(walls, walls, row[None])[0] for row in t), strict=True
    ):
        for name in ("wall", "hit", "contra", "overlap", "chance", "chance_deep"):
            assert getattr(together, name) == pytest.approx(getattr(alone, name), rel=1e-4), name
        assert together.hit_bent == pytest.approx(alone.hit_bent, rel=0.02)


# ---------------------------------------------------------------------- figures
PERFECT = Evidence(100, 100, 100, 0, 0, 0.1, 0.6, 0, 1.0, 30, np.zeros(3))


def test_surplus_is_the_deviance_from_chance() -> None:
    assert PERFECT.surplus == pytest.approx(math.sqrt(100 * 0.999 * math.log(0.999 / 0.1)), rel=0.01)
    for hits in (0, 5, 10):  # no more than chance
        assert replace(PERFECT, hit_bent=hits, contra_bent=40).surplus == 0
    some = [replace(PERFECT, hit_bent=hits).surplus for hits in (30, 50, 80, 99)]
    assert some == sorted(some)
    longer = replace(PERFECT, wall=400, hit_bent=400)
    assert longer.surplus == pytest.approx(2 * PERFECT.surplus)
    by_chance = [replace(PERFECT, chance=chance).surplus for chance in (0.0, 0.02, 0.1, 0.4, 0.8, 1.0)]
    assert by_chance == sorted(by_chance, reverse=True)
    assert by_chance[0] == by_chance[1]


def test_figures_are_finite_for_all_shares() -> None:
    for hit in (0, 1e-9, 50, 100):
        for contra in (0, 1e-9, 50, 100):
            for chance, deep in ((0, 0), (1, 0), (0, 1), (0.5, 0.5)):
                e = replace(
                    PERFECT, hit_bent=hit, contra=contra, contra_bent=contra, chance=chance, chance_deep=deep
                )
                assert all(map(math.isfinite, (e.surplus, e.clean, e.clean_bent, e.log_overlap)))
                assert e.surplus >= 0


def test_contradiction_and_small_overlap_count_against() -> None:
    clean = [replace(PERFECT, contra=c).clean for c in (0, 1, 10, 100)]
    assert clean == sorted(clean, reverse=True)
    assert clean[0] == pytest.approx(3.9, abs=0.02)
    assert clean[-1] == pytest.approx(0, abs=0.03)
    assert [replace(PERFECT, contra_bent=c).clean_bent for c in (0, 1, 10, 100)] == clean
    overlaps = [replace(PERFECT, overlap=o).log_overlap for o in (0, 0.1, 0.5, 1)]
    assert overlaps == sorted(overlaps)


def test_the_quick_score_prefers_the_truth() -> None:
    walls = walls_of(office())
    others = [Pose2(1, 0, 0), Pose2(0, -0.6, 0), Pose2(16, 12, math.pi), Pose2(0, 0, 0.2), Pose2(8, 0, 0)]
    scores = quick_scores(walls, walls, rows(Pose2(), *others), 320)
    assert scores.shape == (6,)
    assert scores.argmax() == 0
    assert np.isfinite(scores).all()


def test_a_handful_of_wall_cells_is_weighed() -> None:
    speck = np.full((40, 40), FREE, np.int8)
    speck[20, 20] = OCCUPIED
    e = weighed(room(), walls_of(OccupancyGrid(speck, 0.05)), Pose2(4, 3, 0))
    assert e.hit == 0
    assert e.contra > 0
    assert all(map(math.isfinite, (e.surplus, e.clean, e.bend, e.weak)))
    assert weigh(room(), room(), IDENTITY, 3)[0].wall == pytest.approx(
        72, rel=0.1
    )  # a small sample stands for all
