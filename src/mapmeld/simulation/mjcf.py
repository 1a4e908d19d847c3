"""Environments and robots as MJCF, the model files of MuJoCo."""

from __future__ import annotations

import math
from collections.abc import Sequence
from xml.etree import ElementTree as ET

from mapmeld.se2 import Pose2
from mapmeld.simulation.environment import Environment, Kind
from mapmeld.simulation.robot import MECABOT, Robot

TIMESTEP = 0.005  # [s]
WALL_HEIGHT = 0.6  # [m]; higher than any robot

_HEIGHTS = {Kind.CABINET: 0.5, Kind.BOX: 0.35, Kind.TABLE: 0.5, Kind.CHAIR: 0.4}
_COLOURS = {
    Kind.CABINET: "0.55 0.42 0.3 1",
    Kind.BOX: "0.6 0.55 0.4 1",
    Kind.TABLE: "0.5 0.35 0.2 1",
    Kind.CHAIR: "0.3 0.35 0.5 1",
}
_ROBOT_COLOURS = ("0.85 0.2 0.2 1", "0.2 0.35 0.85 1", "0.2 0.65 0.3 1", "0.85 0.6 0.1 1")
# Who meets whom: wheels and casters the floor; bodies the walls, furniture and one another.
_FLOOR, _OBSTACLE, _BODY = 1, 2, 4


def mjcf(environment: Environment, starts: Sequence[Pose2] = (), robot: Robot = MECABOT) -> str:
    """Return a model of an environment with robots in it.

    Robot i (from 0) has the body ``robot_i`` with a free joint of that name, the hinges
    ``robot_i_left`` and ``robot_i_right`` of its wheels with a motor of the same names, and the site
    ``robot_i_laser``.

    Parameters
    ----------
    environment
        Becomes static boxes in the world.
    starts
        Where the robots' base frames are at first, in the environment's frame.
    robot
        The build of all of them.
    """
    root = ET.Element("mujoco", model="mapmeld")
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    option = ET.SubElement(
        root,
        "option",
        timestep=_n(TIMESTEP),
        integrator="Euler",
        solver="Newton",
        cone="elliptic",
        impratio="10",
    )
    ET.SubElement(option, "flag", multiccd="disable")
    world = ET.SubElement(root, "worldbody")
    width, height = environment.size
    ET.SubElement(world, "light", pos=_v(width / 2, height / 2, 12), dir="0 0 -1", directional="true")
    ET.SubElement(
        world, "geom", name="floor", type="plane", pos=_v(width / 2, height / 2, 0),
        size=_v(width, height, 1), rgba="0.85 0.85 0.82 1", contype=str(_FLOOR), conaffinity="0",
        condim="1", friction="0.01 0.005 0.0001",
    )  # fmt: skip
    solids = [(box, WALL_HEIGHT, "0.75 0.75 0.78 1") for box in environment.walls()]
    for item in environment.furniture:
        solids += [(box, _HEIGHTS[item.kind], _COLOURS[item.kind]) for box in item.solids()]
    for box, high, colour in solids:
        ET.SubElement(
            world, "geom", type="box", pos=_v(box.x, box.y, high / 2), euler=_v(0, 0, box.theta),
            size=_v(box.length / 2, box.width / 2, high / 2), rgba=colour,
            contype=str(_OBSTACLE), conaffinity="0",
        )  # fmt: skip
    actuator = ET.SubElement(root, "actuator")
    for index, start in enumerate(starts):
        _add_robot(
            world, actuator, f"robot_{index}", start, robot, _ROBOT_COLOURS[index % len(_ROBOT_COLOURS)]
        )
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _add_robot(
    world: ET.Element, actuator: ET.Element, name: str, start: Pose2, robot: Robot, colour: str
) -> None:
    r = robot.wheel_radius
    body = ET.SubElement(world, "body", name=name, pos=_v(start.x, start.y, r), euler=_v(0, 0, start.theta))
    ET.SubElement(body, "freejoint", name=name)
    bottom = 0.03
    casters = bottom  # the ball casters fill the gap below the body
    # Heavy in the middle and low, as with a battery between the wheels; slightly behind the axle, so
    # that the robot rests on both wheels and the rear caster.
    ET.SubElement(
        body, "geom", name=name, type="cylinder", pos=_v(0, 0, (bottom + robot.height) / 2 - r),
        size=_v(robot.radius, (robot.height - bottom) / 2), mass=_n(robot.mass * 0.3), rgba=colour,
        contype=str(_BODY), conaffinity=str(_OBSTACLE | _BODY), friction="0.3 0.005 0.0001",
    )  # fmt: skip
    ET.SubElement(
        body, "geom", type="box", pos=_v(-0.015, 0, 0.02), size=_v(0.09, 0.08, 0.04),
        mass=_n(robot.mass * 0.6), rgba="0.2 0.2 0.2 1", contype="0", conaffinity="0",
    )  # fmt: skip
    for x, lift in ((0.15, 0.002), (-0.15, 0.0)):
        # A ball rolls every way, so without friction.
        ET.SubElement(
            body, "geom", type="sphere", pos=_v(x, 0, casters / 2 - r + lift), size=_n(casters / 2),
            mass="0.05", rgba="0.3 0.3 0.3 1", contype="0", conaffinity=str(_FLOOR), condim="1",
        )  # fmt: skip
    laser = robot.laser.T_base_laser
    ET.SubElement(
        body, "site", name=f"{name}_laser", pos=_v(laser.x, laser.y, robot.laser_height - r),
        euler=_v(0, 0, laser.theta), size="0.02", rgba="0.1 0.1 0.1 1",
    )  # fmt: skip
    for side, y in (("left", robot.track / 2), ("right", -robot.track / 2)):
        wheel = ET.SubElement(body, "body", name=f"{name}_{side}", pos=_v(0, y, 0))
        ET.SubElement(
            wheel,
            "joint",
            name=f"{name}_{side}",
            type="hinge",
            axis="0 1 0",
            damping="0.001",
            armature="0.005",
        )
        ET.SubElement(
            wheel, "geom", name=f"{name}_{side}", type="ellipsoid", size=_v(r, robot.wheel_width / 2, r),
            mass=_n(robot.mass * 0.05),
            rgba="0.1 0.1 0.1 1", contype="0", conaffinity=str(_FLOOR), condim="4",
            friction=f"{_n(robot.wheel_friction)} 0.003 0.0001",
        )  # fmt: skip
        ET.SubElement(
            actuator, "velocity", name=f"{name}_{side}", joint=f"{name}_{side}", kv="0.5",
            forcerange=_v(-robot.motor_torque, robot.motor_torque),
        )  # fmt: skip


def _n(number: float) -> str:
    return f"{number:.9g}" if math.isfinite(number) else "0"


def _v(*numbers: float) -> str:
    return " ".join(map(_n, numbers))
