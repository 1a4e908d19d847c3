"""Logs of CARMEN, in which most public laser data of the years around 2005 are kept."""

from __future__ import annotations

import gzip
import itertools
import math
import os
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing
from typing import BinaryIO, NamedTuple, cast

import numpy as np

from mapmeld.io import AnyPath
from mapmeld.io.images import open_regular
from mapmeld.io.in_order import InOrder
from mapmeld.io.scan_stream import ScanFileError, ScanStream
from mapmeld.recording import Laser, Scan
from mapmeld.se2 import Pose2

MAX_LINE_BYTES = 1 << 20
MAX_BEAMS = 100_000

DEFAULT_MAX_RANGE = 80.0
"""Range [m] of a laser of which the log does not say it: that of the SICK lasers of FLASER lines."""

_MAX_PARAMETERS = {"robot_front_laser_max", "laser_front_laser_max"}
_OFFSET_PARAMETER = "robot_frontlaser_offset"

# A laser farther from the middle of its robot than this [m] is no mount, but a pose corrected by somebody.
_FARTHEST_MOUNT = 1.0


class _Line(NamedTuple):
    """A scan as one line tells it."""

    first_angle: float
    step: float
    max_range: float | None
    ranges: list[float]
    T_odom_base: Pose2
    T_base_laser: Pose2 | None
    stamp: float


def carmen_scans(path: AnyPath) -> ScanStream:
    """Read the scans of a CARMEN log, as they are asked for.

    Lines ``FLASER`` (bearings: half a circle, ahead) or ``ROBOTLASER1`` (which say theirs), whichever
    comes first; both carry the odometry at the scan, so ``ODOM`` and other lines are not needed. ``PARAM``
    lines may give the range and the offset of the laser.

    Raises
    ------
    ScanFileError
        At once: there is no such line. While scans are taken: a line is damaged. A last line that was
        cut off is passed over.
    """
    name = os.fsdecode(path)
    left_out: Counter[str] = Counter()
    lines = _scan_lines(name, left_out)
    kind, first, parameters = next(lines, (None, None, {}))
    if first is None:
        raise ScanFileError.of(name, "is no CARMEN log with scans: it has no FLASER and no ROBOTLASER1 lines")
    stated = next((float(parameters[p]) for p in sorted(_MAX_PARAMETERS) if p in parameters), None)
    offset = Pose2(float(parameters.get(_OFFSET_PARAMETER, 0.0)), 0.0)
    mount = offset if first.T_base_laser is None else first.T_base_laser
    if math.hypot(mount.x, mount.y) > _FARTHEST_MOUNT:
        mount = Pose2()
    laser = Laser(
        len(first.ranges),
        first.first_angle,
        first.step,
        first.max_range or stated or DEFAULT_MAX_RANGE,
        mount,
    )
    if laser.beams < 1:
        raise ScanFileError.of(name, f"its first {kind} line has no readings")
    return ScanStream(laser, _scans(name, laser, first, lines, left_out), left_out)


def _scans(
    name: str,
    laser: Laser,
    first: _Line,
    lines: Iterator[tuple[str, _Line, dict[str, float]]],
    left_out: Counter[str],
) -> Iterator[Scan]:
    in_order = InOrder[_Line]("a scan", left_out, repeats=True)
    for line in itertools.chain([first], (line for _, line, _ in lines)):
        if len(line.ranges) != laser.beams:
            left_out[f"a scan that has not {laser.beams} beams, as the first one has"] += 1
        else:
            yield from map(_scan, in_order.add(line.stamp, line))
    yield from map(_scan, in_order.rest())


def _scan(stamped: tuple[float, _Line]) -> Scan:
    stamp, line = stamped
    return Scan(stamp, line.T_odom_base, np.array(line.ranges, np.float32))


def _scan_lines(name: str, left_out: Counter[str]) -> Iterator[tuple[str, _Line, dict[str, float]]]:
    """Give the lines of one kind, parsed, each with the parameters that the log has given so far."""
    parameters: dict[str, float] = {}
    chosen: str | None = None
    for number, raw in _numbered(name):
        kind, *words = raw.decode("latin-1").split()[: MAX_BEAMS * 2] or [""]
        if kind == "PARAM" and len(words) >= 2:
            try:
                value = float(words[1])
            except ValueError:
                continue
            if math.isfinite(value):
                parameters[words[0]] = value
        elif kind in _PARSERS and chosen in (None, kind):
            try:
                line = _PARSERS[kind](words)
            except (ValueError, IndexError) as error:
                if not raw.endswith(b"\n"):
                    left_out["a last line that is cut off"] += 1
                    return
                reason = (
                    str(error)
                    if isinstance(error, _BadLineError)
                    else "it is cut off, or has a word for a number"
                )
                raise ScanFileError.of(name, f"line {number} is no {kind} line: {reason}") from error
            chosen = kind
            yield kind, line, parameters


def _numbered(name: str) -> Iterator[tuple[int, bytes]]:
    with open_regular(name) as (file, _):
        packed = file.read(2) == b"\x1f\x8b"
        file.seek(0)
        with closing(cast(BinaryIO, gzip.GzipFile(fileobj=file)) if packed else file) as text:
            for number in itertools.count(1):
                try:
                    raw = text.readline(MAX_LINE_BYTES)
                except (EOFError, OSError, zlib.error) as error:
                    raise ScanFileError.of(
                        name, f"cannot be unpacked after line {number - 1}: {error}"
                    ) from error
                if not raw:
                    return
                if len(raw) == MAX_LINE_BYTES:
                    raise ScanFileError.of(name, f"line {number} is too long for a CARMEN log")
                yield number, raw


# ---------------------------------------------------------------------- the two kinds of lines
class _BadLineError(ValueError):
    """A line that contradicts itself; the message says how."""


def _flaser(words: list[str]) -> _Line:
    # FLASER n ranges x y theta odom_x odom_y odom_theta time host log_time
    ranges, rest = _counted(words)
    numbers = _numbers(rest[:7])
    if len(numbers) < 7:
        raise _BadLineError("it ends before its time")
    steps = len(ranges) - 1 if len(ranges) % 2 else len(ranges)
    return _Line(-math.pi / 2, math.pi / max(steps, 1), None, ranges, Pose2(*numbers[3:6]), None, numbers[6])


def _robotlaser(words: list[str]) -> _Line:
    # ROBOTLASER1 type start fov step max_range accuracy remission n ranges m remissions
    #     laser_x laser_y laser_theta robot_x robot_y robot_theta tv rv front side axis time host log_time
    _, start, _, step, max_range, _, _ = _numbers(words[:7])
    ranges, rest = _counted(words[7:])
    _, rest = _counted(rest)
    numbers = _numbers(rest[:12])
    if len(numbers) < 12:
        raise _BadLineError("it ends before its time")
    if not (step != 0 and max_range > 0):
        raise _BadLineError(f"a laser of {max_range:g} m with {step:g} rad from beam to beam")
    robot = Pose2(*numbers[3:6])
    return _Line(start, step, max_range, ranges, robot, robot.inverse() @ Pose2(*numbers[:3]), numbers[11])


def _counted(words: list[str]) -> tuple[list[float], list[str]]:
    """Return the numbers behind a number that says how many they are, and what follows."""
    count = int(words[0])
    if not 0 <= count <= MAX_BEAMS:
        raise _BadLineError(f"{count} readings")
    if len(words) - 1 < count:
        raise _BadLineError(f"it says {count} readings and has {len(words) - 1} words")
    return [float(word) for word in words[1 : count + 1]], words[count + 1 :]


def _numbers(words: list[str]) -> list[float]:
    numbers = [float(word) for word in words]
    if not all(map(math.isfinite, numbers)):
        raise _BadLineError("a pose or a time that is not finite")
    return numbers


_PARSERS: dict[str, Callable[[list[str]], _Line]] = {"FLASER": _flaser, "ROBOTLASER1": _robotlaser}
