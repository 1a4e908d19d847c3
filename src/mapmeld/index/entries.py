"""What an index holds: maps by their names in a folder, and their signatures."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from mapmeld.errors import MapmeldError
from mapmeld.index.ranking import Ranking
from mapmeld.io import printable


class MapIndexError(MapmeldError):
    """An index that cannot be made, read or used; the message is one line."""

    @classmethod
    def of(cls, path: Path, problem: str) -> MapIndexError:
        """Return the error ``path: problem``."""
        return cls(printable(f"{path}: {problem}"))


class Stamp(NamedTuple):
    """What tells that a file is as it was: its size [bytes] and when it was last changed [ns].

    A tuple, as the maps of an index are: thousands are made for every query.
    """

    size: int
    changed: int

    @classmethod
    def of(cls, path: Path) -> Stamp | None:
        """Return the stamp of a file as it is now; None if there is none."""
        try:
            found = path.stat()
        except (OSError, ValueError):
            return None
        return cls(found.st_size, found.st_mtime_ns)


class IndexedMap(NamedTuple):
    """A map in an index.

    Attributes
    ----------
    name
        Its YAML file, relative to the index's folder of maps, with slashes.
    image
        The image that the YAML file named, as `os.path.join` takes it from the YAML file's folder.
    stamps
        Of the YAML file and of the image, when they were read.
    """

    name: str
    image: str
    stamps: tuple[Stamp, Stamp]

    def path(self, root: Path) -> Path:
        """Return where the map is under a folder of maps."""
        return root / self.name

    def is_unchanged(self, root: Path) -> bool:
        """Whether both files are as they were when they were read."""
        path = self.path(root)
        image = Path(os.path.join(path.parent, self.image))  # noqa: PTH118  (the image may be absolute)
        return (Stamp.of(path), Stamp.of(image)) == self.stamps


@dataclass(frozen=True, slots=True, eq=False)
class MapIndex:
    """The maps under a folder.

    Attributes
    ----------
    root
        The folder.
    maps
        In the order of their names.
    ranking
        What they look like, in the same order.
    """

    root: Path
    maps: tuple[IndexedMap, ...]
    ranking: Ranking
