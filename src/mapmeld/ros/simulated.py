"""Simulated robots on ROS: what they measure and where they are goes out, commands come in."""

from __future__ import annotations

import importlib.util
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from mapmeld.extras import required
from mapmeld.grid import OccupancyGrid
from mapmeld.ros import dds
from mapmeld.ros.listening import profile
from mapmeld.ros.messages import clock_message, map_message, odometry_message, pose_stamped, scan_message
from mapmeld.ros.throttle import Throttle
from mapmeld.ros.transforms import TransformPublisher, moving_transforms, static_transforms
from mapmeld.se2 import Pose2
from mapmeld.simulation.driving import Moment
from mapmeld.simulation.robot import Robot
from mapmeld.simulation.robot_topics import (
    BASE,
    LASER,
    MAP,
    ODOM,
    WORLD,
    RobotTopics,
    odometry_covariance,
    robot_names,
)

EXTRA = "ros"

OnCommand = Callable[[int, float, float], object]
"""Takes a robot's number, speed [m/s] and turn rate [rad/s]; a ValueError is a command that it refuses."""


class LiveRobots:
    """Publishes what robots would record, in the order of time; the same topics as a recording has.

    ``/clock`` has the simulated time, of which all stamps are. Stamps are in seconds.

    Parameters
    ----------
    node
        An `rclpy.node.Node`.
    build, robots
        Of all robots, and how many there are.
    on_command
        Called for each geometry_msgs/Twist on a robot's ``cmd_vel``.
    """

    def __init__(self, node: Any, build: Robot, robots: int, on_command: OnCommand) -> None:
        self._node, self._build, self._on_command = node, build, on_command
        self._robots = RobotTopics(robot_names(robots))
        self._say = Throttle(lambda text: node.get_logger().warning(text), time.monotonic)
        self._publishers: dict[str, Any] = {}
        self._stamp = -1
        self._static, self._moving = _needed(static_transforms(node)), _needed(moving_transforms(node))
        twist = required("geometry_msgs.msg", EXTRA).Twist
        self._subscriptions = [
            node.create_subscription(
                twist,
                self._robots.topic(robot, "cmd_vel"),
                lambda message, robot=robot: self._on_twist(robot, message),
                1,
            )
            for robot in range(robots)
        ]
        self._static.send(
            [
                (self._robots.frame(robot, BASE), self._robots.frame(robot, LASER), build.laser.T_base_laser)
                for robot in range(robots)
            ],
            0,
        )

    def close(self) -> None:
        """Leave."""
        self._static.close()
        self._moving.close()

    def add(self, moment: Moment) -> None:
        """Publish all that there is of a moment."""
        robot, stamp = moment.robot, _nanoseconds(moment.stamp)
        if stamp != self._stamp:
            self._stamp = stamp
            self._publish("/clock", clock_message(stamp))
        frames = self._robots.frame(robot, ODOM), self._robots.frame(robot, BASE)
        self._moving.send([(*frames, moment.T_odom_base)], stamp)
        speed = self._robots.speed(robot, moment.stamp, moment.T_odom_base)
        odometry = odometry_message(moment.T_odom_base, speed, odometry_covariance(), frames, stamp)
        self._publish(self._robots.topic(robot, "odom"), odometry)
        true_pose = pose_stamped(moment.T_world_base, WORLD, stamp)
        self._publish(self._robots.topic(robot, "ground_truth"), true_pose)
        if moment.scan is not None:
            limits = self._build.min_range, 1 / self._build.scan_rate
            frame = self._robots.frame(robot, LASER)
            scan = scan_message(self._build.laser, moment.scan.ranges, limits, frame, stamp)
            self._publish(self._robots.topic(robot, "scan"), scan)

    def add_map_frame(self, robot: int, stamp: float, T_map_odom: Pose2) -> None:
        """Publish where SLAM believes odometry's frame to lie in the map's."""
        frames = self._robots.frame(robot, MAP), self._robots.frame(robot, ODOM)
        self._moving.send([(*frames, T_map_odom)], _nanoseconds(stamp))

    def add_map(self, robot: int, stamp: float, grid: OccupancyGrid) -> None:
        """Publish a state of a robot's map, latched."""
        message = map_message(grid, self._robots.frame(robot, MAP), _nanoseconds(stamp))
        self._publish(self._robots.topic(robot, "map"), message, latched=True)

    def _publish(self, topic: str, message: Any, *, latched: bool = False) -> None:
        if topic not in self._publishers:
            quality = profile(reliable=True, latched=latched, depth=1 if latched else 10)
            self._publishers[topic] = self._node.create_publisher(type(message), topic, quality)
        self._publishers[topic].publish(message)

    def _on_twist(self, robot: int, message: Any) -> None:
        try:
            self._on_command(robot, message.linear.x, message.angular.z)
        except ValueError as error:
            topic = self._robots.topic(robot, "cmd_vel")
            self._say(topic, f"{topic} is ignored: {error}")


def _needed(transforms: TransformPublisher | None) -> TransformPublisher:
    if transforms is None:
        required("cyclonedds.domain", EXTRA)  # tells how it is installed
        raise AssertionError
    return transforms


def _nanoseconds(stamp: float) -> int:
    return round(stamp * 1e9)


@contextmanager
def live_robots(build: Robot, robots: int, on_command: OnCommand) -> Iterator[LiveRobots]:
    """Give robots on ROS, whose commands are taken in a thread while the block runs.

    Signals are left to the caller.

    Raises
    ------
    MissingExtraError
        ROS is neither installed nor there as the extra ``ros``.
    """
    rclpy = required("rclpy", EXTRA)
    for module in ("geometry_msgs.msg", "nav_msgs.msg", "rosgraph_msgs.msg", "sensor_msgs.msg"):
        required(module, EXTRA)
    executors, signals = required("rclpy.executors", EXTRA), required("rclpy.signals", EXTRA)
    if importlib.util.find_spec("tf2_msgs") is None:
        dds.prepare_fastdds()
    context = rclpy.Context()
    rclpy.init(context=context, signal_handler_options=signals.SignalHandlerOptions.NO)
    try:
        node = rclpy.create_node("mapmeld_simulation", context=context)
        live = LiveRobots(node, build, robots, on_command)
        executor = executors.SingleThreadedExecutor(context=context)
        executor.add_node(node)
        spinning = threading.Thread(target=executor.spin, name="commands", daemon=True)
        spinning.start()
        try:
            yield live
        finally:
            executor.shutdown()
            spinning.join(timeout=10)
            live.close()
            node.destroy_node()
    finally:
        context.try_shutdown()
