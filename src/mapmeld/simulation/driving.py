"""What drivers see and say, and the loop that lets them drive."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from mapmeld.recording import Scan
from mapmeld.se2 import Pose2
from mapmeld.simulation.errors import SimulationError
from mapmeld.simulation.world import World

TICK = 0.05
"""How often [s] drivers are asked, and odometry is recorded."""


class Command(NamedTuple):
    """Speed ahead [m/s] and turn rate, counterclockwise [rad/s]."""

    v: float
    w: float


STOP = Command(0.0, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """What a driver knows at a moment: as one who watches the robot from above, and its laser.

    Attributes
    ----------
    stamp
        [s]
    T_world_base
        Where the robot truly is.
    scan
        A new scan, if there is one at this moment.
    others
        Where the other robots are (x, y) [m].
    """

    stamp: float
    T_world_base: Pose2
    scan: Scan | None = None
    others: tuple[tuple[float, float], ...] = ()


class Driver(Protocol):
    """Somebody at the wheel of one robot."""

    def command(self, sight: Sight) -> Command | None:
        """Return what the robot shall do until asked again; None when the drive is over."""


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """What there is to record of one robot at one time.

    Attributes
    ----------
    stamp
        [s]
    robot
        Its number, from 0.
    T_odom_base, T_world_base
        Where odometry believes it to be (from (0, 0, 0) at the start), and where it is.
    command
        What its driver asks for from now on.
    scan
        Taken at this time; None if none was.
    """

    stamp: float
    robot: int
    T_odom_base: Pose2
    T_world_base: Pose2
    command: Command
    scan: Scan | None


def drive(world: World, drivers: Sequence[Driver], duration: float) -> Iterator[Moment]:
    """Let every robot be driven until all drivers are done, or `duration` [s] has passed.

    Yields the moments of all robots every `TICK`, first of where they stand, with scans at the
    laser's rate. A robot whose driver is done stands still.

    Raises
    ------
    SimulationError
        There is not one driver for each robot, the laser's rate is not a whole part of 20 Hz, or the
        duration is no positive number.
    """
    if not (math.isfinite(duration) and duration > 0):
        raise SimulationError(f"a drive lasts a positive number of seconds, not {duration:g}")
    count = len(world.starts)
    if len(drivers) != count:
        raise SimulationError(f"{count} robots need as many drivers, not {len(drivers)}")
    every = round(1 / (world.build.scan_rate * TICK))
    if every < 1 or abs(every * TICK * world.build.scan_rate - 1) > 1e-9:
        raise SimulationError(f"scans at {world.build.scan_rate:g} Hz do not fit into steps of {TICK} s")
    asked = [STOP] * count
    done = [False] * count
    for tick in range(round(duration / TICK) + 1):
        poses = [world.true_pose(i) for i in range(count)]
        for i in range(count):
            scan = world.scan(i) if tick % every == 0 else None
            if not done[i]:
                others = tuple((p.x, p.y) for j, p in enumerate(poses) if j != i)
                answer = drivers[i].command(Sight(world.time, poses[i], scan, others))
                done[i] = answer is None
                asked[i] = answer or STOP
                world.command(i, *asked[i])
            yield Moment(world.time, i, world.odometry(i), poses[i], asked[i], scan)
        if all(done):
            return
        world.step(TICK)
