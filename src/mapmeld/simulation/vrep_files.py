"""The files of the V-REP map generator: its configuration and its map text.

Both formats are stated in the generator's own description (L. Jelinek, 2016,
https://github.com/Lukx19/Vrep-map-generator).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mapmeld.io import AnyPath, MapFileError
from mapmeld.io.atomic import write_files
from mapmeld.io.images import open_regular
from mapmeld.simulation.environment import MAX_SIDE, MIN_SIDE
from mapmeld.simulation.errors import SimulationError
from mapmeld.simulation.fields import ARMS, EMPTY, Fields, StrayDoorError, arms_of

MIN_ROOM, MAX_ROOM = 2, 20
MAX_ROOMS = 500

_MAX_BYTES = 1 << 18  # a ground of 200 x 200 fields takes half of it
_INTEGER = re.compile(r"-?[0-9]{1,6}")


@dataclass(frozen=True, slots=True)
class Configuration:
    """What the generator is to draw.

    Attributes
    ----------
    rooms
        How many.
    room_types
        (width, height) [fields, walls included] of the kinds of room, each 2 to 20.

    Raises
    ------
    SimulationError
        No kind of room, or a number out of range.
    """

    rooms: int = 10
    room_types: tuple[tuple[int, int], ...] = ((4, 4), (4, 6), (6, 4), (5, 5), (5, 7), (7, 5), (6, 6), (8, 5))

    def __post_init__(self) -> None:
        if not 0 <= self.rooms <= MAX_ROOMS:
            raise SimulationError(f"0 to {MAX_ROOMS} rooms can be drawn, not {self.rooms}")
        if self.rooms and not self.room_types:
            raise SimulationError("rooms need at least one room type, width:height")
        for sides in self.room_types:
            if not all(MIN_ROOM <= side <= MAX_ROOM for side in sides):
                raise SimulationError(
                    f"room type {sides[0]}:{sides[1]}: sides are integers from {MIN_ROOM} to {MAX_ROOM}"
                )


def read_configuration(path: AnyPath) -> Configuration:
    """Read a configuration: the number of rooms, then ``width:height`` of one room type a line.

    Raises
    ------
    MapFileError
        It cannot be read, or a line is not of that form; the message has its number.
    """
    (number, first), *others = _numbered_lines(path)
    if not _INTEGER.fullmatch(first):
        raise MapFileError.of(path, f"line {number}: the number of rooms is needed, not {first[:40]!r}")
    types = []
    for number, line in others:
        parts = line.split(":")
        if len(parts) != 2 or not all(_INTEGER.fullmatch(part.strip()) for part in parts):
            raise MapFileError.of(path, f"line {number}: a room type is width:height, not {line[:40]!r}")
        types.append((int(parts[0]), int(parts[1])))
        if not all(MIN_ROOM <= side <= MAX_ROOM for side in types[-1]):
            raise MapFileError.of(
                path, f"line {number}: sides of rooms are integers from {MIN_ROOM} to {MAX_ROOM}, not {line}"
            )
    try:
        return Configuration(int(first), tuple(types))
    except SimulationError as error:
        raise MapFileError.of(path, str(error)) from None


def configuration_text(configuration: Configuration) -> str:
    """Return the text that `read_configuration` reads."""
    return "".join(
        [f"{configuration.rooms}\n", *(f"{width}:{height}\n" for width, height in configuration.room_types)]
    )


def write_configuration(configuration: Configuration, path: AnyPath, *, force: bool = False) -> None:
    """Write a configuration as the generator reads it; errors as `mapmeld.io.atomic.write_files`."""
    write_files([(path, [configuration_text(configuration).encode()])], force=force)


def read_map_text(path: AnyPath) -> Fields:
    """Read a map text: a row of fields a line, the top row first, fields separated by ``:``.

    Returns
    -------
    Codes (rows, cols), row 0 at the bottom.

    Raises
    ------
    MapFileError
        It cannot be read, lines differ in length, a field has no known code, a door is in
        no wall, or the ground is too small or too large. The message has the line.
    """
    rows: list[list[int]] = []
    top, width = 0, 0
    for number, line in _numbered_lines(path):
        row = []
        for place, field in enumerate(line.split(":"), 1):
            code = int(field) if _INTEGER.fullmatch(field.strip()) else None
            if code is None or not EMPTY <= code < len(ARMS):
                raise MapFileError.of(
                    path,
                    f"line {number}, field {place}: {field[:20]!r} is no code of a field "
                    f"(integers from {EMPTY} to {len(ARMS) - 1})",
                )
            row.append(code)
        if not rows:
            top, width = number, len(row)
        if len(row) != width:
            raise MapFileError.of(path, f"line {number} has {len(row)} fields, line {top} has {width}")
        rows.append(row)
    if not (MIN_SIDE <= len(rows) <= MAX_SIDE and MIN_SIDE <= width <= MAX_SIDE):
        raise MapFileError.of(
            path,
            f"the ground has {width} x {len(rows)} fields; {MIN_SIDE} to {MAX_SIDE} each way can be read",
        )
    fields = np.array(rows[::-1], np.int8)
    try:
        arms_of(fields)
    except StrayDoorError as error:
        where = f"line {top + len(rows) - 1 - error.row}, field {error.col + 1}"
        raise MapFileError.of(path, f"{where}: a door that is in no wall") from None
    return fields


def map_text(fields: Fields) -> str:
    """Return the text that `read_map_text` reads."""
    return "".join(":".join(map(str, row)) + "\n" for row in fields[::-1].tolist())


def write_map_text(fields: Fields, path: AnyPath, *, force: bool = False) -> None:
    """Write a map text; errors as `mapmeld.io.atomic.write_files`."""
    write_files([(Path(path), [map_text(fields).encode()])], force=force)


def _numbered_lines(path: AnyPath) -> list[tuple[int, str]]:
    """Return the lines that are not blank, stripped, with their numbers; at least one.

    A blank line within the text is an error: one may have been cut out of it.
    """
    with open_regular(path) as (file, size):
        if size > _MAX_BYTES:
            raise MapFileError.of(path, f"is too large ({size:,} bytes, {_MAX_BYTES:,} at most)")
        data = file.read(_MAX_BYTES)
    try:
        text = data.decode("ascii")
    except UnicodeDecodeError:
        raise MapFileError.of(
            path, "is no text of the V-REP map generator (it holds more than ASCII)"
        ) from None
    lines = [line.strip() for line in text.rstrip().split("\n")]
    blank = next((number for number, line in enumerate(lines, 1) if not line), None)
    if blank is not None:
        raise MapFileError.of(path, f"line {blank} is blank")
    return list(enumerate(lines, 1))
