"""Laser scans and the odometry at their times, out of recordings."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapmeld.io import AnyPath
from mapmeld.io.in_order import InOrder
from mapmeld.io.odometry import OdometryTrack
from mapmeld.io.recordings.frames import Frames, frame_name, level_pose, matrix_of
from mapmeld.io.recordings.messages import (
    ENCODINGS,
    TF,
    BadMessageError,
    RecordingError,
    decoded,
    seconds,
    stamp_of,
)
from mapmeld.io.recordings.opening import open_recording
from mapmeld.io.recordings.source import Channel, Message, Source
from mapmeld.io.scan_stream import ScanStream
from mapmeld.recording import Laser, Scan
from mapmeld.se2 import Pose2, wrap_angle

SCAN = "sensor_msgs/msg/LaserScan"
ODOMETRY = "nav_msgs/msg/Odometry"
ODOM_FRAME = "odom"
"""The frame whose child is the robot, where odometry is on /tf alone."""

# How many messages of tf are looked at to find where the laser sits.
_ENOUGH_FRAMES = 5000
# How many scans wait for odometry that comes later.
_MOST_WAITING = 1000


@dataclass(frozen=True, slots=True)
class _Mount:
    """The laser of a recording, and what has to be done to its scans."""

    laser: Laser
    shortest: float


def recorded_scans(path: AnyPath, scan: str | None = None, odom: str | None = None) -> ScanStream:
    """Read the scans of a recording with the odometry at their times, as they are asked for.

    Parameters
    ----------
    path
        A recording as `mapmeld.io.recordings.map_states` reads it.
    scan
        Topic of sensor_msgs/LaserScan; may be left out if there is only one.
    odom
        Topic of nav_msgs/Odometry, or of tf messages in which frame "odom" is the robot's parent; may be left
        out if there is only one of the first kind, or none but /tf.

    Returns
    -------
    ScanStream
        Odometry is interpolated to the stamp of each scan. Where the laser sits on the robot is taken from
        tf; if that does not say it, the middle of the robot is taken, and `left_out` says so.

    Raises
    ------
    RecordingError
        At once: not a recording, no such topic, or several and none named, or no scan. While scans are
        taken: the recording is damaged.
    MissingExtraError
        The extra "bags" is not installed.
    """
    name = str(path)
    left_out: Counter[str] = Counter()
    with open_recording(name, "refuse") as source:
        scans = _topic(name, source, (SCAN,), scan, "scans", "--scan")
        odometry = _odometry_topic(name, source, odom)
        mount, frame = _look_ahead(name, source, scans, odometry, left_out)
    return ScanStream(mount.laser, _scans(name, scans, odometry, frame, mount, left_out), left_out)


# ---------------------------------------------------------------------- topics
def _topic(
    name: str, source: Source, types: Sequence[str], wanted: str | None, what: str, option: str
) -> list[Channel]:
    channels = [c for c in source.channels if c.type in types and c.encoding in ENCODINGS]
    names = sorted({channel.topic for channel in channels})
    if wanted is not None:
        topic = next((n for n in (wanted, f"/{wanted}", wanted.removeprefix("/")) if n in names), None)
        if topic is None:
            there = f"there are: {', '.join(names[:10])}" if names else "nor has any other"
            raise RecordingError.of(name, f"topic {wanted} has no {what}; {there}")
    elif len(names) != 1:
        many = f"has {what} on {len(names)} topics; name one of them with {option}: {', '.join(names[:10])}"
        raise RecordingError.of(name, many if names else f"has no {what} ({types[0]})")
    else:
        (topic,) = names
    return [channel for channel in channels if channel.topic == topic]


def _odometry_topic(name: str, source: Source, wanted: str | None) -> list[Channel]:
    types: Sequence[str] = (ODOMETRY, *TF)
    if wanted is None:
        poses = any(c.type == ODOMETRY and c.encoding in ENCODINGS for c in source.channels)
        types = (ODOMETRY,) if poses else TF
        if not poses:
            wanted = next((c.topic for c in source.channels if c.type in TF and c.topic.endswith("tf")), None)
    return _topic(name, source, types, wanted, "odometry", "--odom")


# ---------------------------------------------------------------------- where the laser sits
def _look_ahead(
    name: str, source: Source, scans: list[Channel], odometry: list[Channel], left_out: Counter[str]
) -> tuple[_Mount, str]:
    """Find the first scan and where its laser sits; also the robot's frame."""
    frames = Frames()
    first: Any = None
    base: str | None = None
    parent: str | None = ODOM_FRAME if odometry[0].type in TF else None
    seen = 0
    with_frames = [c for c in source.channels if c.type in TF and c.encoding in ENCODINGS]
    for message in source.messages({*scans, *odometry, *with_frames}):
        kind = message.channel.type
        content = _content(name, message)
        if kind == SCAN:
            first = first or content
        elif kind == ODOMETRY:
            # Some drivers leave their own frame out; tf may say it.
            base = base or frame_name(content.child_frame_id) or None
            parent = frame_name(content.header.frame_id)
        else:
            frames.add(content)
            seen += 1
        if parent and (base is None or odometry[0].type in TF):
            base = frames.child(parent)
        if first is None or base is None:
            hopeless = seen > _ENOUGH_FRAMES or (parent is not None and not with_frames)
            if hopeless and first is not None:
                break
            continue
        mounted = frames.between(base, frame_name(first.header.frame_id)) is not None
        if mounted or not with_frames or seen > _ENOUGH_FRAMES:
            break
    if first is None:
        raise RecordingError.of(name, f"there is no scan on {scans[0].topic}")
    if base is None:
        if odometry[0].type not in TF and parent is not None:
            raise RecordingError.of(
                name,
                f"{odometry[0].topic} does not name the robot's frame (child_frame_id is empty), and no "
                f"frame has its place in {parent!r} on tf, so where the laser sits cannot be known",
            )
        problem = (
            f"no frame has its place in frame {ODOM_FRAME!r}" if odometry[0].type in TF else "no message"
        )
        raise RecordingError.of(name, f"there is no odometry on {odometry[0].topic}: {problem}")
    laser_frame = frame_name(first.header.frame_id)
    matrix = frames.between(base, laser_frame)
    if matrix is None:
        left_out[
            f"where frame {laser_frame!r} sits on {base!r} is not in the recording: "
            "the laser is taken to be in the middle of the robot"
        ] += 1
        matrix = np.eye(4)
    try:
        return _mount(first, matrix), base
    except BadMessageError as error:
        raise RecordingError.of(name, f"{scans[0].topic} has {error}") from error


def _mount(first: Any, matrix: NDArray[np.float64]) -> _Mount:
    pose, upside_down = level_pose(matrix)
    start, step = float(first.angle_min), float(first.angle_increment)
    longest = float(first.range_max)
    if not (math.isfinite(start) and math.isfinite(step) and step and math.isfinite(longest) and longest > 0):
        raise BadMessageError(
            f"a scan of a laser with range {longest:g} m and {step:g} rad from beam to beam"
        )
    if not len(first.ranges):
        raise BadMessageError("a scan without ranges")
    # Seen from above, an upside down laser turns the other way.
    sign = -1.0 if upside_down else 1.0
    laser = Laser(len(first.ranges), sign * start, sign * step, longest, pose)
    return _Mount(laser, float(first.range_min))


# ---------------------------------------------------------------------- scans
def _scans(
    name: str,
    scans: list[Channel],
    odometry: list[Channel],
    base: str,
    mount: _Mount,
    left_out: Counter[str],
) -> Iterator[Scan]:
    """Give the scans as soon as the odometry after them is known."""
    track = OdometryTrack()
    waiting: deque[tuple[float, NDArray[np.float32]]] = deque()
    scans_in_order = InOrder[NDArray[np.float32]]("a scan", left_out)
    poses_in_order = InOrder[Pose2]("odometry", left_out, repeats=True)
    with open_recording(name, "refuse") as source:
        for message in source.messages({*scans, *odometry}):
            content = _content(name, message)
            if message.channel.type == SCAN:
                stamp = stamp_of(content.header, message.received)
                waiting += scans_in_order.add(stamp, _ranges(content, mount))
            else:
                for stamp, pose in _poses(name, content, message, base):
                    for placed in poses_in_order.add(stamp, pose):
                        track.add(*placed)
            while waiting and (
                (track.latest is not None and track.latest >= waiting[0][0]) or len(waiting) > _MOST_WAITING
            ):
                yield from _placed(*waiting.popleft(), track, left_out)
    waiting += scans_in_order.rest()
    for placed in poses_in_order.rest():
        track.add(*placed)
    for stamp, ranges in waiting:
        yield from _placed(stamp, ranges, track, left_out)


def _placed(
    stamp: float, ranges: NDArray[np.float32], track: OdometryTrack, left_out: Counter[str]
) -> Iterator[Scan]:
    pose = track.at(stamp)
    if pose is None:
        left_out["a scan for whose time there is no odometry"] += 1
    else:
        yield Scan(stamp, pose, ranges)


def _ranges(content: Any, mount: _Mount) -> NDArray[np.float32]:
    """Return the ranges at the beams of the first scan: 0 where invalid, inf where nothing was met."""
    ranges = np.array(content.ranges, np.float32)
    longest = float(content.range_max)
    with np.errstate(invalid="ignore"):
        ranges[~(ranges >= max(float(content.range_min), 0.0))] = 0.0  # NaN too
        if math.isfinite(longest):
            ranges[ranges > longest] = np.inf
    laser = mount.laser
    # Some lasers, driven by a motor of their own speed, send another number of beams each time.
    start, step = float(content.angle_min), float(content.angle_increment)
    sign = 1.0 if laser.step * step > 0 else -1.0
    turned = wrap_angle(sign * start - laser.first_angle) if math.isfinite(start) else math.inf
    same_step = math.isclose(sign * step, laser.step, rel_tol=1e-3)
    if len(ranges) == laser.beams and same_step and abs(turned) < abs(step) / 2:
        return ranges
    taken = np.zeros(laser.beams, np.float32)
    if step and math.isfinite(step) and math.isfinite(turned) and len(ranges):
        index = np.rint((sign * laser.bearings() - start) / step).astype(np.int64)
        # A whole turn further, a beam that looks around is the same.
        whole = round(math.tau / abs(step))
        index[index < 0] += whole
        index[index >= len(ranges)] -= whole
        there = (index >= 0) & (index < len(ranges))
        taken[there] = ranges[index[there]]
    return taken


def _poses(name: str, content: Any, message: Message, base: str) -> Iterator[tuple[float, Pose2]]:
    try:
        if message.channel.type == ODOMETRY:
            pose = content.pose.pose
            yield (
                stamp_of(content.header, message.received),
                level_pose(matrix_of(pose.position, pose.orientation))[0],
            )
            return
        for found in content.transforms:
            if (frame_name(found.header.frame_id), frame_name(found.child_frame_id)) == (ODOM_FRAME, base):
                move = found.transform
                yield (
                    stamp_of(found.header, message.received),
                    level_pose(matrix_of(move.translation, move.rotation))[0],
                )
    except BadMessageError as error:
        raise _of(name, message, error) from error


def _content(name: str, message: Message) -> Any:
    kind = message.channel.type
    try:
        return decoded(message.data, kind, message.channel.encoding, kind.rpartition("/")[2])
    except BadMessageError as error:
        raise _of(name, message, error) from error


def _of(name: str, message: Message, error: BadMessageError) -> RecordingError:
    return RecordingError.of(
        name, f"{message.channel.topic} has {error}, received at {seconds(message.received):.3f} s"
    )
