"""How far apart two transforms are, where it matters: at the middle of what map 2 knows."""

import math

import pytest
from drawing import drawn
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.history.transforms import apart, moved, same_place
from mapmeld.se2 import Pose2

# Its known cells lie 100 m and more from the origin of its frame, their middle at (101.5, 0.5).
FAR = drawn("   ###   ", 1.0, Pose2(97.0, 0.0))
MAPS = (drawn("#"), FAR)
MIDDLE = (101.5, 0.5)


def turned_about_the_middle(radians: float) -> Pose2:
    at = Pose2(*MIDDLE)
    return at @ Pose2(0, 0, radians) @ at.inverse()


@given(st.floats(-3, 3))
def test_a_turn_about_the_middle_moves_nothing(radians: float) -> None:
    metres, turned = apart(Pose2(), turned_about_the_middle(radians), MAPS)
    assert metres == pytest.approx(0, abs=1e-9)
    assert turned == pytest.approx(abs(radians), abs=1e-9)


def test_a_turn_about_the_origin_moves_what_lies_far_from_it() -> None:
    metres, _ = apart(Pose2(), Pose2(0, 0, 0.01), MAPS)
    assert metres == pytest.approx(1.015, abs=0.001)
    assert not same_place(Pose2(), Pose2(0, 0, 0.01), MAPS)


def test_drift_is_the_same_place() -> None:
    turn = turned_about_the_middle(math.radians(4.9))
    assert same_place(Pose2(), turn, MAPS)
    assert same_place(Pose2(), Pose2(0.3, 0.39, 0), MAPS)
    assert not same_place(Pose2(), Pose2(0.3, 0.41, 0), MAPS)
    assert not same_place(Pose2(), turned_about_the_middle(math.radians(5.1)), MAPS)
    assert moved(Pose2(), Pose2(0.3, 0.4, 0), MAPS) == "moved by 0.50 m, 0.0 deg"


def test_unknown_borders_change_nothing() -> None:
    grown = (MAPS[0], FAR.extended(50, 7, 0, 3))
    T = Pose2(1, 2, 0.3)
    assert apart(Pose2(), T, grown) == pytest.approx(apart(Pose2(), T, MAPS))
