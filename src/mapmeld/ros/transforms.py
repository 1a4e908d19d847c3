"""Transforms on ``/tf_static`` and ``/tf``: by the ROS installation's tf2_msgs, or else by `cyclonedds`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mapmeld.extras import MissingExtraError, required
from mapmeld.live import FleetState
from mapmeld.ros import dds
from mapmeld.ros.listening import profile
from mapmeld.ros.messages import quaternion, split_time
from mapmeld.se2 import Pose2

Transforms = Sequence[tuple[str, str, Pose2]]
"""(parent frame, child frame, T_parent_child)"""

APART = "mapmeld_apart"
"""Frames of robots that are joined no more hang below this one, which nothing connects with the world.

A static transform cannot be taken back; but a frame that gets another parent leaves the first one.
"""


NOWHERE = np.diag([1e12, 1e12, 1e12])
"""Covariance of a start pose that holds no more."""


class TransformPublisher(Protocol):
    """Publishes transforms on one topic."""

    by: str

    def send(self, transforms: Transforms, nanoseconds: int) -> None:
        """Publish them together; where the topic is latched, late joiners get those that were sent last."""

    def close(self) -> None:
        """Leave."""


def static_transforms(node: Any) -> TransformPublisher | None:
    """Return what publishes on ``/tf_static``: None if there is neither tf2_msgs nor cyclonedds."""
    return _publisher(node, "/tf_static", latched=True)


def moving_transforms(node: Any) -> TransformPublisher | None:
    """Return what publishes on ``/tf``; None as `static_transforms`."""
    return _publisher(node, "/tf", latched=False)


def _publisher(node: Any, topic: str, *, latched: bool) -> TransformPublisher | None:
    try:
        return _BySystem(node, required("tf2_msgs.msg", "ros"), topic, latched=latched)
    except MissingExtraError:
        pass
    return _ByCyclone(node.context.get_domain_id(), topic, latched=latched) if dds.available() else None


class _BySystem:
    by = "tf2_msgs"

    def __init__(self, node: Any, messages: Any, topic: str, *, latched: bool) -> None:
        self._messages = messages
        quality = profile(reliable=True, latched=latched, depth=1 if latched else 100)
        self._publisher = node.create_publisher(messages.TFMessage, topic, quality)

    def send(self, transforms: Transforms, nanoseconds: int) -> None:
        stamped = required("geometry_msgs.msg", "ros").TransformStamped
        message = self._messages.TFMessage()
        for parent, child, T in transforms:
            item = stamped()
            item.header.frame_id, item.child_frame_id = parent, child
            item.header.stamp.sec, item.header.stamp.nanosec = split_time(nanoseconds)
            item.transform.translation.x, item.transform.translation.y = T.x, T.y
            turn = item.transform.rotation
            turn.x, turn.y, turn.z, turn.w = quaternion(T.theta)
            message.transforms.append(item)
        self._publisher.publish(message)

    def close(self) -> None:
        """Nothing: the publisher goes with the node."""


class _ByCyclone:
    by = "cyclonedds"

    def __init__(self, domain_id: int, topic: str, *, latched: bool) -> None:
        from mapmeld.ros import dds_types

        quality = dds.quality(latched=latched)
        participant = dds.participant(domain_id)
        topics, publishing = required("cyclonedds.topic", "ros"), required("cyclonedds.pub", "ros")
        on = topics.Topic(participant, f"rt{topic}", dds_types.TFMessage, qos=quality)
        self._message = dds_types.tf_message
        self._writer = publishing.DataWriter(participant, on, qos=quality)

    def send(self, transforms: Transforms, nanoseconds: int) -> None:
        self._writer.write(self._message(transforms, nanoseconds))

    def close(self) -> None:
        self._writer = None


def frames_of(state: FleetState, world: str) -> dict[str, str]:
    """Return the map frame of each robot, its own: what two share gets the robot's name before it.

    A robot that is not joined does not take the name of one that is.
    """
    frames = {}
    for robot in state.robots:
        name = robot.frame_id.removeprefix("/")
        rivals = [r for r in state.robots if r.joined or not robot.joined]
        shared = sum(r.frame_id.removeprefix("/") == name for r in rivals) > 1
        own = name and name != world and not shared
        frames[robot.name] = name if own else f"{robot.name}/{name or 'map'}"
    return frames


def transforms_of(state: FleetState, world: str, once_joined: set[str]) -> list[tuple[str, str, Pose2]]:
    """Return a fleet's static transforms: world to map frame, and below `APART` what has left the world.

    Parameters
    ----------
    state
        Of the fleet.
    world
        Name of the world frame.
    once_joined
        Frames that were ever below a world; gets those that are now.
    """
    frames = frames_of(state, world)
    told = [(world, frames[name], T) for name, T in state.poses.items()]
    joined = {child for _, child, _ in told}
    once_joined.update(joined)
    # Also of robots that are forgotten, or call their frame otherwise now. The world itself hangs nowhere.
    return told + [(APART, child, Pose2()) for child in sorted(once_joined - joined - {world})]


def start_poses_of(
    state: FleetState, world: str, once_joined: set[str]
) -> dict[str, tuple[str, Pose2, NDArray[np.float64]]]:
    """Return by robot the frame, the pose and the covariance (3, 3) of its start pose.

    A latched pose cannot be taken back either: that of a robot which is joined no more is in the frame
    `APART`, with the covariance `NOWHERE`.

    Parameters
    ----------
    state, world
        As for `transforms_of`.
    once_joined
        Robots that were ever joined; gets those that are now.
    """
    told = {
        robot.name: (world, robot.T_world_robot, robot.covariance)
        for robot in state.robots
        if robot.T_world_robot is not None and robot.covariance is not None
    }
    once_joined.update(told)
    return told | {name: (APART, Pose2(), NOWHERE) for name in sorted(once_joined - told.keys())}
