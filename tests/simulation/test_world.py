import math

import numpy as np
import pytest
from small import fields, hall, two_rooms

from mapmeld.se2 import Pose2
from mapmeld.simulation import Box, Environment, Furniture, Kind, Robot, SimulationError, World

MIDDLE = Pose2(5.0, 3.5, 0.0)


def test_a_robot_stands_where_it_was_set_down() -> None:
    world = World(hall(), [Pose2(3, 4, 1.0)])
    metres, radians = world.true_pose(0).distance_to(Pose2(3, 4, 1.0))
    assert metres < 0.002
    assert radians < 0.002
    assert world.odometry(0) == Pose2()
    assert world.time == 0.0


def test_driving_ahead_takes_it_ahead() -> None:
    world = World(hall(), [MIDDLE])
    world.command(0, 0.8, 0.0)
    world.step(1.5)
    world.command(0, 0.0, 0.0)
    world.step(1.0)
    pose = world.true_pose(0)
    assert 1.1 < pose.x - MIDDLE.x < 1.25
    assert abs(pose.y - MIDDLE.y) < 0.02
    assert world.time == pytest.approx(2.5)
    # Odometry is close, and wrong all the same: the tyres slip.
    off, _ = (MIDDLE.inverse() @ pose).distance_to(world.odometry(0))
    assert 1e-4 < off < 0.05


def test_turning_is_counterclockwise_and_slips() -> None:
    world = World(hall(), [MIDDLE])
    world.command(0, 0.0, 1.61)
    world.step(1.0)
    world.command(0, 0.0, 0.0)
    world.step(0.5)
    turned, believed = world.true_pose(0).theta, world.odometry(0).theta
    assert 1.3 < turned < 1.65
    # The tyres turn more than the robot does, by some tenths of a percent to some percent.
    assert 1.001 * turned < believed < 1.05 * turned


def test_speeds_are_cut_to_what_the_robot_can() -> None:
    world = World(hall(), [Pose2(2, 3.5)])
    world.command(0, 5.0, 0.0)
    world.step(1.0)
    before = world.true_pose(0)
    world.step(1.0)
    assert world.true_pose(0).x - before.x == pytest.approx(0.8, rel=0.03)


def test_walls_stop_it_and_the_motors_give_in() -> None:
    world = World(hall(), [Pose2(8.5, 3.5)])
    world.command(0, 0.8, 0.0)
    world.step(2.0)
    wall = 9.5 - 0.05
    assert world.true_pose(0).x == pytest.approx(wall - world.build.radius, abs=0.02)


def test_what_a_laser_sees_in_an_empty_hall() -> None:
    world = World(hall(), [MIDDLE], seed=3)
    scan = world.scan(0)
    laser = world.build.laser
    assert scan.ranges.shape == (684,)
    assert scan.ranges.dtype == np.float32
    bearings = laser.bearings()
    at = MIDDLE @ laser.T_base_laser
    # The hall is 0.55..9.45 by 0.55..6.45 m inside.
    with np.errstate(divide="ignore"):
        x = np.where(np.cos(bearings) > 0, 9.45 - at.x, 0.55 - at.x) / np.cos(bearings)
        y = np.where(np.sin(bearings) > 0, 6.45 - at.y, 0.55 - at.y) / np.sin(bearings)
    expected = np.minimum(x, y)
    seen = expected < 4.9
    errors = scan.ranges[seen] - expected[seen]
    assert abs(errors.mean()) < 0.005
    assert 0.008 < errors.std() < 0.013
    assert np.isinf(scan.ranges[expected > 5.1]).all()
    assert scan.ranges[np.isfinite(scan.ranges)].max() <= 5.0


def test_bearings_run_over_240_degrees() -> None:
    bearings = np.degrees(Robot().laser.bearings())
    assert (bearings[0], bearings[-1]) == (pytest.approx(-120), pytest.approx(120))


def test_a_laser_sees_table_legs_and_under_the_table() -> None:
    table = Furniture(Kind.TABLE, Box(7.0, 3.5, 1.0, 1.0))
    world = World(Environment(hall().fields, (table,)), [MIDDLE])
    ahead = world.scan(0).ranges[342 - 60 : 342 + 60]
    assert ahead[58:62].min() > 4.2  # between the legs, to the wall at 9.45
    assert np.count_nonzero(ahead < 2.0) >= 4


def test_robots_see_one_another_but_not_themselves() -> None:
    world = World(hall(), [MIDDLE, Pose2(7.0, 3.5, math.pi)])
    alone = World(hall(), [MIDDLE])
    ahead = slice(340, 344)
    assert (alone.scan(0).ranges[ahead] > 4.2).all()
    gap = 7.0 - 5.0 - 0.08 - 0.2
    assert world.scan(0).ranges[ahead] == pytest.approx(gap, abs=0.05)
    assert world.scan(1).ranges[ahead] == pytest.approx(gap, abs=0.05)


def test_robots_stop_one_another() -> None:
    world = World(hall(), [MIDDLE, Pose2(6.0, 3.5, math.pi)])
    world.command(0, 0.5, 0.0)
    world.command(1, 0.5, 0.0)
    world.step(2.0)
    apart, _ = world.true_pose(0).distance_to(world.true_pose(1))
    assert apart == pytest.approx(0.4, abs=0.03)


def test_the_same_seed_gives_the_same_noise_and_motion() -> None:
    def run(seed: int) -> tuple[Pose2, np.ndarray]:
        world = World(hall(), [MIDDLE], seed)
        world.command(0, 0.5, 0.7)
        world.step(0.5)
        return world.true_pose(0), world.scan(0).ranges

    (pose, ranges), (again, same), (_, other) = run(4), run(4), run(5)
    assert pose == again
    assert np.array_equal(ranges, same)
    assert not np.array_equal(ranges, other)


def test_a_scan_carries_time_and_odometry() -> None:
    world = World(hall(), [MIDDLE])
    world.command(0, 0.5, 0.5)
    world.step(0.5)
    scan = world.scan(0)
    assert scan.stamp == world.time
    assert scan.T_odom_base == world.odometry(0)


def test_a_world_without_robots() -> None:
    world = World(hall(), [])
    world.step(0.05)
    assert world.time == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("starts", "said"),
    [
        ([Pose2(-1, 3)], "robot 1 would start outside the ground"),
        ([Pose2(4.5, 1.0)], "robot 1 would start inside something"),
        ([Pose2(2, 2), Pose2(2.1, 2)], "would start inside something"),
    ],
)
def test_starts_that_cannot_be(starts: list[Pose2], said: str) -> None:
    with pytest.raises(SimulationError, match=said):
        World(two_rooms(), starts)


def test_steps_and_commands_that_cannot_be() -> None:
    world = World(hall(), [MIDDLE])
    for dt in (0.0, -0.1, 0.01, 0.033):
        with pytest.raises(ValueError, match=r"0\.025 s"):
            world.step(dt)
    with pytest.raises(ValueError, match="finite"):
        world.command(0, math.nan, 0.0)


def test_a_robot_leaves_by_an_open_door_without_harm() -> None:
    plan = fields("8:1:1:1:7\n0:-2:-2:-2:0\n0:-2:-2:-2:-1\n0:-2:-2:-2:0\n9:1:1:1:6")
    world = World(Environment(plan), [Pose2(3.5, 2.5)])
    world.command(0, 0.8, 0.0)
    world.step(3.0)
    assert world.true_pose(0).x > 5.2
    assert np.isinf(world.scan(0).ranges[300:380]).all()
