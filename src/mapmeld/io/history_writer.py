"""The history of a map as a folder: one ``map_server`` map per state, and ``times.txt`` with their times."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from mapmeld.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mapmeld.io import AnyPath, MapFileError, printable
from mapmeld.io.atomic import write_files
from mapmeld.io.folders import whole_folder
from mapmeld.io.map_server import write_map

TIMES = "times.txt"
_OURS = re.compile(r"state_\d{5,}\.(yaml|pgm)|times\.txt")


class NoStatesError(MapFileError):
    """A history without a state."""


def write_history(
    states: Iterable[OccupancyGrid], folder: AnyPath, *, force: bool = False
) -> tuple[Path, ...]:
    """Write the states of a map into a folder, which appears whole or not at all.

    The maps are ``state_00000.yaml``, ``state_00001.yaml`` and so on, which nobody can take for
    times, each with its image, and keep every percentage: in mode
    "trinary" where there is nothing but free, occupied and unknown, else in mode "raw". Each line
    of ``times.txt`` is the name of a map and its stamp in seconds; lines that begin with # are comments.
    The frames, for which neither file has a place, are named there.

    Parameters
    ----------
    states
        In time order, each with a stamp; taken one by one, so that they need not fit into memory.
    folder
        Where to; its parent must exist.
    force
        Write into a folder that is not empty. What an earlier history left there is replaced or removed,
        other files are left alone.

    Returns
    -------
    tuple of Path
        The YAML files.

    Raises
    ------
    NoStatesError
        There is no state.
    MapFileError
        One has no stamp.
    FolderError
        The folder is not empty (and `force` is not set) or cannot be written.
    """
    target = Path(folder)
    with whole_folder(target, force=force, ours=history_files(target)) as temporary:
        lines = ["# map  stamp [s]"]
        frame = None
        for number, grid in enumerate(states):
            if grid.stamp is None:
                raise MapFileError.of(folder, f"state {number} has no stamp, so it has no place in a history")
            if grid.frame_id != frame:
                frame = grid.frame_id
                lines.append(f"# frame_id: {printable(frame)}")
            name = state_name(number)
            lossless = bool(np.isin(grid.cells, (UNKNOWN, FREE, OCCUPIED)).all())
            write_map(grid, temporary / name, mode="trinary" if lossless else "raw")
            lines.append(f"{name} {float(grid.stamp)!r}")
        names = [line.partition(" ")[0] for line in lines if not line.startswith("#")]
        if not names:
            raise NoStatesError.of(folder, "there is no map to write")
        write_files([(temporary / TIMES, ["\n".join([*lines, ""]).encode()])])
    return tuple(target / name for name in names)


def state_name(number: int) -> str:
    """Return the name of a state's file: one that is no time, should the list of times get lost."""
    return f"state_{number:05}.yaml"


def history_files(folder: AnyPath) -> list[str]:
    """Return the names of the files in a folder that are called as those of a history are."""
    try:
        return [name for name in os.listdir(folder) if _OURS.fullmatch(name)]  # noqa: PTH208  (names)
    except OSError:  # none yet; what else may be wrong is said when it is written
        return []
