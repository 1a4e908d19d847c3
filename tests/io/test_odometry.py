"""Odometry between its poses."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.io.odometry import OdometryTrack, between
from mapmeld.se2 import Pose2


def track(*stamps: float) -> OdometryTrack:
    found = OdometryTrack()
    for stamp in stamps:
        found.add(stamp, Pose2(stamp, 0.0, 0.0))
    return found


@given(st.from_type(Pose2), st.from_type(Pose2), st.floats(0, 1))
def test_what_lies_between_turns_the_shorter_way(a: Pose2, b: Pose2, part: float) -> None:
    found = between(a, b, part)
    whole = a.distance_to(b)
    there, back = a.distance_to(found), found.distance_to(b)
    assert there[0] + back[0] == pytest.approx(whole[0], abs=1e-6)
    assert there[1] + back[1] == pytest.approx(whole[1], abs=1e-6)
    assert there[1] == pytest.approx(part * whole[1], abs=1e-6)


def test_over_the_seam_of_angles() -> None:
    assert between(Pose2(0, 0, math.radians(170)), Pose2(0, 0, math.radians(-170)), 0.75).theta == (
        pytest.approx(math.radians(-175))
    )


def test_poses_are_found_by_time() -> None:
    found = track(1.0, 1.5, 2.0)
    for stamp in (1.0, 1.2, 1.5, 1.9, 2.0):
        pose = found.at(stamp)
        assert pose is not None
        assert pose.x == pytest.approx(stamp)


@pytest.mark.parametrize(("stamp", "x"), [(0.9, 1.0), (2.1, 2.0), (0.7, None), (2.3, None)])
def test_just_outside_the_nearest_pose_is_taken(stamp: float, x: float | None) -> None:
    pose = track(1.0, 1.5, 2.0).at(stamp)
    assert (pose and pose.x) == x


def test_gaps_are_not_bridged() -> None:
    assert track(1.0, 3.0).at(2.0) is None
    assert track().at(1.0) is None
    assert track(1.0, 3.0).at(3.0) == Pose2(3.0)


def test_older_poses_are_passed_over_and_very_old_ones_forgotten() -> None:
    found = track(5.0, 4.0, 5.5)
    assert found.latest == 5.5
    assert found.at(4.0) is None
    found = track(*[n * 0.5 for n in range(100)])
    assert len(found._poses) <= 21
