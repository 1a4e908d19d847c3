import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from small import hall, two_rooms

from mapmeld.se2 import Pose2
from mapmeld.simulation import Robot
from mapmeld.simulation.grip import Grip
from mapmeld.simulation.odometry import WheelOdometry

FINE = Robot(encoder_ticks=10_000_000)


@given(st.floats(-2, 2), st.floats(-3, 3), st.integers(1, 50))
def test_arcs_are_exact_however_often_they_are_read(way: float, turn: float, readings: int) -> None:
    odometry = WheelOdometry(FINE)
    odometry.begin(0.3, -0.2)
    left = (way - turn * FINE.track / 2) / FINE.wheel_radius
    right = (way + turn * FINE.track / 2) / FINE.wheel_radius
    for i in range(1, readings + 1):
        odometry.read(0.3 + left * i / readings, -0.2 + right * i / readings)
    if abs(turn) < 1e-6:
        expected = Pose2(way, 0.0, 0.0)
    else:
        radius = way / turn
        expected = Pose2(radius * math.sin(turn), radius * (1 - math.cos(turn)), turn)
    metres, radians = odometry.pose.distance_to(expected)
    assert metres < 1e-4
    assert radians < 1e-4


def test_encoders_count_whole_ticks_and_lose_none() -> None:
    coarse = WheelOdometry(Robot(encoder_ticks=100))
    coarse.begin(0.0, 0.0)
    for i in range(1, 1001):
        coarse.read(i * 0.001 * math.tau, i * 0.001 * math.tau)
    assert coarse.pose.x == pytest.approx(math.tau * 0.06, rel=0.011)


@given(st.floats(-5, 50), st.floats(-5, 50), st.floats(0, 0.01), st.floats(0, 0.01))
def test_grip_is_smooth_and_within_bounds(x: float, y: float, dx: float, dy: float) -> None:
    grip = Grip(hall())
    assert 0.4 <= grip.at(x, y) <= 1.6
    assert abs(grip.at(x, y) - grip.at(x + dx, y + dy)) < 0.05


def test_grip_belongs_to_the_place() -> None:
    places = [(x / 3, y / 3) for x in range(20) for y in range(15)]
    here, again, elsewhere = Grip(hall()), Grip(hall()), Grip(two_rooms())
    values = [here.at(*p) for p in places]
    assert values == [again.at(*p) for p in places]
    assert values != [elsewhere.at(*p) for p in places]
    assert max(values) - min(values) > 0.5
