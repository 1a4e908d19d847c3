"""Simulated robots on real middleware: the simulator, the node and who listens are processes of their own."""

import importlib.util
import math
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from live_system import LiveSystem, environment, live_system, reserved_domain, until

from mapmeld.io.recordings import map_states
from mapmeld.se2 import Pose2

NEEDED = ("rclpy", "nav_msgs", "diagnostic_msgs", "std_srvs", "cyclonedds", "mujoco", "numba")
missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(
        bool(missing), reason='needs ROS 2 middleware and a simulator: pip install "mapmeld[ros,sim]"'
    ),
]


@contextmanager
def simulated(domain: int, folder: Path, *options: str) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "mapmeld", "simulate", "--ros", *options]
    log = folder / "simulated.log"
    with log.open("w") as file:
        process = subprocess.Popen(
            command, env=environment(domain), stdout=file, stderr=file, cwd=folder, text=True
        )
    try:
        yield process
    except BaseException:
        print(log.read_text(), file=sys.stderr)
        raise
    finally:
        process.terminate()
        assert process.wait(timeout=20) == 0, log.read_text()
    assert "Traceback" not in log.read_text()


def true_starts(recording: Path) -> dict[str, Pose2]:
    from rosbags.highlevel import AnyReader

    with AnyReader([recording]) as reader:
        connections = {c.topic: c for c in reader.connections}
        starts = {}
        for name in ("robot_1", "robot_2"):
            connection = connections[f"/{name}/ground_truth"]
            _, _, data = next(reader.messages([connection]))
            message: Any = reader.deserialize(data, connection.msgtype)
            turn, place = message.pose.orientation, message.pose.position
            starts[name] = Pose2(float(place.x), float(place.y), 2 * math.atan2(turn.z, turn.w))
    return starts


def found(system: LiveSystem) -> list[Pose2]:
    """T_1_2 of all that was said of both on /tf_static."""
    said = []
    for transforms in system.listener.transforms:
        if all(transforms.get(f"{name}/map", ("",))[0] == "world" for name in ("robot_1", "robot_2")):
            said.append(transforms["robot_1/map"][1].inverse() @ transforms["robot_2/map"][1])
    return said


def test_two_simulated_robots_from_nothing_to_a_merged_map() -> None:
    """Our own SLAM on board of both, as fast as it goes, in simulated time."""
    arguments = ("-p", "use_sim_time:=true", "-p", "estimation_rate:=5.0")
    with live_system(*arguments) as system:
        options = ("--robots", "2", "--slam", "--drive", "tour", "--seed", "3", "--speed", "20")
        recording = system.folder / "run.mcap"
        with simulated(system.domain, system.folder, *options, "-o", str(recording)):
            until(lambda: found(system), "the two to be joined")
            until(lambda: float(system.listener.pair("robot_1", "robot_2")["overlap"]) > 0.5, "more overlap")
            until(lambda: system.listener.merged, "a merged map")
            merged = system.listener.merged[-1]
        # It was asked to end: what was recorded until then is whole, and has the truth.
        starts = true_starts(recording)
        truth = starts["robot_1"].inverse() @ starts["robot_2"]
        for T in found(system):
            metres, radians = T.distance_to(truth)
            assert metres < 0.5
            assert radians < math.radians(3)
        areas = [list(map_states(recording, f"/{name}/map"))[-1].known_area for name in starts]
        assert max(areas) * 0.5 < merged.known_area < sum(areas)
        assert merged.stamp is not None
        assert 0 < merged.stamp < 1000, "the node's time is the simulation's"


class Watcher:
    """What is on the topics of a single robot, as ROS's own programs would see it."""

    def __init__(self, domain: int) -> None:
        import rclpy
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic
        from geometry_msgs.msg import Twist
        from nav_msgs.msg import Odometry
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.qos import qos_profile_sensor_data
        from rosgraph_msgs.msg import Clock
        from sensor_msgs.msg import LaserScan

        from mapmeld.ros import dds
        from mapmeld.ros.dds_types import TFMessage

        dds.prepare_fastdds()
        self.newest: dict[str, Any] = {}
        self.frames: dict[str, set[tuple[str, str]]] = {"/tf": set(), "/tf_static": set()}
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain)
        self._node = rclpy.create_node("watcher", context=self._context)
        for kind, topic in ((Odometry, "/odom"), (LaserScan, "/scan"), (Clock, "/clock")):
            self._node.create_subscription(
                kind,
                topic,
                lambda message, topic=topic: self.newest.__setitem__(topic, message),
                qos_profile_sensor_data,
            )
        self.twist = Twist
        self._commands = self._node.create_publisher(Twist, "/cmd_vel", 10)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        participant = dds.participant(domain)
        self._readers = {
            name: DataReader(
                participant,
                Topic(participant, f"rt{name}", TFMessage, qos=dds.quality(latched=name == "/tf_static")),
                qos=dds.quality(latched=name == "/tf_static"),
            )
            for name in self.frames
        }

    def look(self) -> None:
        for _ in range(10):
            self._executor.spin_once(timeout_sec=0.01)
        for name, reader in self._readers.items():
            for message in reader.take(100):
                if hasattr(message, "transforms"):
                    self.frames[name] |= {(t.header.frame_id, t.child_frame_id) for t in message.transforms}

    def drive(self, v: float, w: float) -> None:
        message = self.twist()
        message.linear.x, message.angular.z = v, w
        self._commands.publish(message)

    def time(self) -> float:
        clock = self.newest["/clock"].clock
        return float(clock.sec + clock.nanosec / 1e9)

    def speed(self) -> tuple[float, float]:
        twist = self.newest["/odom"].twist.twist
        return float(twist.linear.x), float(twist.angular.z)

    def close(self) -> None:
        self._node.destroy_node()
        self._executor.shutdown()
        self._context.try_shutdown()


def test_a_simulated_robot_is_watched_and_driven_by_topics(tmp_path: Path) -> None:
    with reserved_domain() as domain, simulated(domain, tmp_path, "--seed", "3", "--speed", "2"):
        watcher = Watcher(domain)
        try:

            def seen() -> bool:
                watcher.look()
                return set(watcher.newest) == {"/odom", "/scan", "/clock"} and all(watcher.frames.values())

            until(seen, "all topics")
            assert watcher.frames == {
                "/tf": {("odom", "base_link")}, "/tf_static": {("base_link", "laser")},
            }  # fmt: skip
            scan, odometry = watcher.newest["/scan"], watcher.newest["/odom"]
            assert scan.header.frame_id == "laser"
            assert len(scan.ranges) == round((scan.angle_max - scan.angle_min) / scan.angle_increment) + 1
            assert min(scan.ranges) < scan.range_max
            assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")
            assert watcher.speed() == pytest.approx((0, 0), abs=0.01)

            def turns(w: float) -> bool:
                watcher.drive(0.0, w)
                watcher.look()
                return watcher.speed() == pytest.approx((0.0, w), abs=0.1)

            until(lambda: turns(0.8), "it to turn left")
            began = watcher.time()
            assert abs(watcher.newest["/odom"].header.stamp.sec - began) < 5, "stamps are of /clock"
            # What is no number is refused, and said once; the last command goes on.
            for _ in range(3):
                watcher.drive(math.nan, 0.0)
                watcher.look()
            log = tmp_path / "simulated.log"
            until(lambda: "/cmd_vel is ignored" in log.read_text(), "the warning")
            assert log.read_text().count("/cmd_vel is ignored") == 1
            until(lambda: turns(-0.5), "it to turn right")
            until(lambda: turns(0.0), "it to stand still")
            assert watcher.time() > began
        finally:
            watcher.close()
