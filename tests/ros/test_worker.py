"""Messages and the work of the matching process, with ROS's messages but without middleware."""

import math
from pathlib import Path

import numpy as np
import pytest
from drawing import cut, office, seen_from

from mapmeld.grid import OccupancyGrid
from mapmeld.io.recordings.messages import BadMessageError, Patch
from mapmeld.live import FleetSettings
from mapmeld.merging.graph import KnownPose
from mapmeld.ros.work import Incoming, Limits, Reply, Round, Start, Wish
from mapmeld.se2 import Pose2

pytest.importorskip("rclpy", reason='needs ROS 2 middleware: pip install "mapmeld[ros]"')

from mapmeld.ros.messages import grid_from_bytes, map_bytes, pose_with_covariance
from mapmeld.ros.worker import Worker

PLACE = office()
T_B = Pose2(3.0, -2.0, 0.7)
A = cut(PLACE, 0.0, 0.0, 13.0, 12.0)
B = seen_from(cut(PLACE, 3.0, 0.0, 16.0, 12.0), T_B)


def incoming(grid: OccupancyGrid, frame: str) -> Incoming:
    return Incoming(map_bytes(grid, frame, 5_000_000_007), 0)


def worker(limits: Limits | None = None) -> Worker:
    return Worker(Start(FleetSettings(), limits or Limits(), {}))


def round_of(worker: Worker, *wishes: Wish, **maps: Incoming) -> Reply:
    return worker.round(Round(maps, wishes, now=1))


def test_a_map_goes_there_and_back() -> None:
    turned = OccupancyGrid(A.cells, 0.05, Pose2(-3.25, 7.5, 0.6))
    back = grid_from_bytes(map_bytes(turned, "map", 5_000_000_007), 0, 10**9)
    assert back is not None
    assert np.array_equal(back.cells, turned.cells)
    assert (back.resolution, back.frame_id, back.stamp) == (0.05, "map", 5.000000007)
    assert back.origin.distance_to(turned.origin)[0] < 1e-9
    assert back.origin.distance_to(turned.origin)[1] < 1e-9


def test_bytes_that_are_no_map() -> None:
    with pytest.raises(BadMessageError):
        grid_from_bytes(b"\x00\x01\x00\x00nonsense", 0, 10**9)
    with pytest.raises(BadMessageError, match="max_cells"):
        grid_from_bytes(map_bytes(A, "map", 0), 0, 10)


def test_a_covariance_of_the_plane_in_a_message() -> None:
    covariance = np.arange(9.0).reshape(3, 3)
    message = pose_with_covariance(Pose2(1, 2, math.pi / 2), covariance, "world", 0)
    full = np.reshape(message.pose.covariance, (6, 6))
    assert full[0, 0] == 0.0
    assert full[5, 5] == 8.0
    assert full[0, 5] == 2.0
    assert math.isclose(message.pose.pose.orientation.z, math.sqrt(0.5))


def test_rounds_of_work(tmp_path: Path) -> None:
    at_work = worker()
    assert round_of(at_work).merged is None
    reply = round_of(at_work, a=incoming(A, "a/map"), b=incoming(B, "b/map"))
    assert set(reply.state.poses) == {"a", "b"}
    assert reply.merged is not None
    merged = grid_from_bytes(reply.merged, 0, 10**9)
    assert merged is not None
    assert merged.frame_id == "world"
    assert round_of(at_work).merged is None, "it has not changed"

    path = str(tmp_path / "merged")
    reply = round_of(at_work, Wish(1, "save", (path, False)), Wish(2, "save", (path, False)))
    assert reply.answers[1][0]
    assert not reply.answers[2][0]
    reply = round_of(at_work, Wish(3, "know", ("a", KnownPose(Pose2(1, 1, 1)))), Wish(4, "forget", ("x",)))
    assert reply.answers[3] == (True, "a is at x 1.000 m, y 1.000 m, theta 57.30 deg")
    assert not reply.answers[4][0]
    assert reply.state.poses["a"] == Pose2(1, 1, 1)


def test_drawing_can_be_put_off() -> None:
    at_work = worker()
    maps = {"a": incoming(A, "a/map"), "b": incoming(B, "b/map")}
    reply = at_work.round(Round(maps, draw=False))
    assert (reply.merged, reply.undrawn) == (None, True)
    assert at_work.round(Round({})).merged is not None


def test_updates() -> None:
    at_work = worker()
    patch = Patch(2, 3, np.full((2, 2), 100, np.int8), 6.0)
    reply = round_of(at_work, a=Incoming(patches=[(patch, 0)]))
    assert "has not come yet" in reply.notices[0].text
    both = incoming(A, "a/map")
    both.patches.append((patch, 0))
    assert not round_of(at_work, a=both).notices
    outside = Patch(10_000, 3, np.zeros((2, 2), np.int8), 6.0)
    assert "within" in round_of(at_work, a=Incoming(patches=[(outside, 0)])).notices[0].text


def test_updates_of_an_earlier_map_are_passed_over() -> None:
    at_work = worker()
    cells = np.full((2, 2), 100, np.int8)
    round_of(at_work, a=Incoming(map_bytes(A, "a", 10_000_000_000), 0))
    for late in (Patch(2, 3, cells, 9.9), Patch(2, 3, cells, 5.0)):
        assert not round_of(at_work, a=Incoming(patches=[(late, 0)])).notices
        assert np.array_equal(at_work._maps["a"].cells, A.cells)
        assert at_work._maps["a"].stamp == 10.0
    # A stamp that is only when it was received says nothing: robots have clocks of their own.
    round_of(at_work, a=Incoming(patches=[(Patch(2, 3, cells, 5.0, stamped=False), 0)]))
    assert (at_work._maps["a"].cells[2:4, 3:5] == 100).all()
    assert at_work._maps["a"].stamp == 10.0, "time does not go back"
    round_of(at_work, a=Incoming(map_bytes(A, "a", 0), 7_000_000_000))
    round_of(at_work, a=Incoming(patches=[(Patch(2, 3, cells, 5.0), 0)]))
    assert (at_work._maps["a"].cells[2:4, 3:5] == 100).all()


def test_a_forgotten_robot_gives_room_and_no_update_brings_it_back() -> None:
    at_work = worker(Limits(max_robots=1))
    round_of(at_work, a=incoming(A, "a"))
    assert round_of(at_work, b=incoming(B, "b")).notices[0].about == "robots"
    reply = round_of(at_work, Wish(1, "forget", ("a",)), b=incoming(B, "b"))
    assert reply.answers[1][0]
    assert [robot.name for robot in reply.state.robots] == ["b"]
    reply = round_of(at_work, Wish(2, "forget", ("b",)))
    reply = round_of(at_work, b=Incoming(patches=[(Patch(2, 3, np.zeros((2, 2), np.int8), 99.0), 0)]))
    assert not reply.state.robots
    assert "has not come yet" in reply.notices[0].text


def test_what_cannot_be_drawn_takes_the_old_merged_map_away() -> None:
    at_work = worker()
    round_of(at_work, a=incoming(A, "a"), b=incoming(B, "b"))
    far = KnownPose(Pose2(1e6, 1e6, 0))
    wishes = (
        Wish(1, "know", ("a", KnownPose(Pose2()))),
        Wish(2, "know", ("b", far)),
        Wish(3, "forbid", ("a", "b")),
    )
    reply = round_of(at_work, *wishes)
    assert "is not drawn" in reply.notices[0].text
    assert reply.merged is not None
    blank = grid_from_bytes(reply.merged, 0, 10**9)
    assert blank is not None
    assert not blank.known.any()
    assert round_of(at_work).merged is None


def test_limits() -> None:
    at_work = worker(Limits(max_cells=10, max_robots=1))
    assert "max_cells" in round_of(at_work, a=incoming(A, "a")).notices[0].text
    reply = at_work.round(Round({"a": incoming(A, "a"), "b": incoming(B, "b")}, limits=Limits(max_robots=1)))
    assert [notice.about for notice in reply.notices] == ["robots"]
