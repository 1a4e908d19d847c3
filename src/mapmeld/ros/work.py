"""What the node asks of the process that matches, and what it answers."""

from __future__ import annotations

from dataclasses import dataclass, field

from mapmeld.io.recordings.messages import Patch
from mapmeld.live import FleetSettings, FleetState
from mapmeld.se2 import Pose2


@dataclass(slots=True)
class Incoming:
    """The newest of a robot's map: a whole map, and the updates that came after it.

    Attributes
    ----------
    data
        Serialised nav_msgs/OccupancyGrid; None if only updates came.
    received
        When [ns].
    patches
        Updates in order, serialised or taken apart, each with the time it was received [ns].
    """

    data: bytes | None = None
    received: int = 0
    patches: list[tuple[bytes | Patch, int]] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Wish:
    """Something a user asks for: the name of a method of `mapmeld.ros.worker.Wishes`, and its arguments."""

    number: int
    kind: str
    arguments: tuple[object, ...] = ()


@dataclass(frozen=True, slots=True)
class Limits:
    """What holds whatever comes in.

    Attributes
    ----------
    max_cells
        Larger maps are refused.
    max_robots
        So many are followed.
    cpu_share
        Share of one processor that the matching process may use over time, above 0 and up to 1.
    """

    max_cells: int = 64_000_000
    max_robots: int = 32
    cpu_share: float = 1.0


@dataclass(frozen=True, slots=True)
class Start:
    """What a matching process begins with; `poses`: where robots lay before, to keep the world frame."""

    settings: FleetSettings
    limits: Limits
    poses: dict[str, Pose2]


@dataclass(frozen=True, slots=True)
class Round:
    """One round of work.

    Attributes
    ----------
    maps
        What has come since the last round, by robot.
    wishes
        What users want.
    settings, limits
        New ones; None: as before.
    draw
        Whether the merged map may be drawn now, if it has changed.
    now
        Time of the node [ns], for stamps.
    """

    maps: dict[str, Incoming]
    wishes: tuple[Wish, ...] = ()
    settings: FleetSettings | None = None
    limits: Limits | None = None
    draw: bool = True
    now: int = 0


@dataclass(frozen=True, slots=True)
class Notice:
    """Something for the log: what it is about, by which it is throttled, and the sentence."""

    about: str
    text: str


@dataclass(frozen=True, slots=True)
class Reply:
    """What came of a round.

    Attributes
    ----------
    state
        Of the fleet.
    merged
        Serialised nav_msgs/OccupancyGrid; None if it has not changed or there is none.
    undrawn
        Whether the merged map has changed but was not to be drawn.
    notices
        For the log.
    answers
        By the wishes' numbers: whether it was done, and a sentence.
    waiting
        How many pairs have new maps that are not matched yet.
    seconds, cpu_seconds, memory
        Wall time of the round [s]; processor time of the process so far [s], and its memory [bytes].
    """

    state: FleetState
    merged: bytes | None
    undrawn: bool
    notices: tuple[Notice, ...]
    answers: dict[int, tuple[bool, str]]
    waiting: int
    seconds: float
    cpu_seconds: float
    memory: int
