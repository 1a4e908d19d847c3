"""How one state of a map in a recording is named: ``FILE#topic@time``.

Imports no library: every path of a map that a user gives comes by here.
"""

from __future__ import annotations

import os
import re
from typing import NamedTuple

from mapmeld.io import FORMATS, MapFileError

METADATA = "metadata.yaml"
"""The file that makes a folder a rosbag2 recording."""

ABSOLUTE_FROM = 1e8
"""From here on (1973) a time is the stamp of a map, below it seconds since the recording began."""


class Address(NamedTuple):
    """A recording, a topic (None: the only one with maps) and a time [s] (None: the last state)."""

    file: str
    topic: str | None
    time: float | None


def split_address(text: str) -> tuple[str, str | None]:
    """Return the file and what follows its ``#``; None where no recording is addressed.

    What exists under the whole name is that file, whatever signs are in its name.
    """
    file, sign, rest = text.rpartition("#")
    if not sign or not file or os.path.lexists(text):
        return text, None
    if os.path.lexists(file) or _has_suffix(file):
        return file, rest
    return text, None


def is_recording(text: str) -> bool:
    """Report whether a text names a recording, or a state in one, by its form and by what is on disk."""
    file, rest = split_address(text)
    folder = os.path.isfile(os.path.join(file, METADATA))  # noqa: PTH113, PTH118  (as above)
    return rest is not None or _has_suffix(file) or folder


def _has_suffix(file: str) -> bool:
    return file.lower().endswith(FORMATS["recording"].suffixes)


def parse_address(text: str) -> Address:
    """Read ``FILE``, ``FILE#topic``, ``FILE#topic@time`` or ``FILE#@time``.

    Raises
    ------
    MapFileError
        The time is no number of seconds from 0 on.
    """
    file, rest = split_address(text)
    if not rest:
        return Address(file, None, None)
    topic, sign, moment = rest.partition("@")
    if not sign:
        return Address(file, topic, None)
    if not re.fullmatch(r"\d{1,18}(\.\d*)?|\.\d+", moment, re.ASCII):
        raise MapFileError.of(
            text,
            f"the time after '@' must be a number of seconds since the recording began (as @12.5), "
            f"or a stamp of {ABSOLUTE_FROM:g} or more, not {moment[:40]!r}",
        )
    return Address(file, topic or None, float(moment))
