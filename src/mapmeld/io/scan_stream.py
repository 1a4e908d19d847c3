"""What every reader of scans gives."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

from mapmeld.io import MapFileError
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
