"""ROS message types that have no wheel, declared for `cyclonedds` (which this module needs).

The names of the types are those that every DDS middleware of ROS 2 uses.
"""

# No "from __future__ import annotations": cyclonedds reads the annotations as they are.

from collections.abc import Sequence
from dataclasses import dataclass

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int8, int32, sequence, uint32

from mapmeld.ros.messages import quaternion, split_time
from mapmeld.se2 import Pose2


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    """builtin_interfaces/Time."""

    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    """std_msgs/Header."""

    stamp: Time
    frame_id: str


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    """geometry_msgs/Vector3."""

    x: float64
    y: float64
    z: float64


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    """geometry_msgs/Quaternion."""

    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Transform(IdlStruct, typename="geometry_msgs::msg::dds_::Transform_"):
    """geometry_msgs/Transform."""

    translation: Vector3
    rotation: Quaternion


@dataclass
class TransformStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TransformStamped_"):
    """geometry_msgs/TransformStamped."""

    header: Header
    child_frame_id: str
    transform: Transform


@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs::msg::dds_::TFMessage_"):
    """tf2_msgs/TFMessage."""

    transforms: sequence[TransformStamped]


@dataclass
class OccupancyGridUpdate(IdlStruct, typename="map_msgs::msg::dds_::OccupancyGridUpdate_"):
    """map_msgs/OccupancyGridUpdate."""

    header: Header
    x: int32
    y: int32
    width: uint32
    height: uint32
    data: sequence[int8]


def tf_message(transforms: Sequence[tuple[str, str, Pose2]], nanoseconds: int) -> TFMessage:
    """Return a TFMessage of (parent frame, child frame, T_parent_child)."""
    stamp = Time(*split_time(nanoseconds))
    return TFMessage(
        [
            TransformStamped(
                Header(stamp, parent),
                child,
                Transform(Vector3(T.x, T.y, 0.0), Quaternion(*quaternion(T.theta))),
            )
            for parent, child, T in transforms
        ]
    )
