"""Maps in and out: one module per file format, and `load` that picks the one a path needs.

Importing this package imports no reader; each one comes with the first file that needs it.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Literal, NamedTuple, Self

from mapmeld.errors import MapmeldError

if TYPE_CHECKING:
    from pathlib import Path

    from mapmeld.grid import OccupancyGrid

__all__ = [
    "FORMATS",
    "ImageFormat",
    "MapFileError",
    "MapFormat",
    "Mode",
    "format_of",
    "load",
    "printable",
    "save",
]

Mode = Literal["trinary", "scale", "raw"]
ImageFormat = Literal["pgm", "png"]
AnyPath = str | os.PathLike[str]


class MapFileError(MapmeldError):
    """A map that cannot be read or written as asked; the message names the file."""

    @classmethod
    def of(cls, path: AnyPath, problem: str) -> Self:
        """Return the error ``path: problem`` on one line, whatever characters the two hold."""
        return cls(printable(f"{os.fspath(path)}: {problem}"))


def printable(text: str) -> str:
    """Return a text on one line, with backslash escapes for what would not show as it is."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


# ---------------------------------------------------------------------- the readers
class MapFormat(NamedTuple):
    """A kind of map file that `load` understands.

    Attributes
    ----------
    suffixes
        Endings (lower case, with the dot) by which a path is known to be of this kind.
    read
        Takes the path exactly as it was given to `load` (for recordings it holds more than a
        file name) and the resolution [m] or None.
    """

    suffixes: tuple[str, ...]
    read: Callable[[str, float | None], OccupancyGrid]


def _read_map_server(path: str, resolution: float | None) -> OccupancyGrid:
    from mapmeld.io.map_server import read_map

    if resolution is not None:
        raise MapFileError.of(path, "states its own resolution; leave the resolution out")
    return read_map(path)


def _read_bare_image(path: str, resolution: float | None) -> OccupancyGrid:
    from mapmeld.io.map_server import read_bare_image

    if resolution is None:
        # A YAML file of the same stem may lie beside it, but need not belong to this image.
        raise MapFileError.of(
            path, "an image does not say how large its cells are; give its YAML file, or the resolution [m]"
        )
    return read_bare_image(path, resolution)


def _read_recording(path: str, resolution: float | None) -> OccupancyGrid:
    from mapmeld.io.recordings.states import read_state

    if resolution is not None:
        raise MapFileError.of(path, "states its own resolution; leave the resolution out")
    return read_state(path)


FORMATS: dict[str, MapFormat] = {
    "map_server": MapFormat((".yaml", ".yml"), _read_map_server),
    "image": MapFormat((".pgm", ".png", ".bmp"), _read_bare_image),
    "recording": MapFormat((".bag", ".mcap", ".db3"), _read_recording),
}


def format_of(path: AnyPath) -> str | None:
    """Return the name in `FORMATS` of the kind that a path is of; None if it does not tell."""
    from mapmeld.io.recordings.address import is_recording

    name = os.fsdecode(path)
    if is_recording(name):
        return "recording"
    ending = os.path.splitext(name)[1].lower()  # noqa: PTH122  (not every path is a file name)
    return next((kind for kind, found in FORMATS.items() if ending in found.suffixes), None)


def load(
    path: AnyPath,
    *,
    resolution: float | None = None,
    format: str | None = None,  # noqa: A002  (the word users look for)
) -> OccupancyGrid:
    """Read a map.

    Parameters
    ----------
    path
        A ``.yaml``/``.yml`` file of ROS ``map_server`` or nav2, which names its image; a
        bare ``.pgm``, ``.png`` or ``.bmp`` image; or a map in a recording, ``FILE#topic@time``: a
        rosbag1 or MCAP file or a rosbag2 folder, the topic (may be left out if only one has maps),
        and seconds since the recording began, or a stamp (if left out, the last state).
    resolution
        Side of a cell [m]. Needed for a bare image (whose lower left corner becomes the origin),
        an error for a file that states its own.
    format
        Name of a reader in `FORMATS` ("map_server", "image", "recording"), if the path does not tell.

    Returns
    -------
    OccupancyGrid
        Row 0 at the bottom; stamp and frame are those in a recording, the other files have none.

    Raises
    ------
    MapFileError
        The file is missing, damaged, too large, or not a map. The message is one line.
    MissingExtraError
        It is a recording, and the extra "bags" is not installed.
    """
    name = os.fsdecode(path)
    if format is None:
        format = format_of(name)  # noqa: A001
        if format is None:
            if os.path.isdir(name):  # noqa: PTH112  (not every path is a file name)
                raise MapFileError.of(name, "is a folder; name the map file in it")
            known = " ".join(suffix for kind in FORMATS.values() for suffix in kind.suffixes)
            raise MapFileError.of(name, f"not a known kind of map file (known: {known})")
    if format not in FORMATS:
        raise MapFileError.of(name, f"no map format is called {format!r} (there are: {', '.join(FORMATS)})")
    return FORMATS[format].read(name, resolution)


def save(
    grid: OccupancyGrid,
    path: AnyPath,
    *,
    mode: Mode = "trinary",
    image_format: ImageFormat | None = None,
    force: bool = False,
    occupied_thresh: float | None = None,
    free_thresh: float | None = None,
) -> tuple[Path, ...]:
    """Write a map as ROS ``map_server`` and nav2 do: a YAML file and an image beside it.

    See `mapmeld.io.map_server.write_map`, which this is, for what each mode keeps.

    Parameters
    ----------
    grid
        The map, of at least one cell.
    path
        The YAML file to write (``.yaml`` or ``.yml``); the image gets the same stem.
    mode
        "trinary" keeps free, occupied, unknown; "scale" and "raw" keep every percentage.
    image_format
        "pgm" or "png"; by default "pgm", and "png" in mode "scale", which needs transparency.
    force
        Replace files that exist.
    occupied_thresh, free_thresh
        Parts of one, 0 <= free < occupied <= 1. In mode "trinary": which cells are written
        as occupied and free (default 0.65 and 0.25). In mode "scale": between which occupancies
        readers stretch 0..100 (default 1 and 0: as they are).

    Returns
    -------
    tuple of Path
        The YAML file and the image.

    Raises
    ------
    MapFileError
        A file exists and `force` is not set, cannot be written, or the settings contradict.
        Nothing is left behind.
    """
    from mapmeld.io.map_server import write_map

    return write_map(
        grid,
        path,
        mode=mode,
        image_format=image_format,
        force=force,
        occupied_thresh=occupied_thresh,
        free_thresh=free_thresh,
    )
