import math

import numpy as np
import pytest
from drawing import cut, hall, office, row_of_rooms, school, seen_from
from hypothesis import given, settings
from hypothesis import strategies as st
from ready import reduced

from mapmeld.matching.correlative.search import (
    APART_METRES,
    APART_RADIANS,
    LISTED,
    Hypothesis,
    _distinct,
    search,
)
from mapmeld.se2 import Pose2

A = office()
OFFICE = reduced(A)


def off(found: Pose2, truth: Pose2, at: tuple[float, float] = (8.0, 6.0)) -> tuple[float, float]:
    point = truth.inverse().apply(at)
    return float(np.hypot(*(found.apply(point) - at))), math.degrees(found.distance_to(truth)[1])


def assert_first(found: list[Hypothesis], truth: Pose2) -> None:
    metres, degrees = off(found[0].T_a_b, truth)
    assert metres < 0.3
    assert degrees < 2.1
    assert [h.score for h in found] == sorted((h.score for h in found), reverse=True)


@settings(max_examples=15)
@given(st.floats(-math.pi, math.pi))
def test_the_truth_comes_first_for_any_turn(turn: float) -> None:
    T = Pose2(2, -7, turn)
    assert_first(search(OFFICE, reduced(seen_from(A, T))), T.inverse())


@pytest.mark.parametrize("quarter", range(4))
def test_the_truth_comes_first_for_parts(quarter: int) -> None:
    T = Pose2(-5, 3, 0.4 + quarter * math.pi / 2)
    a, b = reduced(cut(A, 0, 0, 11, 12)), reduced(seen_from(cut(A, 5, 0, 16, 12), T))
    assert_first(search(a, b), T.inverse())


@pytest.mark.parametrize("resolutions", [(0.02, 0.2), (0.1, 0.05), (0.04, 0.07)])
def test_the_truth_comes_first_for_mixed_resolutions(resolutions: tuple[float, float]) -> None:
    T = Pose2(2, -7, 1.0)
    fine = office(0.02)
    a, b = (seen_from(fine, P, r) for P, r in zip((Pose2(), T), resolutions, strict=True))
    assert_first(search(reduced(a), reduced(b)), T.inverse())


def test_frames_move_along() -> None:
    T_1_a, T_2_b = Pose2(100, -30, 2), Pose2(-7, 5, -1)
    still = search(OFFICE, reduced(school()))
    moved = search(reduced(A.moved(T_1_a)), reduced(school().moved(T_2_b)))
    for one, other in zip(still, moved, strict=True):
        assert (T_1_a @ one.T_a_b @ T_2_b.inverse()).distance_to(other.T_a_b) == pytest.approx(
            (0, 0), abs=1e-6
        )
        assert one.score == other.score


def test_both_ways_of_a_symmetric_hall_are_listed() -> None:
    T = Pose2(1, 2, 0.7)
    found = search(reduced(hall()), reduced(seen_from(hall(), T)))
    half_turn = Pose2(14, 8, math.pi)
    for truth in (T.inverse(), half_turn @ T.inverse()):
        assert any(off(h.T_a_b, truth, (7.0, 4.0))[0] < 0.4 for h in found[:2])


def test_every_room_of_a_row_is_listed() -> None:
    g = row_of_rooms(6)
    a, b = reduced(cut(g, 1, 0, 15, 5)), reduced(cut(g, 5, 0, 19, 5))
    found = search(a, b)
    for x in (0, -4, -8):
        assert any(off(h.T_a_b, Pose2(x, 0, 0), (8.0, 2.5))[0] < 0.4 for h in found[:12]), x


def test_the_list_is_no_longer_than_asked_for_and_repeats_nothing() -> None:
    b = reduced(school())
    everything = search(OFFICE, b)
    assert len(everything) <= LISTED
    assert search(OFFICE, b, 5) == everything[:5]
    assert len(everything) > 5


def test_small_maps_are_searched_too() -> None:
    corner = reduced(cut(A, 0, 0, 1, 1))
    assert search(OFFICE, corner, 3)
    assert search(corner, corner, 3)[0].score > 0


# ---------------------------------------------------------------------- the list
def kept(*poses: tuple[float, float, float]) -> list[tuple[float, ...]]:
    scored = np.array([(*pose, 1 - 0.001 * i) for i, pose in enumerate(poses)]).reshape(-1, 4)
    return [tuple(row[:3].tolist()) for row in _distinct(scored)]


def test_what_is_near_a_better_one_is_left_out() -> None:
    a_bit, more = 0.9 * APART_METRES, 1.1 * APART_METRES
    assert kept((0, 0, 0), (a_bit, 0, 0)) == [(0, 0, 0)]
    assert kept((0, 0, 0), (0, more, 0)) == [(0, 0, 0), (0, more, 0)]
    assert kept((0, 0, 0), (0, 0, 1.1 * APART_RADIANS)) == [(0, 0, 0), (0, 0, 1.1 * APART_RADIANS)]
    assert kept((0, 0, 0), (a_bit, 0, 0.9 * APART_RADIANS)) == [(0, 0, 0)]
    assert kept((0, 0, math.pi - 0.01), (0, 0, 0.01 - math.pi)) == [(0, 0, math.pi - 0.01)]
    # What was left out leaves nothing out itself.
    assert kept((0, 0, 0), (a_bit, 0, 0), (2 * a_bit, 0, 0)) == [(0, 0, 0), (2 * a_bit, 0, 0)]


def test_the_list_ends() -> None:
    assert kept() == []
    many = [(float(k), 0.0, 0.0) for k in range(3 * LISTED)]
    assert kept(*many) == many[:LISTED]
