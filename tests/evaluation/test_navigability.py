"""What can be driven on a map, and what of that is true."""

import math

import numpy as np
import pytest
from drawing import Walls, around, built, drawn, office, seen_from
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmeld.evaluation import NavigabilityError, navigability, reach
from mapmeld.grid import OccupancyGrid
from mapmeld.se2 import Pose2

ROOMS = (8.0, 4.0)  # two rooms, and a wall of 0.1 m between them


def two_rooms(door: tuple[float, float] | None, *more: tuple[float, float, float, float]) -> OccupancyGrid:
    """The rooms with a door in their wall from one height to another [m], or none."""
    wall: Walls = [(4, 0, 4.1, 4)] if door is None else [(4, 0, 4.1, door[0]), (4, door[1], 4.1, 4)]
    return built(*ROOMS, [*around(*ROOMS), *wall, *more])


def test_a_true_map_says_what_is_true() -> None:
    truth = office()
    found = navigability(truth, truth, Pose2(), pairs=30)
    assert found.pairs == found.reachable_map == found.reachable_truth == found.reachable_both == 30
    assert (found.false_passages, found.false_blocks) == (0, 0)
    assert found.length_ratios == (1.0,) * 30
    assert found.length_ratio == 1.0


@settings(max_examples=8)
@given(st.floats(-math.pi, math.pi), st.floats(-0.05, 0.05))
def test_neither_a_turn_nor_half_a_cell_makes_a_difference(turn: float, shift: float) -> None:
    truth = office()
    T = Pose2(3.0 + shift, -2.0, turn)
    found = navigability(seen_from(truth, T), truth, T.inverse(), pairs=20)
    assert (found.reachable_both, found.false_passages, found.false_blocks) == (20, 0, 0)
    assert min(found.length_ratios) > 0.95
    assert max(found.length_ratios) < 1.05


def test_a_wall_that_the_map_lacks_is_a_false_passage() -> None:
    found = navigability(two_rooms((0.1, 3.9)), two_rooms((2.9, 3.9)), Pose2(), pairs=100)
    assert found.reachable_map == found.reachable_truth == 100
    assert 15 < found.false_passages < 60
    assert all(way.drivable != way.false_passage for way in found.ways)
    through = [way for way in found.ways if way.false_passage]
    # Only who changes rooms goes through it.
    assert all((way.start[0] < 4) != (way.goal[0] < 4) for way in through)
    assert len(found.length_ratios) == 100 - found.false_passages


def test_a_passage_where_there_is_none_at_all() -> None:
    found = navigability(two_rooms((1, 2)), two_rooms(None), Pose2(), pairs=60)
    assert found.reachable_map == 60
    assert found.reachable_truth == found.reachable_both == 60 - found.false_passages
    assert found.false_passages > 10


def test_a_wall_that_is_not_there_blocks() -> None:
    found = navigability(two_rooms(None), two_rooms((1, 2)), Pose2(), pairs=60)
    assert found.reachable_truth == 60
    assert found.false_blocks == 60 - found.reachable_map > 10
    assert found.false_passages == 0
    assert all(way.length is None and not way.drivable for way in found.ways if way.false_block)


def test_a_detour_shows_in_the_ratio() -> None:
    # The map closes one of two doors.
    found = navigability(
        two_rooms((0.1, 1)), built(*ROOMS, [*around(*ROOMS), (4, 1, 4.1, 3)]), Pose2(), pairs=60
    )
    assert (found.false_passages, found.false_blocks) == (0, 0)
    assert min(found.length_ratios) == 1.0
    assert max(found.length_ratios) > 1.2


@pytest.mark.parametrize(("shift", "tolerance", "false"), [(0.15, 0.2, 0), (0.4, 0.2, 1), (0.4, 0.5, 0)])
def test_a_map_that_lies_a_little_off_makes_no_false_passage(
    shift: float, tolerance: float, false: int
) -> None:
    truth = two_rooms((1, 2))
    found = navigability(truth, truth, Pose2(0, shift), pairs=60, tolerance=tolerance)
    assert min(found.false_passages, 1) == false


def test_the_tolerance_is_not_enough_to_go_round_a_wall() -> None:
    # The planned way passes 0.3 m beside the end of a wall in truth, but on the wrong side of it by 0.5 m.
    truth = built(*ROOMS, [*around(*ROOMS), (4, 0, 4.1, 2)])
    open_map = built(*ROOMS, around(*ROOMS))
    found = navigability(open_map, truth, Pose2(), pairs=200, tolerance=0.2)
    for way in found.ways:
        assert way.path is not None
        at_wall = way.path[np.abs(way.path[:, 0] - 4.05) < 0.03, 1]
        if at_wall.size and at_wall.max() < 2 + 0.2 - 0.2 - 0.1:
            assert way.false_passage
        if not at_wall.size or at_wall.min() > 2 + 0.2:
            assert not way.false_passage


def test_the_robot_must_fit() -> None:
    truth = two_rooms((1, 1.8))
    assert navigability(truth, truth, Pose2(), radius=0.35, pairs=60).reachable_map == 60
    narrow = navigability(truth, truth, Pose2(), radius=0.5, pairs=60)
    assert narrow.reachable_map == narrow.reachable_truth < 60


@pytest.mark.parametrize("radius", [0.0, 0.05, 0.07, 0.1, 0.3])
def test_a_diagonal_wall_is_a_wall(radius: float) -> None:
    cells = np.zeros((60, 60), np.int8)
    open_floor = OccupancyGrid(cells.copy(), 0.05)
    cells[np.arange(60), np.arange(60)] = 100
    walled = OccupancyGrid(cells, 0.05)
    found = reach(walled, radius=radius, pairs=100)
    assert found.components == 2
    assert 30 < found.reachable < 70
    compared = navigability(walled, walled, Pose2(), radius=radius, pairs=100)
    assert 30 < compared.reachable_both == compared.reachable_map < 70
    assert (compared.false_passages, compared.false_blocks) == (0, 0)
    # Planned across it, a way is false.
    crossed = navigability(open_floor, walled, Pose2(), radius=radius, tolerance=0.05, pairs=100)
    assert crossed.reachable_map == 100
    assert crossed.false_passages >= 100 - crossed.reachable_truth > 30


def test_thin_robots_are_compared_by_the_same_kind_of_steps() -> None:
    fine = built(4, 4, around(4, 4))
    coarse = built(4, 4, around(4, 4), resolution=0.2)
    found = navigability(fine, coarse, Pose2(), radius=0.2, pairs=40)
    assert found.pairs == len(found.length_ratios) == 40
    assert min(found.length_ratios) > 0.9


def test_what_is_unknown_is_not_driven() -> None:
    picture = "......\n... ..\n......"
    with_hole = drawn(picture.replace(".. ", "   ").replace("......", "...   "))
    assert reach(with_hole, radius=0).drivable_area == with_hole.free.sum()
    open_floor, split = drawn("..........\n" * 3), drawn("....  ....\n" * 3)
    found = navigability(split, open_floor, Pose2(), radius=0.2, pairs=40)
    assert found.false_blocks > 5
    assert found.false_passages == 0


def test_starts_say_where_robots_get() -> None:
    truth = two_rooms(None)
    left, right = Pose2(1, 1), Pose2(7, 3)
    only_left = navigability(truth, truth, Pose2(), starts=[left], pairs=40)
    assert all(way.start[0] < 4 and way.goal[0] < 4 for way in only_left.ways)
    assert only_left.reachable_both == 40
    both = navigability(truth, truth, Pose2(), starts=[left, right], pairs=40)
    assert {way.start[0] < 4 for way in both.ways} == {True, False}
    assert (
        reach(truth, starts=[left]).reachable_area < 0.6 * reach(truth, starts=[left, right]).reachable_area
    )
    assert reach(truth, starts=[left]).reachable == 200
    # A start in the shadow of a wall stands on the floor next to it.
    assert reach(truth, starts=[Pose2(0.05, 1)]).reachable_area == reach(truth, starts=[left]).reachable_area


def test_reach_counts_parts_and_area() -> None:
    one, two = reach(two_rooms((1, 2)), pairs=50), reach(two_rooms(None), pairs=50)
    assert (one.components, one.reachable, one.pairs) == (1, 50, 50)
    assert two.components == 2
    assert 10 < two.reachable < 40
    assert two.reachable_area == pytest.approx(two.drivable_area / 2, rel=0.03)
    assert two.free_area > two.drivable_area > 0


def test_the_same_seed_draws_the_same() -> None:
    truth = office()
    one, same, other = (navigability(truth, truth, Pose2(), pairs=15, seed=s) for s in (1, 1, 2))
    assert [way.goal for way in one.ways] == [way.goal for way in same.ways]
    assert [way.goal for way in one.ways] != [way.goal for way in other.ways]
    assert len(one.ways) == 15
    assert all(way.start != way.goal for way in one.ways)


@pytest.mark.parametrize("picture", ["#", " ", ".", "###\n#.#\n###", "   "])
def test_where_a_robot_cannot_drive_there_are_no_pairs(picture: str) -> None:
    grid = drawn(picture)
    assert navigability(grid, drawn("...."), Pose2(), radius=1.5).ways == ()
    assert navigability(grid, grid, Pose2()).length_ratio is None
    assert reach(grid).pairs == 0


def test_maps_that_do_not_meet_have_no_pairs() -> None:
    assert navigability(office(), office(), Pose2(30, 0)).pairs == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"radius": -1.0}, "radius of a robot"),
        ({"radius": math.nan}, "radius of a robot"),
        ({"tolerance": -0.1}, "tolerance is a number"),
        ({"pairs": 0}, "at least 1"),
        ({"starts": []}, "empty list"),
        ({"starts": [Pose2(100, 0)]}, r"no floor .* within a metre of the start \(100.00, 0.00\)"),
    ],
)
def test_what_cannot_be_asked(change: dict[str, object], message: str) -> None:
    with pytest.raises(NavigabilityError, match=message):
        navigability(office(), office(), Pose2(), **change)  # type: ignore[arg-type]


def test_maps_absurdly_far_apart_are_refused() -> None:
    with pytest.raises(NavigabilityError, match="check how they lie"):
        navigability(office(), office(), Pose2(1e6, 0))
