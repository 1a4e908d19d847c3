"""What has happened to the robots since the last look, in sentences for the log."""

from __future__ import annotations

from collections.abc import Mapping

from mapmeld.live import FleetState


def news(
    before: FleetState, now: FleetState, stale_before: Mapping[str, str], stale_now: Mapping[str, str]
) -> list[str]:
    """Return a sentence for each robot that appeared, was joined or parted, or fell silent.

    Parameters
    ----------
    before, now
        Of the fleet.
    stale_before, stale_now
        By robot, why its map is stale.
    """
    sentences = []
    known = {robot.name: robot for robot in before.robots}
    for robot in now.robots:
        earlier = known.get(robot.name)
        if earlier is None:
            sentences.append(f"{robot.name}: first map, {robot.area:.0f} m2")
        pose, was_joined = robot.T_world_robot, earlier is not None and earlier.joined
        if pose is not None and not was_joined:
            at = f"x {pose.x:.2f} m, y {pose.y:.2f} m, yaw {pose.theta:.3f} rad"
            sentences.append(f"{robot.name}: joined, {at}; {robot.why}")
        elif pose is None and was_joined:
            sentences.append(f"{robot.name}: joined no more; {robot.why}")
    gone = known.keys() - {robot.name for robot in now.robots}
    sentences += [f"{name}: forgotten" for name in sorted(gone)]
    sentences += [f"{name}: stale, {why}" for name, why in stale_now.items() if name not in stale_before]
    sentences += [
        f"{name}: sends maps again" for name in stale_before if name not in stale_now and name not in gone
    ]
    return sentences
