"""Drives as recordings: MCAP files with ROS 2 messages, as Foxglove and rosbag2 open them."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from mapmeld import __version__
from mapmeld.extras import required
from mapmeld.grid import OccupancyGrid
from mapmeld.io import AnyPath, MapFileError
from mapmeld.io.atomic import whole_file
from mapmeld.se2 import Pose2
from mapmeld.simulation.driving import Command, Moment
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

EXTRA = "sim"

# Durations of "for ever", as rosbag2 writes them.
_QOS = """\
- history: {history}
  depth: {depth}
  reliability: 1
  durability: {durability}
  deadline: {{sec: 9223372036, nsec: 854775807}}
  lifespan: {{sec: 9223372036, nsec: 854775807}}
  liveliness: 1
  liveliness_lease_duration: {{sec: 9223372036, nsec: 854775807}}
  avoid_ros_namespace_conventions: false
"""
_VOLATILE = _QOS.format(history=1, depth=10, durability=2)
_LATCHED = _QOS.format(history=1, depth=1, durability=1)


@contextmanager
def recording_to(
    path: AnyPath, build: Robot, robots: int = 1, *, force: bool = False
) -> Iterator[RecordingWriter]:
    """Give a writer whose recording appears at `path`, whole, when the block ends without an error.

    Raises
    ------
    MapFileError
        As `mapmeld.io.atomic.whole_file`.
    MissingExtraError
        The libraries for recordings are not installed.
    """
    writing = required("mcap.writer", EXTRA)
    with whole_file(path, force=force) as file:
        writer = RecordingWriter(file, writing, build, robot_names(robots))
        yield writer
        try:
            writer.finish()
        except OSError as error:
            raise MapFileError.of(path, f"cannot be written: {error.strerror or error}") from error


class RecordingWriter:
    """Writes what robots record, in the order of time.

    Topics (those of several robots in their namespaces, as ``/robot_1/scan``):

    - ``scan`` sensor_msgs/LaserScan, ``odom`` nav_msgs/Odometry, ``cmd_vel`` geometry_msgs/Twist,
      ``map`` nav_msgs/OccupancyGrid if maps are given;
    - ``ground_truth`` geometry_msgs/PoseStamped: where the base frame truly is;
    - ``/tf`` odom to base_link, and map to odom if that is given; ``/tf_static`` base_link to laser.
    """

    def __init__(self, file: BinaryIO, writing: Any, build: Robot, names: Sequence[str]) -> None:
        self._robots, self._build = RobotTopics(names), build
        self._store = _store()
        self._kinds = self._store.types
        self._writer = writing.Writer(file, compression=writing.CompressionType.ZSTD)
        self._writer.start(profile="ros2", library=f"mapmeld {__version__}")
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._said: dict[int, Command] = {}
        self.scans = self.maps = 0
        T_base_laser = build.laser.T_base_laser
        height = build.laser_height
        transforms = [
            self._transform(
                0.0, self._robots.frame(i, BASE), self._robots.frame(i, LASER), T_base_laser, height
            )
            for i in range(len(self._robots.names))
        ]
        self._write("/tf_static", "tf2_msgs/msg/TFMessage", 0.0, _LATCHED, transforms=transforms)

    def finish(self) -> None:
        """Write the index; nothing can be added after it."""
        self._writer.finish()

    # ------------------------------------------------------------------ what is recorded
    def add(self, moment: Moment) -> None:
        """Write all that there is to record of a moment."""
        robot, stamp = moment.robot, moment.stamp
        odom, base = self._robots.frame(robot, ODOM), self._robots.frame(robot, BASE)
        self._write(
            self._robots.topic(robot, "ground_truth"), "geometry_msgs/msg/PoseStamped", stamp, _VOLATILE,
            header=self._header(stamp, WORLD), pose=self._pose(moment.T_world_base),
        )  # fmt: skip
        self._write(
            "/tf", "tf2_msgs/msg/TFMessage", stamp, _VOLATILE,
            transforms=[self._transform(stamp, odom, base, moment.T_odom_base)],
        )  # fmt: skip
        v, w = self._robots.speed(robot, stamp, moment.T_odom_base)
        self._write(
            self._robots.topic(robot, "odom"), "nav_msgs/msg/Odometry", stamp, _VOLATILE,
            header=self._header(stamp, odom), child_frame_id=base,
            pose=self._kind("geometry_msgs/msg/PoseWithCovariance")(
                pose=self._pose(moment.T_odom_base), covariance=odometry_covariance()
            ),
            twist=self._kind("geometry_msgs/msg/TwistWithCovariance")(
                twist=self._twist(v, w), covariance=odometry_covariance()
            ),
        )  # fmt: skip
        if moment.scan is not None:
            self._scan(robot, stamp, moment.scan.ranges)
        if self._said.get(robot) != moment.command:
            self._said[robot] = moment.command
            twist = self._twist(*moment.command)
            self._write(
                self._robots.topic(robot, "cmd_vel"), "geometry_msgs/msg/Twist", stamp, _VOLATILE,
                linear=twist.linear, angular=twist.angular,
            )  # fmt: skip

    def add_map_frame(self, robot: int, stamp: float, T_map_odom: Pose2) -> None:
        """Write where SLAM believes odometry's frame to lie in the map's."""
        frames = self._robots.frame(robot, MAP), self._robots.frame(robot, ODOM)
        self._write(
            "/tf", "tf2_msgs/msg/TFMessage", stamp, _VOLATILE,
            transforms=[self._transform(stamp, *frames, T_map_odom)],
        )  # fmt: skip

    def add_map(self, robot: int, stamp: float, grid: OccupancyGrid) -> None:
        """Write a state of a robot's map that is published at a time.

        Its frame is the grid's, or ``map`` where that is empty; its own stamp is the grid's, if that has one.
        """
        rows, cols = grid.shape
        made = stamp if grid.stamp is None else grid.stamp
        info = self._kind("nav_msgs/msg/MapMetaData")(
            map_load_time=self._time(made), resolution=grid.resolution, width=cols, height=rows,
            origin=self._pose(grid.origin),
        )  # fmt: skip
        self._write(
            self._robots.topic(robot, "map"), "nav_msgs/msg/OccupancyGrid", stamp, _LATCHED,
            header=self._header(made, grid.frame_id or self._robots.frame(robot, MAP)), info=info,
            data=grid.cells.reshape(-1),
        )  # fmt: skip
        self.maps += 1

    def _scan(self, robot: int, stamp: float, ranges: NDArray[np.float32]) -> None:
        laser = self._build.laser
        self._write(
            self._robots.topic(robot, "scan"), "sensor_msgs/msg/LaserScan", stamp, _VOLATILE,
            header=self._header(stamp, self._robots.frame(robot, LASER)),
            angle_min=laser.first_angle, angle_max=laser.first_angle + (laser.beams - 1) * laser.step,
            angle_increment=laser.step, time_increment=0.0, scan_time=1 / self._build.scan_rate,
            range_min=self._build.min_range, range_max=laser.max_range,
            ranges=ranges, intensities=np.empty(0, np.float32),
        )  # fmt: skip
        self.scans += 1

    # ------------------------------------------------------------------ messages
    def _kind(self, name: str) -> Any:
        return self._kinds[name]

    def _time(self, stamp: float) -> Any:
        seconds, rest = divmod(round(stamp * 1e9), 10**9)
        return self._kind("builtin_interfaces/msg/Time")(sec=seconds, nanosec=rest)

    def _header(self, stamp: float, frame: str) -> Any:
        return self._kind("std_msgs/msg/Header")(stamp=self._time(stamp), frame_id=frame)

    def _vector(self, x: float, y: float, z: float) -> Any:
        return self._kind("geometry_msgs/msg/Vector3")(x=x, y=y, z=z)

    def _turn(self, theta: float) -> Any:
        return self._kind("geometry_msgs/msg/Quaternion")(
            x=0.0, y=0.0, z=math.sin(theta / 2), w=math.cos(theta / 2)
        )

    def _pose(self, pose: Pose2) -> Any:
        return self._kind("geometry_msgs/msg/Pose")(
            position=self._kind("geometry_msgs/msg/Point")(x=pose.x, y=pose.y, z=0.0),
            orientation=self._turn(pose.theta),
        )

    def _twist(self, v: float, w: float) -> Any:
        return self._kind("geometry_msgs/msg/Twist")(
            linear=self._vector(v, 0.0, 0.0), angular=self._vector(0.0, 0.0, w)
        )

    def _transform(self, stamp: float, parent: str, child: str, pose: Pose2, z: float = 0.0) -> Any:
        return self._kind("geometry_msgs/msg/TransformStamped")(
            header=self._header(stamp, parent),
            child_frame_id=child,
            transform=self._kind("geometry_msgs/msg/Transform")(
                translation=self._vector(pose.x, pose.y, z), rotation=self._turn(pose.theta)
            ),
        )

    def _write(self, topic: str, kind: str, stamp: float, qos: str, **fields: Any) -> None:
        if topic not in self._channels:
            if kind not in self._schemas:
                definition, _ = self._store.generate_msgdef(kind, ros_version=2)
                self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", definition.encode())
            self._channels[topic] = self._writer.register_channel(
                topic, "cdr", self._schemas[kind], metadata={"offered_qos_profiles": qos}
            )
        data = bytes(self._store.serialize_cdr(self._kind(kind)(**fields), kind))
        when = round(stamp * 1e9)
        self._writer.add_message(self._channels[topic], log_time=when, publish_time=when, data=data)


def read_drive(path: AnyPath) -> tuple[Pose2, tuple[tuple[float, Command], ...]]:
    """Read from a recording of one robot where it set out and what it was told to do.

    Returns
    -------
    The start in the world's frame, and stamps [s after the first message on ``ground_truth``] with
    commands.

    Raises
    ------
    MapFileError
        The file is damaged, or has no such topics.
    MissingExtraError
        The libraries for recordings are not installed.
    """
    reading = required("mcap.reader", EXTRA)
    start: Pose2 | None = None
    begun = 0
    commands: list[tuple[float, Command]] = []
    try:
        with open(path, "rb") as file:  # noqa: PTH123  (the path is kept as it was given)
            store = _store()
            messages = reading.make_reader(file).iter_messages(["/ground_truth", "/cmd_vel"])
            for schema, channel, message in messages:
                content = store.deserialize_cdr(message.data, schema.name)
                if channel.topic == "/cmd_vel":
                    command = Command(float(content.linear.x), float(content.angular.z))
                    if not all(map(math.isfinite, command)):
                        raise MapFileError.of(path, "has a speed on /cmd_vel that is not finite")
                    commands.append(((message.log_time - begun) / 1e9, command))
                elif start is None:
                    begun = message.log_time
                    turn, place = content.pose.orientation, content.pose.position
                    start = Pose2(float(place.x), float(place.y), 2 * math.atan2(turn.z, turn.w))
    except (MapFileError, KeyboardInterrupt):
        raise
    except OSError as error:
        raise MapFileError.of(path, f"cannot be read: {error.strerror or error}") from error
    except Exception as error:  # the libraries fail in many ways on a file that is damaged
        raise MapFileError.of(path, f"is no recording that can be read: {error}") from error
    if start is None or not commands:
        raise MapFileError.of(path, "has no topics /ground_truth and /cmd_vel, so it is no route")
    return start, tuple(commands)


@functools.cache
def _store() -> Any:
    typesys = required("rosbags.typesys", EXTRA)
    return typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
