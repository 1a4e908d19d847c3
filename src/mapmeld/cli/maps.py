"""Reading the maps that a command names."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mapmeld.grid import OccupancyGrid


def load_maps(paths: Sequence[str], resolution: float | None) -> list[OccupancyGrid]:
    """Read maps; the resolution [m] is for those among them that are bare images.

    Raises
    ------
    MapFileError
        A map cannot be read, a resolution is given though no map needs one, or two maps have
        cells of such different sizes that one of them must be wrong.
    """
    from mapmeld.grid import MAX_RATIO
    from mapmeld.io import MapFileError, format_of, load

    bare = [format_of(path) == "image" for path in paths]
    if resolution is not None and not any(bare):
        raise MapFileError("--resolution is for bare images; these maps state their own")
    grids = [
        load(path, resolution=resolution if is_bare else None)
        for path, is_bare in zip(paths, bare, strict=True)
    ]
    for path, grid in zip(paths, grids, strict=True):
        cells = (grids[0].resolution, grid.resolution)
        if max(cells) > MAX_RATIO * min(cells):
            raise MapFileError.of(
                path,
                f"has cells of {cells[1]:g} m, {paths[0]} of {cells[0]:g} m, which is more than a factor of "
                f"{MAX_RATIO} apart; check the resolutions",
            )
    return grids


def names_of(paths: Sequence[str]) -> list[str]:
    """Return the shortest ends of the paths that tell them apart: usually the file names.

    Of a map in a recording, what follows the file's name is kept as it is.
    """
    from mapmeld.io.recordings.address import split_address

    split = [split_address(path) for path in paths]
    parts = [Path(file).parts for file, _ in split]
    within = ["" if rest is None else f"#{rest}" for _, rest in split]
    for depth in range(1, max(map(len, parts), default=1) + 1):
        names = ["/".join(own[-depth:]) + rest for own, rest in zip(parts, within, strict=True)]
        if len(set(names)) == len(names):
            return names
    return list(paths)


def same_map(path: str) -> str:
    """Return a text that is the same for two paths if they are surely of the same map."""
    from mapmeld.io.recordings.address import split_address

    file, rest = split_address(path)
    return os.path.realpath(file) + ("" if rest is None else f"#{rest}")
