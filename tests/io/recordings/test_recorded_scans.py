"""Scans and odometry out of recordings of every kind."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mcap.writer
import numpy as np
import pytest
from bag_files import START
from rosbags import rosbag1, rosbag2
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from mapmeld.io.recordings import RecordingError
from mapmeld.io.scan_stream import ScanStream
from mapmeld.io.scans import open_scans
from mapmeld.se2 import Pose2

SCAN, ODOMETRY, TF = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"
Sent = tuple[float, str, str, Any]  # received [s after START], topic, type, message

KINDS = ("mcap", "rosbag1", "rosbag2", "rosbag2 mcap")


class Words:
    """Messages of ROS 1 or 2."""

    def __init__(self, version: int) -> None:
        self.store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
        if version == 1:
            self.store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms\n", TF))
        self.version = version
        self.number = 0

    def type(self, name: str) -> Any:
        return self.store.types[name]

    def header(self, stamp: float, frame: str) -> Any:
        nanoseconds = 0 if stamp < 0 else START * 10**9 + round(stamp * 1e9)
        time = self.type("builtin_interfaces/msg/Time")(nanoseconds // 10**9, nanoseconds % 10**9)
        first = (0,) if self.version == 1 else ()
        return self.type("std_msgs/msg/Header")(*first, stamp=time, frame_id=frame)

    def quaternion(self, yaw: float, upside_down: bool = False) -> Any:
        half = yaw / 2
        parts = (
            (math.cos(half), math.sin(half), 0.0, 0.0)
            if upside_down
            else (0, 0, math.sin(half), math.cos(half))
        )
        return self.type("geometry_msgs/msg/Quaternion")(*map(float, parts))

    def scan(self, stamp: float, ranges: Sequence[float], **changed: Any) -> Any:
        fields: dict[str, Any] = {
            "angle_min": -1.0, "angle_max": 1.0, "angle_increment": 2.0 / (max(len(ranges), 2) - 1),
            "time_increment": 0.0, "scan_time": 0.1, "range_min": 0.1, "range_max": 8.0,
        }  # fmt: skip
        frame = changed.pop("frame", "laser")
        return self.type(SCAN)(
            header=self.header(stamp, frame),
            **(fields | changed),
            ranges=np.array(ranges, np.float32),
            intensities=np.zeros(0, np.float32),
        )

    def odometry(self, stamp: float, pose: Pose2, child: str = "base_link") -> Any:
        point = self.type("geometry_msgs/msg/Point")(pose.x, pose.y, 0.0)
        at = self.type("geometry_msgs/msg/Pose")(point, self.quaternion(pose.theta))
        zero = self.type("geometry_msgs/msg/Vector3")(0.0, 0.0, 0.0)
        return self.type(ODOMETRY)(
            header=self.header(stamp, "odom"),
            child_frame_id=child,
            pose=self.type("geometry_msgs/msg/PoseWithCovariance")(at, np.zeros(36)),
            twist=self.type("geometry_msgs/msg/TwistWithCovariance")(
                self.type("geometry_msgs/msg/Twist")(zero, zero), np.zeros(36)
            ),
        )

    def frames(self, *placed: tuple[float, str, str, Pose2], upside_down: bool = False) -> Any:
        found = [
            self.type("geometry_msgs/msg/TransformStamped")(
                header=self.header(stamp, parent),
                child_frame_id=child,
                transform=self.type("geometry_msgs/msg/Transform")(
                    self.type("geometry_msgs/msg/Vector3")(pose.x, pose.y, 0.3),
                    self.quaternion(pose.theta, upside_down),
                ),
            )
            for stamp, parent, child, pose in placed
        ]
        return self.type(TF)(found)


def recorded(path: Path, kind: str, sent: Sequence[Sent], words: Words) -> Path:
    store = words.store
    if kind == "mcap":
        buffer = io.BytesIO()
        writer: Any = mcap.writer.Writer(buffer)
        writer.start()
        channels: dict[str, int] = {}
        for after, topic, name, message in sorted(sent, key=lambda s: s[0]):
            if topic not in channels:
                schema = writer.register_schema(name, "ros2msg", b"")
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            time = START * 10**9 + round(after * 1e9)
            writer.add_message(channels[topic], time, bytes(store.serialize_cdr(message, name)), time)
        writer.finish()
        path.write_bytes(buffer.getvalue())
        return path
    if kind == "rosbag1":
        opened: Any = rosbag1.Writer(path)
    else:
        storage = StoragePlugin.MCAP if kind.endswith("mcap") else StoragePlugin.SQLITE3
        opened = rosbag2.Writer(path, version=9, storage_plugin=storage)
    with opened as writer:
        connections: dict[str, Any] = {}
        for after, topic, name, message in sorted(sent, key=lambda s: s[0]):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, name, typestore=store)
            data = (
                store.serialize_ros1(message, name)
                if kind == "rosbag1"
                else store.serialize_cdr(message, name)
            )
            writer.write(connections[topic], START * 10**9 + round(after * 1e9), data)
    return path


def usual(words: Words) -> list[Sent]:
    """Odometry at 10 Hz along x; scans in between; the laser 0.2 m ahead, turned by 90 degrees."""
    sent: list[Sent] = [
        (0.0, "/tf_static", TF, words.frames((0.0, "base_link", "laser", Pose2(0.2, 0.0, math.pi / 2))))
    ]
    for n in range(11):
        sent.append((0.1 * n + 0.01, "/odom", ODOMETRY, words.odometry(0.1 * n, Pose2(0.1 * n, 1.0, 0.0))))
    for n in range(9):
        sent.append((0.1 * n + 0.08, "/scan", SCAN, words.scan(0.1 * n + 0.05, [1.0, 2.0, 3.0])))
    return sent


def opened(tmp_path: Path, sent: Sequence[Sent], kind: str = "mcap", **topics: str) -> ScanStream:
    words = Words(1 if kind == "rosbag1" else 2)
    return open_scans(recorded(tmp_path / f"recording.{kind[:4]}", kind, sent, words), **topics)


@pytest.mark.parametrize("kind", KINDS)
def test_scans_get_the_odometry_of_their_time(tmp_path: Path, kind: str) -> None:
    stream = opened(tmp_path, usual(Words(1 if kind == "rosbag1" else 2)), kind)
    laser = stream.laser
    assert (laser.beams, laser.first_angle, laser.step, laser.max_range) == (3, -1.0, 1.0, 8.0)
    assert laser.T_base_laser.distance_to(Pose2(0.2, 0.0, math.pi / 2)) == pytest.approx((0, 0))
    scans = list(stream.scans)
    assert len(scans) == 9
    for n, scan in enumerate(scans):
        assert scan.stamp == pytest.approx(START + 0.1 * n + 0.05, abs=1e-6)
        assert scan.T_odom_base.distance_to(Pose2(0.1 * n + 0.05, 1.0)) == pytest.approx((0, 0), abs=1e-6)
        np.testing.assert_array_equal(scan.ranges, (1, 2, 3))
    assert not stream.left_out


def test_odometry_may_come_long_after_the_scans(tmp_path: Path) -> None:
    late = [(after + 3.0 * (topic == "/odom"), topic, kind, m) for after, topic, kind, m in usual(Words(2))]
    assert len(list(opened(tmp_path, late).scans)) == 9


def test_odometry_from_tf_alone(tmp_path: Path) -> None:
    words = Words(2)
    sent = [one for one in usual(words) if one[1] != "/odom"]
    mounted = (0.0, "/base_footprint", "base_link", Pose2()), (0.0, "base_link", "/laser", Pose2(0.2))
    sent[0] = (0.0, "/tf_static", TF, words.frames(*mounted))
    for n in range(11):
        frames = words.frames(
            (0.1 * n, "odom", "base_footprint", Pose2(0.1 * n)), (0.1 * n, "map", "odom", Pose2(5.0))
        )
        sent.append((0.1 * n + 0.02, "/tf", TF, frames))
    stream = opened(tmp_path, sent)
    assert stream.laser.T_base_laser.distance_to(Pose2(0.2)) == pytest.approx((0, 0))
    assert [scan.T_odom_base.x for scan in stream.scans] == pytest.approx([0.1 * n + 0.05 for n in range(9)])


def test_an_upside_down_laser_is_seen_from_above(tmp_path: Path) -> None:
    words = Words(2)
    sent = usual(words)
    frames = words.frames((0.0, "base_link", "laser", Pose2(0.2, 0.0, 0.5)), upside_down=True)
    sent[0] = (0.0, "/tf_static", TF, frames)
    laser = opened(tmp_path, sent).laser
    assert (laser.first_angle, laser.step) == (1.0, -1.0)
    assert laser.T_base_laser.theta == pytest.approx(0.5)


def test_invalid_ranges_become_zero_and_those_beyond_reach_infinite(tmp_path: Path) -> None:
    words = Words(2)
    sent = [one for one in usual(words) if one[1] != "/scan"]
    values = [math.nan, 0.05, -math.inf, 2.0, 8.5, math.inf]
    sent.append((0.5, "/scan", SCAN, words.scan(0.5, values)))
    (scan,) = opened(tmp_path, sent).scans
    np.testing.assert_array_equal(scan.ranges, np.array([0, 0, 0, 2, np.inf, np.inf], np.float32))


def test_scans_of_other_sizes_are_brought_to_the_beams_of_the_first(tmp_path: Path) -> None:
    words = Words(2)
    sent = [one for one in usual(words) if one[1] != "/scan"]
    sent.append((0.2, "/scan", SCAN, words.scan(0.2, [1.0, 2.0, 3.0])))
    sent.append((0.3, "/scan", SCAN, words.scan(0.3, [1.0, 9.0, 2.0, 9.0, 3.0])))
    half = words.scan(0.4, [2.0, 3.0], angle_min=0.0, angle_increment=1.0)
    sent.append((0.4, "/scan", SCAN, half))
    sent.append((0.5, "/scan", SCAN, words.scan(0.5, [])))
    found = [scan.ranges.tolist() for scan in opened(tmp_path, sent).scans]
    assert found == [[1, 2, 3], [1, 2, 3], [0, 2, 3], [0, 0, 0]]


def test_scans_that_begin_elsewhere_are_turned_to_the_beams_of_the_first(tmp_path: Path) -> None:
    words = Words(2)
    sent = [one for one in usual(words) if one[1] != "/scan"]
    quarter = {"angle_increment": math.pi / 2}
    for n, start in enumerate((-math.pi, -math.pi / 2, 0.0, -math.pi + 0.1, math.pi)):
        scan = words.scan(0.2 + 0.1 * n, [1.0, 2.0, 3.0, 4.0], angle_min=start, **quarter)
        sent.append((0.2 + 0.1 * n, "/scan", SCAN, scan))
    found = [scan.ranges.tolist() for scan in opened(tmp_path, sent).scans]
    assert found == [[1, 2, 3, 4], [4, 1, 2, 3], [3, 4, 1, 2], [1, 2, 3, 4], [1, 2, 3, 4]]
    sent = [one for one in usual(words) if one[1] != "/scan"]
    sent.append((0.2, "/scan", SCAN, words.scan(0.2, [1.0, 2.0, 3.0])))
    sent.append((0.3, "/scan", SCAN, words.scan(0.3, [1.0, 2.0, 3.0], angle_min=0.0)))
    assert [s.ranges.tolist() for s in opened(tmp_path, sent).scans] == [[1, 2, 3], [0, 1, 2]]


def unnamed(words: Words) -> list[Sent]:
    sent = [one for one in usual(words) if one[1] != "/odom"]
    for n in range(11):
        odometry = words.odometry(0.1 * n, Pose2(0.1 * n, 1.0, 0.0), child="")
        sent.append((0.1 * n + 0.01, "/odom", ODOMETRY, odometry))
    return sent


def test_odometry_that_does_not_name_the_robot_is_that_of_the_frame_on_tf(tmp_path: Path) -> None:
    words = Words(2)
    sent = unnamed(words)
    sent.append((0.3, "/tf", TF, words.frames((0.3, "odom", "base_link", Pose2()))))
    stream = opened(tmp_path, sent)
    assert stream.laser.T_base_laser.distance_to(Pose2(0.2, 0.0, math.pi / 2)) == pytest.approx((0, 0))
    assert len(list(stream.scans)) == 9
    assert not stream.left_out


@pytest.mark.parametrize("with_tf", [True, False])
def test_odometry_that_does_not_name_the_robot_is_refused_without(tmp_path: Path, with_tf: bool) -> None:
    sent = [one for one in unnamed(Words(2)) if with_tf or one[1] != "/tf_static"]
    with pytest.raises(RecordingError, match="/odom does not name the robot's frame"):
        opened(tmp_path, sent)


def test_what_cannot_be_used_is_counted(tmp_path: Path) -> None:
    words = Words(2)
    sent = [one for one in usual(words) if one[1] != "/tf_static"]
    sent.append((0.95, "/scan", SCAN, words.scan(0.1, [1.0, 2.0, 3.0])))
    sent.append((7.0, "/scan", SCAN, words.scan(7.0, [1.0, 2.0, 3.0])))
    stream = opened(tmp_path, sent)
    assert len(list(stream.scans)) == 9
    assert stream.laser.T_base_laser == Pose2()
    assert sorted(stream.left_out) == [
        "a scan for whose time there is no odometry",
        "a scan that is no later than the one before it",
        "where frame 'laser' sits on 'base_link' is not in the recording: "
        "the laser is taken to be in the middle of the robot",
    ]


@pytest.mark.parametrize("topic", ["/scan", "/odom"])
def test_one_wrong_time_does_not_cost_the_rest(tmp_path: Path, topic: str) -> None:
    words = Words(2)
    sent = usual(words)
    number = next(n for n, one in enumerate(sent) if one[1] == topic and one[0] > 0.3)
    kind, message = sent[number][2:]
    message.header = words.header(1e5, message.header.frame_id)
    sent[number] = (sent[number][0], topic, kind, message)
    stream = opened(tmp_path, sent)
    assert len(list(stream.scans)) == (8 if topic == "/scan" else 9)
    what = "a scan" if topic == "/scan" else "odometry"
    assert stream.left_out == {f"{what} with a time stamp later than that of the next one": 1}


def test_stamps_of_zero_mean_when_they_were_received(tmp_path: Path) -> None:
    words = Words(2)
    sent = [one for one in usual(words) if one[1] != "/scan"]
    sent.append((0.5, "/scan", SCAN, words.scan(-1.0, [1.0, 2.0, 3.0])))
    (scan,) = opened(tmp_path, sent).scans
    assert scan.stamp == pytest.approx(START + 0.5)


def test_topics_are_chosen_by_name(tmp_path: Path) -> None:
    words = Words(2)
    sent = usual(words)
    sent += [(after, "/rear/scan", kind, m) for after, topic, kind, m in sent if topic == "/scan"][:4]
    sent += [(after, "/other/odom", kind, m) for after, topic, kind, m in sent if topic == "/odom"]
    path = recorded(tmp_path / "r.mcap", "mcap", sent, words)
    with pytest.raises(
        RecordingError, match="has scans on 2 topics; name one of them with --scan: /rear/scan, /scan"
    ):
        open_scans(path)
    with pytest.raises(RecordingError, match="has odometry on 2 topics; name one of them with --odom"):
        open_scans(path, scan="/scan")
    assert len(list(open_scans(path, scan="rear/scan", odom="/odom").scans)) == 4
    with pytest.raises(RecordingError, match="topic /front has no scans; there are: /rear/scan, /scan"):
        open_scans(path, scan="/front")


@pytest.mark.parametrize(
    ("without", "problem"), [("/scan", "has no scans"), ("/odom", "no frame has its place in frame 'odom'")]
)
def test_recordings_without_scans_or_odometry_are_refused(tmp_path: Path, without: str, problem: str) -> None:
    sent = [one for one in usual(Words(2)) if one[1] != without]
    with pytest.raises(RecordingError, match=problem):
        opened(tmp_path, sent)


@pytest.mark.parametrize(
    ("changed", "problem"),
    [
        ({"range_max": math.inf}, "range inf m"),
        ({"range_max": 0.0}, "range 0 m"),
        ({"angle_increment": 0.0}, "0 rad from beam to beam"),
        ({"angle_min": math.nan}, "a scan of a laser"),
    ],
)
def test_lasers_that_cannot_be_are_refused(tmp_path: Path, changed: dict[str, float], problem: str) -> None:
    words = Words(2)
    sent = [one for one in usual(words) if one[1] != "/scan"]
    sent.append((0.5, "/scan", SCAN, words.scan(0.5, [1.0, 2.0], **changed)))
    with pytest.raises(RecordingError, match=problem):
        opened(tmp_path, sent)


def test_a_laser_on_its_side_and_poses_that_are_not_finite_are_refused(tmp_path: Path) -> None:
    words = Words(2)
    sent = usual(words)
    frames = words.frames((0.0, "base_link", "laser", Pose2()))
    frames.transforms[0].transform.rotation = words.type("geometry_msgs/msg/Quaternion")(
        math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)
    )
    sent[0] = (0.0, "/tf_static", TF, frames)
    with pytest.raises(RecordingError, match="neither level nor upside down"):
        opened(tmp_path, sent)
    sent = usual(words)
    sent.append((0.55, "/odom", ODOMETRY, words.odometry(0.55, Pose2(math.nan))))
    other = tmp_path / "other"
    other.mkdir()
    with pytest.raises(RecordingError, match="/odom has a pose that is not finite"):
        list(opened(other, sent).scans)
