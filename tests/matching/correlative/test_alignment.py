import math
from dataclasses import replace

import numpy as np
import pytest
from drawing import built, office, seen_from
from hypothesis import given, settings
from hypothesis import strategies as st
from ready import rows, walls_of

from mapmeld.matching.correlative.alignment import (
    look_up,
    refine,
    robust_weights,
    to_local,
    to_metric,
    turn_and_shift,
)
from mapmeld.matching.correlative.wall_map import WallMap
from mapmeld.se2 import Pose2

# A wall along y = 3 in a room of 8 x 6 m without outer walls.
ROOM = walls_of(built(8, 6, [(2, 2.95, 6, 3.05)]))
OFFICE = walls_of(office())


def in_frame(walls: WallMap, frame: Pose2) -> WallMap:
    return replace(walls, frame=frame)


@given(*[st.from_type(Pose2)] * 3)
def test_local_and_metric_transforms_belong_together(T_a_b: Pose2, frame_a: Pose2, frame_b: Pose2) -> None:
    a, b = in_frame(ROOM, frame_a), in_frame(OFFICE, frame_b)
    t = to_local(a, b, T_a_b)
    assert to_metric(a, b, t).distance_to(T_a_b) == pytest.approx((0, 0), abs=1e-9)
    # A point of b's local frame arrives in a's whichever way it goes.
    expected = frame_a.inverse().apply(T_a_b.apply(frame_b.apply((3, 4))))
    np.testing.assert_allclose(Pose2(*t).apply((3, 4)), expected, atol=1e-9)


def test_turn_and_shift_are_the_transform() -> None:
    T = Pose2(1, -2, 0.5)
    turn, shift = turn_and_shift(rows(Pose2(), T))
    moved = turn * np.complex64(3 + 4j) + shift
    expected = T.apply((3, 4))
    np.testing.assert_allclose(moved[:, 0], [3 + 4j, expected[0] + 1j * expected[1]], rtol=1e-6)


# ---------------------------------------------------------------------- looking up
@pytest.mark.parametrize("off", [0.0, 0.2, -0.3])
@pytest.mark.parametrize("turn", [0.0, 0.6, math.pi])
def test_both_maps_see_how_far_bs_wall_lies_off_as(off: float, turn: float) -> None:
    b = walls_of(seen_from(built(8, 6, [(2, 2.98, 6, 3.02)], 0.01), Pose2(0, 0, turn), 0.05))
    T_a_b = Pose2(0, off, 0) @ Pose2(0, 0, turn).inverse()
    p = look_up(ROOM, b, to_local(ROOM, b, T_a_b)[None], 1000)
    n = len(b.points)
    assert p.x.shape == p.e.shape == (1, n + len(ROOM.points))
    # In the middle of the wall, away from its ends, e points straight across, from a's wall to b's.
    middle = np.abs(p.x.real - 4) < 1.5
    for half in (np.s_[:, :n], np.s_[:, n:]):
        assert middle[half].sum() > 20
        np.testing.assert_allclose(p.e[half][middle[half]].imag, off, atol=0.025)
        np.testing.assert_allclose(np.abs(p.normal[half][middle[half]].imag), 1, atol=0.02)
        np.testing.assert_allclose(p.depth[half][middle[half]], max(abs(off) - 0.1, 0), atol=0.13)
    across, along = p.across()
    assert np.abs(across[middle]) == pytest.approx(abs(off), abs=0.025)
    assert np.abs(along[middle]).max() < 0.13
    assert p.cosine()[middle] == pytest.approx(1, abs=0.02)
    # b's points lie where the transform puts them, a's where they are.
    np.testing.assert_allclose(p.x[0, :n].imag[middle[0, :n]], 3 + off, atol=0.025)
    np.testing.assert_array_equal(p.x[0, n:], ROOM.points)


def test_a_displacement_moves_b_further_in_both_directions() -> None:
    t = rows(Pose2(0, 0.25, 0))
    n = 2 * len(ROOM.points)
    p = look_up(ROOM, ROOM, t, 1000, np.full((1, n), -0.25j, np.complex64))
    assert np.abs(p.e).max() < 1e-5
    q = look_up(ROOM, ROOM, t, 1000, np.full((1, n), 0.1j, np.complex64))
    middle = np.abs(q.x.real - 4) < 1.5
    np.testing.assert_allclose(q.e[middle].imag, 0.35, atol=1e-4)


def test_walls_outside_the_other_map_are_nowhere() -> None:
    p = look_up(ROOM, OFFICE, rows(Pose2(100, 0, 0)), 50)
    assert (p.depth == -1).all()


def test_many_transforms_are_looked_up_as_one_by_one() -> None:
    t = rows(Pose2(0.1, 0.2, 0.3), Pose2(-5, 3, -2), Pose2(1, 1, 3))
    together = look_up(OFFICE, ROOM, t, 70)
    for k in range(3):
        alone = look_up(OFFICE, ROOM, t[k : k + 1], 70)
        for name in ("x", "e", "normal", "own", "straight", "depth"):
            np.testing.assert_array_equal(getattr(together, name)[k], getattr(alone, name)[0])


def test_weights_fall_off_with_distance_and_with_direction() -> None:
    def weight(off: float, turn: float = 0.0) -> float:
        about_middle = Pose2(4, 3 + off) @ Pose2(0, 0, turn) @ Pose2(-4, -3)
        p = look_up(ROOM, ROOM, rows(about_middle), 1000)
        near = np.abs(p.x.real - 4) < 0.2
        _, w = robust_weights(p, 0.4)
        assert (w >= 0).all()
        return float(w[near].mean())

    straight = ROOM.straight[np.abs(ROOM.points.real - 4) < 0.2].mean()
    assert weight(0.0) == pytest.approx(straight, abs=1e-3)
    assert weight(0.0) > weight(0.2) > weight(0.3) > weight(0.45) == 0
    assert weight(0.0, math.pi / 2) == 0
    assert weight(0.0, 0.1) > weight(0.0, 0.6) >= 0


# ---------------------------------------------------------------------- alignment
COARSE, FINE = (0.8, 0.6, 0.5, 0.4), (0.3, 0.25, 0.2, 0.15, 0.15)


@settings(max_examples=20)
@given(st.floats(-math.pi, math.pi), st.sampled_from([-1, 1]))
def test_walls_are_aligned_from_a_rough_guess(bearing: float, side: int) -> None:
    T = Pose2(2, -7, 0.7)
    b = walls_of(seen_from(office(), T))
    truth = to_local(OFFICE, b, T.inverse())
    off = 0.4 * np.exp(1j * bearing)
    # Turned about the middle of the office, else the turn moves it by far more than 0.4 m.
    guess = (
        Pose2(8 + off.real, 6 + off.imag) @ Pose2(0, 0, side * math.radians(3)) @ Pose2(-8, -6) @ T.inverse()
    )
    t = to_local(OFFICE, b, guess)[None]
    found = refine(OFFICE, b, refine(OFFICE, b, t, COARSE, 300), FINE, 600)[0]
    off_m, off_rad = to_metric(OFFICE, b, found).distance_to(to_metric(OFFICE, b, truth))
    assert off_m < 0.02
    assert off_rad < math.radians(0.1)


def test_refining_leaves_its_input_alone() -> None:
    t = rows(Pose2(0.2, 0.1, 0.01))
    before = t.copy()
    assert (refine(OFFICE, OFFICE, t, FINE, 300) != before).any()
    np.testing.assert_array_equal(t, before)


def test_many_transforms_are_refined_as_one_by_one() -> None:
    t = rows(Pose2(0.2, 0.1, 0.01), Pose2(-0.2, 0.1, -0.02), Pose2(5, 5, 2))
    together = refine(OFFICE, OFFICE, t, FINE, 300)
    for k in range(3):
        np.testing.assert_allclose(together[k], refine(OFFICE, OFFICE, t[k : k + 1], FINE, 300)[0], atol=1e-5)


def test_what_nothing_fixes_stays_where_it_was() -> None:
    # One wall says nothing of the place along it.
    found = refine(ROOM, ROOM, rows(Pose2(0.5, 0.2, 0.02)), FINE, 300)[0]
    middle = Pose2(*found).apply((4, 3))
    assert middle[1] == pytest.approx(3, abs=0.02)
    assert middle[0] == pytest.approx(4.5, abs=0.15)


def test_walls_too_far_apart_do_not_pull() -> None:
    t = rows(Pose2(0, 1.5, 0))
    np.testing.assert_allclose(refine(ROOM, ROOM, t, COARSE, 300), t, atol=1e-9)
