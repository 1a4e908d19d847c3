"""Scans and odometry out of files: CARMEN logs and ROS recordings."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

from mapmeld.io import AnyPath, MapFileError
from mapmeld.io.images import open_regular
from mapmeld.recording import Laser, Scan


class ScanFileError(MapFileError):
    """A file whose scans cannot be read; the message names it."""


@dataclass(frozen=True, slots=True)
class ScanStream:
    """The scans of a file, read as they are asked for.

    Attributes
    ----------
    laser
        What they come from.
    scans
        In time order; can be gone through once.
    left_out
        What was passed over so far, and how often; grows while scans are taken.
    """

    laser: Laser
    scans: Iterator[Scan]
    left_out: Counter[str]


_RECORDINGS = (b"\x89MCAP", b"#ROSBAG", b"SQLite format 3")


def open_scans(path: AnyPath, scan: str | None = None, odom: str | None = None) -> ScanStream:
    """Open a file with scans; what it holds decides which kind it is.

    Parameters
    ----------
    path
        A CARMEN log (may be packed by gzip), or a recording as `mapmeld.io.recordings` reads them.
    scan, odom
        Topics of a recording; may be left out if there is only one of each.

    Raises
    ------
    ScanFileError
        It is none of these, or holds no scans; or topics were named for a CARMEN log.
    RecordingError
        The recording is damaged.
    MissingExtraError
        It is a recording, and the extra "bags" is not installed.
    """
    name = os.fsdecode(path)
    if os.path.isdir(name):  # noqa: PTH112  (a text as it was given)
        begin = _RECORDINGS[0]
    else:
        with open_regular(name) as (file, _):
            begin = file.read(16)
    if begin.startswith(_RECORDINGS):
        from mapmeld.io.recordings.scans import recorded_scans

        return recorded_scans(name, scan, odom)
    if scan is not None or odom is not None:
        raise ScanFileError.of(name, "is no ROS recording, so it has no topics")
    from mapmeld.io.carmen import carmen_scans

    return carmen_scans(name)
