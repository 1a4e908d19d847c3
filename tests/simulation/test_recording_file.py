import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mcap.reader
import numpy as np
import pytest
from drawing import drawn
from rosbags.highlevel import AnyReader
from small import hall

from mapmeld.io import MapFileError
from mapmeld.se2 import Pose2
from mapmeld.simulation import MECABOT, Command, CommandLogDriver, Moment, World, drive
from mapmeld.simulation.recording_file import read_drive, recording_to

COMMANDS = ((0.0, Command(0.6, 0.3)), (0.5, Command(0.0, -1.0)), (0.8, Command(0.0, 0.0)))
STARTS = [Pose2(3.0, 3.0, 0.5), Pose2(7.0, 4.0, -2.0)]


def recorded(path: Path, robots: int = 1) -> list[Moment]:
    world = World(hall(), STARTS[:robots])
    drivers = [CommandLogDriver(COMMANDS) for _ in range(robots)]
    moments = []
    with recording_to(path, world.build, robots) as recording:
        for moment in drive(world, drivers, 5.0):
            recording.add(moment)
            moments.append(moment)
        recording.add_map(0, world.time, drawn("#.\n ."))
    return moments


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Moment]]:
    path = tmp_path_factory.mktemp("run") / "run.mcap"
    return path, recorded(path)


def messages(path: Path, topic: str) -> Iterator[tuple[int, Any]]:
    with AnyReader([path]) as reader:
        wanted = [c for c in reader.connections if c.topic == topic]
        assert wanted, topic
        for connection, stamp, data in reader.messages(wanted):
            yield stamp, reader.deserialize(data, connection.msgtype)


def test_topics_and_types(run: tuple[Path, list[Moment]]) -> None:
    with AnyReader([run[0]]) as reader:
        found = {c.topic: (c.msgtype, c.msgcount) for c in reader.connections}
    assert found == {
        "/tf_static": ("tf2_msgs/msg/TFMessage", 1),
        "/tf": ("tf2_msgs/msg/TFMessage", 17),
        "/odom": ("nav_msgs/msg/Odometry", 17),
        "/ground_truth": ("geometry_msgs/msg/PoseStamped", 17),
        "/scan": ("sensor_msgs/msg/LaserScan", 9),
        "/cmd_vel": ("geometry_msgs/msg/Twist", 3),
        "/map": ("nav_msgs/msg/OccupancyGrid", 1),
    }


def test_the_file_is_mcap_of_the_ros2_profile(run: tuple[Path, list[Moment]]) -> None:
    with run[0].open("rb") as file:
        reader = mcap.reader.make_reader(file)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary is not None
        assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}
        assert {channel.message_encoding for channel in summary.channels.values()} == {"cdr"}
        latched = {
            channel.topic: "durability: 1" in channel.metadata["offered_qos_profiles"]
            for channel in summary.channels.values()
        }
        assert [topic for topic, kept in sorted(latched.items()) if kept] == ["/map", "/tf_static"]
        assert summary.statistics is not None
        assert summary.statistics.message_count == sum(1 for _ in reader.iter_messages())


def test_scans_come_back(run: tuple[Path, list[Moment]]) -> None:
    scans = [m for m in run[1] if m.scan is not None]
    found = list(messages(run[0], "/scan"))
    assert len(found) == len(scans)
    for (stamp, message), moment in zip(found, scans, strict=True):
        assert moment.scan is not None
        assert np.array_equal(message.ranges, moment.scan.ranges)
        assert stamp == round(moment.stamp * 1e9)
        assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == stamp
        assert message.header.frame_id == "laser"
    laser = MECABOT.laser
    assert message.angle_min == pytest.approx(-math.radians(120))
    assert message.angle_max == pytest.approx(math.radians(120))
    assert message.angle_min + 683 * message.angle_increment == pytest.approx(message.angle_max)
    assert (message.range_max, message.scan_time) == (laser.max_range, pytest.approx(0.1))


def test_poses_come_back(run: tuple[Path, list[Moment]]) -> None:
    for topic, frame in (("/odom", "odom"), ("/ground_truth", "world")):
        for (_, message), moment in zip(messages(run[0], topic), run[1], strict=True):
            pose = message.pose.pose if topic == "/odom" else message.pose
            wanted = moment.T_odom_base if topic == "/odom" else moment.T_world_base
            theta = 2 * math.atan2(pose.orientation.z, pose.orientation.w)
            metres, radians = wanted.distance_to(Pose2(pose.position.x, pose.position.y, theta))
            assert max(metres, radians) < 1e-9
            assert message.header.frame_id == frame
    speeds = [message.twist.twist.linear.x for _, message in messages(run[0], "/odom")]
    assert max(speeds) == pytest.approx(0.6, abs=0.05)


def test_transforms_make_a_tree_from_odom_to_the_laser(run: tuple[Path, list[Moment]]) -> None:
    (_, static), *_ = messages(run[0], "/tf_static")
    (transform,) = static.transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ("base_link", "laser")
    assert transform.transform.translation.x == pytest.approx(MECABOT.laser.T_base_laser.x)
    for (_, message), moment in zip(messages(run[0], "/tf"), run[1], strict=True):
        (transform,) = message.transforms
        assert (transform.header.frame_id, transform.child_frame_id) == ("odom", "base_link")
        assert transform.transform.translation.x == moment.T_odom_base.x


def test_a_map_is_recorded_as_it_is(run: tuple[Path, list[Moment]]) -> None:
    ((_, message),) = messages(run[0], "/map")
    assert message.data.tolist() == [-1, 0, 100, 0]
    assert (message.info.width, message.info.height, message.info.resolution) == (2, 2, 1.0)
    assert message.header.frame_id == "map"


def test_several_robots_have_namespaces(tmp_path: Path) -> None:
    recorded(tmp_path / "two.mcap", robots=2)
    with AnyReader([tmp_path / "two.mcap"]) as reader:
        topics = {c.topic for c in reader.connections}
    assert {"/robot_1/scan", "/robot_2/scan", "/robot_2/odom", "/tf", "/tf_static"} <= topics
    frames = {m.transforms[0].child_frame_id for _, m in messages(tmp_path / "two.mcap", "/tf")}
    assert frames == {"robot_1/base_link", "robot_2/base_link"}
    (_, static), *_ = messages(tmp_path / "two.mcap", "/tf_static")
    assert [t.child_frame_id for t in static.transforms] == ["robot_1/laser", "robot_2/laser"]


def test_a_recorded_drive_repeats_exactly(run: tuple[Path, list[Moment]]) -> None:
    start, commands = read_drive(run[0])
    assert start.distance_to(STARTS[0])[0] < 0.01
    assert commands == COMMANDS
    again = list(drive(World(hall(), STARTS[:1], seed=9), [CommandLogDriver(commands)], 5.0))
    assert [m.T_world_base for m in again] == [m.T_world_base for m in run[1]]


def test_nothing_is_left_of_a_recording_that_failed(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), recording_to(tmp_path / "run.mcap", MECABOT):
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten_unasked(tmp_path: Path) -> None:
    (tmp_path / "run.mcap").write_text("mine")
    with pytest.raises(MapFileError, match="exists already"), recording_to(tmp_path / "run.mcap", MECABOT):
        pass
    assert (tmp_path / "run.mcap").read_text() == "mine"
    with recording_to(tmp_path / "run.mcap", MECABOT, force=True):
        pass
    assert (tmp_path / "run.mcap").read_bytes()[:5] == b"\x89MCAP"


def test_hostile_recordings_as_routes(tmp_path: Path, run: tuple[Path, list[Moment]]) -> None:
    whole = run[0].read_bytes()
    hostile = {
        "empty": b"",
        "text": b"no recording at all" * 10,
        "cut": whole[: len(whole) // 2],
        "garbled": whole[:200] + bytes(b ^ 0x55 for b in whole[200:2000]) + whole[2000:],
    }
    for name, data in hostile.items():
        (tmp_path / name).write_bytes(data)
        with pytest.raises(MapFileError) as caught:
            read_drive(tmp_path / name)
        assert "\n" not in str(caught.value)
    with pytest.raises(MapFileError, match="cannot be read"):
        read_drive(tmp_path / "nowhere")
    recorded(tmp_path / "two.mcap", robots=2)
    with pytest.raises(MapFileError, match="no topics /ground_truth and /cmd_vel"):
        read_drive(tmp_path / "two.mcap")
