"""Opening a recording of any kind; what it holds decides which kind it is, not its name."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Literal, get_args

from mapmeld.io import AnyPath
from mapmeld.io.images import open_regular
from mapmeld.io.recordings import mcap_source, rosbag1_scan, rosbags_source, sqlite_scan
from mapmeld.io.recordings.address import METADATA
from mapmeld.io.recordings.folder_scan import folder_scan, storage_files
from mapmeld.io.recordings.messages import RecordingError
from mapmeld.io.recordings.source import Source, damage_said

Damaged = Literal["refuse", "use"]
"""What to do with a recording that cannot be read whole: refuse it, or use what can be read."""

_MAX_METADATA_BYTES = 1 << 24


@contextmanager
def open_recording(path: AnyPath, damaged: Damaged) -> Iterator[Source]:
    """Open a recording.

    Raises
    ------
    RecordingError
        It is none, of a kind that is not read, or damaged (and `damaged` is "refuse").
    MissingExtraError
        The extra "bags" is not installed.
    """
    name = os.fsdecode(path)
    if damaged not in get_args(Damaged):
        raise ValueError(f"damaged must be one of {', '.join(get_args(Damaged))}, not {damaged!r}")
    strict = damaged == "refuse"
    with ExitStack() as stack:
        if os.path.isdir(name):  # noqa: PTH112  (a text as it was given)
            with damage_said(name):
                _check_folder(name, strict)
            opened = rosbags_source.rosbag2_source(name) if strict else folder_scan(name)
        else:
            kind = _kind_of(name)
            if kind == "mcap":
                opened = mcap_source.mcap_source(name, strict=strict)
            elif kind == "rosbag1":
                opened = rosbags_source.rosbag1_source(name) if strict else rosbag1_scan.rosbag1_scan(name)
            else:
                opened = rosbags_source.rosbag2_source(name) if strict else sqlite_scan.sqlite_scan(name)
        yield stack.enter_context(opened)


def _kind_of(name: str) -> str:
    with open_regular(name) as (file, _):
        begin = file.read(16)
    if begin.startswith(mcap_source.MAGIC):
        return "mcap"
    if begin.startswith(rosbag1_scan.MAGIC):
        return "rosbag1"
    if begin.startswith(sqlite_scan.MAGIC):
        if not name.lower().endswith(".db3"):
            raise RecordingError.of(name, "is an SQLite database, but those of rosbag2 end in .db3")
        return "sqlite3"
    if begin.startswith(b"#ROSBAG V"):
        raise RecordingError.of(name, "is of an old version of rosbag1; 'rosbag fix' makes it one of 2.0")
    raise RecordingError.of(
        name, "is no recording (rosbag1 .bag, MCAP, or .db3 of rosbag2), or its begin is lost"
    )


def _check_folder(name: str, strict: bool) -> None:
    files = storage_files(name)
    for file in files:
        if not file.is_file():  # opening a pipe would wait for somebody to write into it
            raise RecordingError.of(file, "is not a plain file, so the recording is not read")
    metadata = Path(name, METADATA)
    if metadata.is_file():
        if metadata.stat().st_size > _MAX_METADATA_BYTES:
            raise RecordingError.of(metadata, f"is too large ({metadata.stat().st_size:,} bytes)")
    elif strict:
        hint = f"; name the file in it ({files[0].name}), or see 'mapmeld bag export --help'" if files else ""
        raise RecordingError.of(
            name, f"is a folder without {METADATA}, so not a whole rosbag2 recording{hint}"
        )
