"""History folders: the states of one mapping process as ``map_server`` maps, with their times.

The time of a state [s] is its name (``00080.yaml``, ``12.345.yaml``), or stands in a file ``times.txt``:

    # a state and its time [s], one a line
    state_00000.yaml 0.0
    state_00001.yaml 5.5

There a state may be named without its ending too, or by its number alone. Where there is a
``times.txt``, only the maps that it names are states.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import overload

from mapmeld.grid import OccupancyGrid
from mapmeld.io import AnyPath, MapFileError
from mapmeld.io.history_writer import TIMES
from mapmeld.io.map_server import read_map

MAP_ENDINGS = (".yaml", ".yml")
_SECONDS = re.compile(r"\d+(\.\d+)?")
_GREATEST = 9e9  # [s] either way; from then on, the year 2255, stamps are a mistake, and no sums can be made
_LONGEST_TIMES = 10_000_000  # bytes; a day of states a second is 2 MB


@dataclass(frozen=True, slots=True)
class HistoryFolder(Sequence[OccupancyGrid]):
    """The states of a mapping process in time order; each is read when it is asked for, every time.

    Attributes
    ----------
    folder
        Where they lie.
    paths
        The map file of each state.
    stamps
        The time of each state [s], ascending.
    """

    folder: Path
    paths: tuple[Path, ...]
    stamps: tuple[float, ...]

    def __len__(self) -> int:
        return len(self.paths)

    @overload
    def __getitem__(self, index: int) -> OccupancyGrid: ...
    @overload
    def __getitem__(self, index: slice) -> HistoryFolder: ...
    def __getitem__(self, index: int | slice) -> OccupancyGrid | HistoryFolder:
        """Read a state (`MapFileError` if it is damaged), or leave some out."""
        if isinstance(index, slice):
            return replace(self, paths=self.paths[index], stamps=self.stamps[index])
        return replace(read_map(self.paths[index]), stamp=self.stamps[index])

    def __iter__(self) -> Iterator[OccupancyGrid]:
        return (self[i] for i in range(len(self)))


def read_history(folder: AnyPath) -> HistoryFolder:
    """Find the states in a history folder and their times; no map is read yet.

    Raises
    ------
    MapFileError
        It is no folder or cannot be read, holds no map, or a time is missing, stated twice or
        not a number.
    """
    place = Path(folder)
    if not place.is_dir():
        problem = "is not a folder" if os.path.lexists(place) else "there is no such folder"
        raise MapFileError.of(place, f"{problem}; a history is a folder of map_server maps")
    try:
        maps = sorted(
            path
            for path in place.iterdir()
            if path.suffix.lower() in MAP_ENDINGS and not path.name.startswith(".")
        )
        has_times = os.path.lexists(place / TIMES)
    except OSError as error:
        raise MapFileError.of(place, f"cannot be read: {error.strerror}") from error
    if not maps:
        raise MapFileError.of(place, "holds no map_server YAML files, so it is no history of a map")
    timed = _times_listed(place, maps) if has_times else _times_in_names(place, maps)
    timed.sort(key=lambda state: state[0])  # stable: states of the same moment stay in order
    stamps, paths = zip(*timed, strict=True)
    return HistoryFolder(place, paths, stamps)


def _times_in_names(folder: Path, maps: Sequence[Path]) -> list[tuple[float, Path]]:
    timed = []
    for path in maps:
        if not _SECONDS.fullmatch(path.stem):
            raise MapFileError.of(
                folder / path.name,
                "its name is no time; name states by their seconds (12.5.yaml), or list them in a "
                f"{TIMES} beside them: 'NAME.yaml SECONDS' on each line",
            )
        seconds = _number(path.stem)
        if seconds is None:
            raise MapFileError.of(folder / path.name, f"its name is no time: more than {_GREATEST:,.0f} s")
        timed.append((seconds, path))
    return timed


def _times_listed(folder: Path, maps: Sequence[Path]) -> list[tuple[float, Path]]:
    """Read ``times.txt``."""
    listing = folder / TIMES
    try:
        if listing.stat().st_size > _LONGEST_TIMES:
            raise MapFileError.of(
                listing, f"is longer than {_LONGEST_TIMES:,} bytes, so it is no list of times"
            )
        lines = listing.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise MapFileError.of(listing, f"cannot be read: {error.strerror}") from error
    except UnicodeDecodeError:
        raise MapFileError.of(listing, "is not a text file") from None
    by_name = {path.name: path for path in maps}
    by_name |= {path.stem: path for path in maps if path.stem not in by_name}
    by_number = {int(path.stem): path for path in maps if re.fullmatch(r"[0-9]{1,18}", path.stem)}
    timed: dict[Path, float] = {}
    for number, line in enumerate(lines, start=1):
        words = line.partition("#")[0].rsplit(maxsplit=1)
        if not words:
            continue
        seconds = _number(words[-1])
        if len(words) != 2 or seconds is None:
            raise MapFileError.of(
                listing,
                f"line {number}: 'NAME.yaml SECONDS' is needed, not {line[:80]!r}"
                f"; no time is beyond {_GREATEST:,.0f}",
            )
        name = words[0].strip()
        path = by_name.get(name)
        if path is None and re.fullmatch(r"[0-9]{1,18}", name):
            path = by_number.get(int(name))
        if path is None:
            raise MapFileError.of(listing, f"line {number}: there is no map {name[:80]!r} in the folder")
        if path in timed:
            raise MapFileError.of(listing, f"line {number}: {path.name} has a time already")
        timed[path] = seconds
    if not timed:
        raise MapFileError.of(listing, "names no states")
    return [(seconds, path) for path, seconds in timed.items()]


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if abs(value) <= _GREATEST else None
