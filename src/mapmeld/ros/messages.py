"""ROS messages made of what mapmeld works with, and the other way round.

Maps are taken apart and put together where they are serialised, in the process that matches: the process that
talks to the middleware moves bytes, and stays quick whatever their size.
"""

from __future__ import annotations

import array
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapmeld.extras import required
from mapmeld.grid import OccupancyGrid
from mapmeld.io.recordings.messages import BadMessageError, Patch, grid_from_message, patch_from_message
from mapmeld.recording import Laser
from mapmeld.se2 import Pose2

EXTRA = "ros"


# ---------------------------------------------------------------------- small parts
def quaternion(theta: float) -> tuple[float, float, float, float]:
    """Return the rotation about z by `theta` [rad] as (x, y, z, w)."""
    return 0.0, 0.0, math.sin(theta / 2), math.cos(theta / 2)


def split_time(nanoseconds: int) -> tuple[int, int]:
    """Return (sec, nanosec) as in builtin_interfaces/Time."""
    return divmod(nanoseconds, 10**9)


def _stamp(header: Any, frame_id: str, nanoseconds: int) -> None:
    header.frame_id = frame_id
    header.stamp.sec, header.stamp.nanosec = split_time(nanoseconds)


def fill_pose(message: Any, pose: Pose2) -> None:
    """Write a pose into a geometry_msgs/Pose."""
    message.position.x, message.position.y, message.position.z = pose.x, pose.y, 0.0
    turn = message.orientation
    turn.x, turn.y, turn.z, turn.w = quaternion(pose.theta)


# ---------------------------------------------------------------------- maps
def map_message(grid: OccupancyGrid, frame_id: str, nanoseconds: int) -> Any:
    """Return a nav_msgs/OccupancyGrid of a map."""
    message = required("nav_msgs.msg", EXTRA).OccupancyGrid()
    _stamp(message.header, frame_id, nanoseconds)
    sec, nanosec = split_time(nanoseconds)
    message.info.map_load_time.sec, message.info.map_load_time.nanosec = sec, nanosec
    message.info.resolution = grid.resolution
    message.info.height, message.info.width = grid.shape
    fill_pose(message.info.origin, grid.origin)
    message.data = array.array("b", grid.cells.tobytes())
    return message


def map_bytes(grid: OccupancyGrid, frame_id: str, nanoseconds: int) -> bytes:
    """Return a nav_msgs/OccupancyGrid of a map, serialised: publishers take that as it is."""
    serialized = required("rclpy.serialization", EXTRA).serialize_message
    return bytes(serialized(map_message(grid, frame_id, nanoseconds)))


def grid_from_bytes(data: bytes, received: int, max_cells: int) -> OccupancyGrid | None:
    """Return the map of a serialised nav_msgs/OccupancyGrid; None for one without cells.

    Parameters
    ----------
    data
        The message.
    received
        When [ns]; the stamp of a map whose header has none.
    max_cells
        What is larger is refused before its cells are looked at.

    Raises
    ------
    BadMessageError
        It is no map, or too large.
    """
    message = _decoded(data, required("nav_msgs.msg", EXTRA).OccupancyGrid)
    cells = int(message.info.width) * int(message.info.height)
    if cells > max_cells:
        raise BadMessageError(
            f"a map of {message.info.width} x {message.info.height} cells, more than max_cells, {max_cells:,}"
        )
    return grid_from_message(message, received)


def patch_from_bytes(data: bytes, received: int) -> Patch:
    """Return the patch of a serialised map_msgs/OccupancyGridUpdate, where ROS has that type."""
    return patch_from_message(_decoded(data, required("map_msgs.msg", EXTRA).OccupancyGridUpdate), received)


def _decoded(data: bytes, kind: Any) -> Any:
    try:
        return required("rclpy.serialization", EXTRA).deserialize_message(data, kind)
    except Exception as error:  # whatever the library trips over: the bytes are to blame
        raise BadMessageError("bytes that are no map") from error


# ---------------------------------------------------------------------- poses
def pose_with_covariance(
    pose: Pose2, covariance: NDArray[np.float64], frame_id: str, nanoseconds: int
) -> Any:
    """Return a geometry_msgs/PoseWithCovarianceStamped; covariance (3, 3) of (x, y, theta)."""
    message = required("geometry_msgs.msg", EXTRA).PoseWithCovarianceStamped()
    _stamp(message.header, frame_id, nanoseconds)
    fill_pose(message.pose.pose, pose)
    full = np.zeros((6, 6))
    full[np.ix_((0, 1, 5), (0, 1, 5))] = covariance
    message.pose.covariance = full.ravel()
    return message


def pose_array(poses: list[Pose2], frame_id: str, nanoseconds: int) -> Any:
    """Return a geometry_msgs/PoseArray."""
    geometry = required("geometry_msgs.msg", EXTRA)
    message = geometry.PoseArray()
    _stamp(message.header, frame_id, nanoseconds)
    for pose in poses:
        item = geometry.Pose()
        fill_pose(item, pose)
        message.poses.append(item)
    return message


def pose_stamped(pose: Pose2, frame_id: str, nanoseconds: int) -> Any:
    """Return a geometry_msgs/PoseStamped."""
    message = required("geometry_msgs.msg", EXTRA).PoseStamped()
    _stamp(message.header, frame_id, nanoseconds)
    fill_pose(message.pose, pose)
    return message


# ---------------------------------------------------------------------- robots
def clock_message(nanoseconds: int) -> Any:
    """Return a rosgraph_msgs/Clock."""
    message = required("rosgraph_msgs.msg", EXTRA).Clock()
    message.clock.sec, message.clock.nanosec = split_time(nanoseconds)
    return message


def odometry_message(
    pose: Pose2,
    speed: tuple[float, float],
    covariance: NDArray[np.float64],
    frames: tuple[str, str],
    nanoseconds: int,
) -> Any:
    """Return a nav_msgs/Odometry.

    Parameters
    ----------
    pose, speed
        Of the base: where odometry believes it to be, and [m/s] ahead and [rad/s].
    covariance
        (36,), of the pose and of the speed.
    frames
        Of odometry, and of the base.
    nanoseconds
        The stamp.
    """
    message = required("nav_msgs.msg", EXTRA).Odometry()
    _stamp(message.header, frames[0], nanoseconds)
    message.child_frame_id = frames[1]
    fill_pose(message.pose.pose, pose)
    message.twist.twist.linear.x, message.twist.twist.angular.z = speed
    message.pose.covariance = message.twist.covariance = covariance
    return message


def scan_message(
    laser: Laser,
    ranges: NDArray[np.float32],
    limits: tuple[float, float],
    frame_id: str,
    nanoseconds: int,
) -> Any:
    """Return a sensor_msgs/LaserScan.

    Parameters
    ----------
    laser
        The scanner.
    ranges
        (beams,) [m]
    limits
        The shortest range that it measures [m], and the time from scan to scan [s].
    frame_id
        Of the laser.
    nanoseconds
        The stamp.
    """
    message = required("sensor_msgs.msg", EXTRA).LaserScan()
    _stamp(message.header, frame_id, nanoseconds)
    message.angle_min, message.angle_increment = laser.first_angle, laser.step
    message.angle_max = laser.first_angle + (laser.beams - 1) * laser.step
    message.range_min, message.scan_time = limits
    message.range_max = laser.max_range
    message.ranges = array.array("f", ranges.astype(np.float32).tobytes())
    return message
