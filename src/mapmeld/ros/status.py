"""What the node tells of itself, its robots and pairs: a diagnostic_msgs/DiagnosticArray."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mapmeld.extras import required
from mapmeld.live import FleetState, PairReport, RobotReport
from mapmeld.ros.messages import split_time
from mapmeld.se2 import Pose2

OK, WARN, STALE = 0, 1, 3


@dataclass(frozen=True, slots=True)
class Item:
    """A diagnostic_msgs/DiagnosticStatus."""

    name: str
    level: int
    message: str
    values: Mapping[str, str]


def items_of(
    state: FleetState, stale: Mapping[str, str], robots_seen: Sequence[str], node: Mapping[str, str]
) -> list[Item]:
    """Return the items: the node, every robot, every pair.

    Parameters
    ----------
    state
        Of the fleet.
    stale
        By robot, why its map is stale.
    robots_seen
        Names of robots that are listened to, though they may not have sent a map yet.
    node
        Figures of the node.
    """
    joined = len(state.poses)
    known = {robot.name for robot in state.robots}
    message = f"{joined} of {len(known | set(robots_seen))} robots joined"
    items = [Item("mapmeld", OK if joined else WARN, message, node)]
    items += [_robot(robot, stale.get(robot.name)) for robot in state.robots]
    items += [
        Item(f"mapmeld robot: {name}", WARN, "no map yet", {"robot": name, "joined": "false"})
        for name in sorted(set(robots_seen) - known)
    ]
    return items + [_pair(pair) for pair in state.pairs]


def _robot(robot: RobotReport, stale: str | None) -> Item:
    values = {
        "robot": robot.name,
        "joined": _flag(robot.joined),
        "stale": _flag(stale is not None),
        "known_pose": _flag(robot.known),
        "map_frame": robot.frame_id,
        "map_area_m2": f"{robot.area:.1f}",
        "map_stamp": "" if robot.stamp is None else f"{robot.stamp:.3f}",
        "starts": str(robot.starts),
        **_pose("start", robot.T_world_robot),
    }
    message = robot.why if stale is None else f"{stale}; {robot.why}"
    level = STALE if stale is not None else OK if robot.joined else WARN
    return Item(f"mapmeld robot: {robot.name}", level, message, values)


def _pair(pair: PairReport) -> Item:
    values = {
        "robot_a": pair.a,
        "robot_b": pair.b,
        "standing": pair.standing,
        "verdict": pair.verdict,
        "state": pair.state,
        "probability": _number(pair.probability),
        "similarity": _number(pair.similarity),
        "overlap": _number(pair.overlap),
        "decree": str(pair.decree),
        "reason": pair.why,
        "seconds": f"{pair.seconds:.3f}",
        **_pose("T_a_b", pair.T_a_b),
    }
    level = OK if pair.state in ("used", "settled") else WARN
    return Item(f"mapmeld pair: {pair.a} {pair.b}", level, f"{pair.standing}: {pair.why}", values)


def _pose(name: str, pose: Pose2 | None) -> dict[str, str]:
    if pose is None:
        return {}
    return {f"{name}_x": f"{pose.x:.4f}", f"{name}_y": f"{pose.y:.4f}", f"{name}_yaw": f"{pose.theta:.5f}"}


def _flag(value: bool) -> str:
    return "true" if value else "false"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.4f}"


def diagnostic_array(items: Sequence[Item], nanoseconds: int) -> Any:
    """Return the items as a message."""
    messages = required("diagnostic_msgs.msg", "ros")
    array = messages.DiagnosticArray()
    array.header.stamp.sec, array.header.stamp.nanosec = split_time(nanoseconds)
    for item in items:
        status = messages.DiagnosticStatus()
        status.name, status.message, status.hardware_id = item.name, item.message, "mapmeld"
        status.level = bytes([item.level])
        for key, value in item.values.items():
            status.values.append(messages.KeyValue(key=key, value=value))
        array.status.append(status)
    return array
