import math

import pytest
from small import hall

from mapmeld.se2 import Pose2
from mapmeld.simulation import STOP, TICK, Command, Robot, Sight, SimulationError, World, drive


class Script:
    """Says what it was given, then that it is done."""

    def __init__(self, *commands: Command) -> None:
        self.commands = list(commands)
        self.seen: list[Sight] = []

    def command(self, sight: Sight) -> Command | None:
        self.seen.append(sight)
        return self.commands.pop(0) if self.commands else None


def test_moments_come_at_every_tick_and_scans_at_the_lasers_rate() -> None:
    world = World(hall(), [Pose2(3, 3)])
    driver = Script(*[Command(0.4, 0.0)] * 6)
    moments = list(drive(world, [driver], 10.0))
    assert [m.stamp for m in moments] == pytest.approx([i * TICK for i in range(7)])
    assert [m.scan is not None for m in moments] == [True, False] * 3 + [True]
    assert [m.command for m in moments] == [Command(0.4, 0.0)] * 6 + [STOP]
    assert moments[0].T_odom_base == Pose2()
    assert moments[-1].T_world_base.x > 3.02
    assert [s.scan is not None for s in driver.seen] == [m.scan is not None for m in moments]
    assert driver.seen[0].others == ()


def test_who_is_done_stands_still_while_others_drive() -> None:
    world = World(hall(), [Pose2(2, 2), Pose2(2, 5)])
    first, second = Script(), Script(*[Command(0.4, 0.0)] * 20)
    moments = list(drive(world, [first, second], 10.0))
    assert len(first.seen) == 1
    assert len(second.seen) == 21
    assert {m.robot for m in moments} == {0, 1}
    ((x, y),) = second.seen[0].others
    assert math.dist((x, y), (2, 2)) < 0.01
    assert abs(world.true_pose(0).x - 2) < 0.01
    assert world.true_pose(1).x > 2.2


def test_the_duration_ends_a_drive() -> None:
    world = World(hall(), [Pose2(3, 3)])
    moments = list(drive(world, [Script(*[STOP] * 100)], 0.5))
    assert moments[-1].stamp == pytest.approx(0.5)


@pytest.mark.parametrize("duration", [0.0, -1.0, math.nan, math.inf])
def test_durations_that_cannot_be(duration: float) -> None:
    with pytest.raises(SimulationError, match="positive"):
        next(drive(World(hall(), [Pose2(3, 3)]), [Script()], duration))


def test_as_many_drivers_as_robots_and_a_rate_that_fits() -> None:
    with pytest.raises(SimulationError, match="1 robots need as many drivers, not 0"):
        next(drive(World(hall(), [Pose2(3, 3)]), [], 1.0))
    odd = World(hall(), [Pose2(3, 3)], build=Robot(scan_rate=15.0))
    with pytest.raises(SimulationError, match="15 Hz"):
        next(drive(odd, [Script()], 1.0))
