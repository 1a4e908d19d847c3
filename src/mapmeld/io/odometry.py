"""Odometry at the times of scans."""

from __future__ import annotations

from collections import deque

from mapmeld.se2 import Pose2, wrap_angle

WIDEST_GAP = 1.0
"""Longest time [s] between two poses over which odometry is taken to run straight."""

LONGEST_REACH = 0.2
"""Longest time [s] before the first and after the last pose for which that one is taken."""

_KEPT = 10.0


def between(a: Pose2, b: Pose2, part: float) -> Pose2:
    """Return the pose at a part 0..1 of the way from a to b, turning the shorter way."""
    turn = wrap_angle(b.theta - a.theta)
    return Pose2(a.x + part * (b.x - a.x), a.y + part * (b.y - a.y), wrap_angle(a.theta + part * turn))


class OdometryTrack:
    """Poses in the order of their stamps; the last ten seconds are kept."""

    def __init__(self) -> None:
        self._poses: deque[tuple[float, Pose2]] = deque()

    @property
    def latest(self) -> float | None:
        """The last stamp; None before the first pose."""
        return self._poses[-1][0] if self._poses else None

    def add(self, stamp: float, pose: Pose2) -> None:
        """Take the next pose; one that is older than the last is passed over."""
        if self._poses and stamp <= self._poses[-1][0]:
            return
        self._poses.append((stamp, pose))
        while self._poses[0][0] < stamp - _KEPT:
            self._poses.popleft()

    def at(self, stamp: float) -> Pose2 | None:
        """Return the pose at a time [s]; None where the track has a gap, or does not reach there."""
        after: tuple[float, Pose2] | None = None
        for before in reversed(self._poses):
            if before[0] > stamp:
                after = before
                continue
            if after is None:
                return before[1] if stamp - before[0] <= LONGEST_REACH else None
            gap = after[0] - before[0]
            return between(before[1], after[1], (stamp - before[0]) / gap) if gap <= WIDEST_GAP else None
        return after[1] if after is not None and after[0] - stamp <= LONGEST_REACH else None
