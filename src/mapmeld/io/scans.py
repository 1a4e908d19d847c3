"""Scans and odometry out of files: CARMEN logs and ROS recordings."""

from __future__ import annotations

import os

from mapmeld.io import AnyPath
from mapmeld.io.images import open_regular
from mapmeld.io.scan_stream import ScanFileError, ScanStream

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
