"""What is known of a fleet at one moment."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from mapmeld.se2 import Pose2


class Decree(StrEnum):
    """What a user has said of a pair of robots."""

    NONE = "none"
    CONFIRMED = "confirmed"
    FORBIDDEN = "forbidden"


@dataclass(frozen=True, slots=True, eq=False)
class RobotReport:
    """One robot.

    Attributes
    ----------
    name
        Of the robot.
    frame_id
        Of its newest map.
    stamp
        Of its newest map [s]; None if it has none.
    T_world_robot
        Takes a point of its map's frame into the world frame; None while it is not joined. A SLAM map's frame
        usually starts where its robot did, so this is its start pose.
    covariance
        (3, 3) of (x, y, theta) of `T_world_robot` [m, m, rad]; None while it is not joined.
    known
        Whether its pose was given, and holds.
    starts
        How often its mapping has started, the first time included.
    area
        Known area of its newest map [m^2].
    why
        In words: what it is joined by, or why it is not.
    """

    name: str
    frame_id: str
    stamp: float | None
    T_world_robot: Pose2 | None
    covariance: NDArray[np.float64] | None
    known: bool
    starts: int
    area: float
    why: str

    @property
    def joined(self) -> bool:
        """Whether it is in the merged map."""
        return self.T_world_robot is not None


@dataclass(frozen=True, slots=True, eq=False)
class PairReport:
    """Two robots.

    Attributes
    ----------
    a, b
        Their names, in order.
    standing
        ``undecided``, ``accepted`` or ``withdrawn``, as in `mapmeld.history.Standing`.
    verdict
        Of the newest match: ``accepted``, ``ambiguous`` or ``rejected``.
    state
        What the graph of all pairs makes of it, as in `mapmeld.merging.graph.PairState`.
    probability, similarity, overlap, T_a_b
        Of the newest match; None where there is none yet.
    decree
        What a user said of it.
    why
        In words.
    seconds
        Time of the last match [s].
    """

    a: str
    b: str
    standing: str
    verdict: str
    state: str
    probability: float | None
    similarity: float | None
    overlap: float | None
    T_a_b: Pose2 | None
    decree: Decree
    why: str
    seconds: float


@dataclass(frozen=True, slots=True, eq=False)
class FleetState:
    """All robots and all pairs, by name; `anchor` is the robot on whose map the world frame hangs."""

    robots: tuple[RobotReport, ...] = ()
    pairs: tuple[PairReport, ...] = ()
    anchor: str | None = None

    @property
    def poses(self) -> dict[str, Pose2]:
        """``T_world_robot`` of the robots that are joined."""
        return {r.name: r.T_world_robot for r in self.robots if r.T_world_robot is not None}
