"""Reading the maps that a command names."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mapmeld.cli.errors import say

if TYPE_CHECKING:
    from mapmeld.grid import OccupancyGrid
    from mapmeld.io import Mode


def load_maps(paths: Sequence[str], resolution: float | None) -> list[OccupancyGrid]:
    """Read maps; the resolution [m] is for those among them that are bare images.

    Raises
    ------
    MapFileError
        A map cannot be read, a resolution is given though no map needs one, or two maps have
        cells of such different sizes that one of them must be wrong.
    """
    from mapmeld.grid import ResolutionError, check_resolutions
    from mapmeld.io import MapFileError, format_of, load

    bare = [format_of(path) == "image" for path in paths]
    if resolution is not None and not any(bare):
        raise MapFileError("--resolution is for bare images; these maps state their own")
    grids = [
        load(path, resolution=resolution if is_bare else None)
        for path, is_bare in zip(paths, bare, strict=True)
    ]
    for path, grid in zip(paths, grids, strict=True):
        try:
            check_resolutions(grids[0], grid)
        except ResolutionError as error:
            raise MapFileError(f"{paths[0]} and {path}: {error}") from error
        _note_unknown_read_as_free(path, grid)
    return grids


def _note_unknown_read_as_free(path: str, grid: OccupancyGrid) -> None:
    """Say of a map that its unknown space was saved so that every reader takes it for floor.

    nav2 wrote grey 205 for unknown and beside it a free_thresh of 0.25, which makes 205 free.
    """
    from mapmeld.io import format_of
    from mapmeld.io.map_server import OLD_FREE_THRESH, read_description

    if grid.known.all() and grid.cells.size and format_of(path) == "map_server":
        described = read_description(path)
        if described.mode == "trinary" and described.free_thresh == OLD_FREE_THRESH:
            say(
                f"note: {path} has nothing unknown, and free_thresh {OLD_FREE_THRESH:g}: older nav2 saved "
                "maps so that unknown space reads as free; if so here, write free_thresh: 0.196 in it"
            )


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


def check_map_path(out: Path, *, force: bool) -> None:
    """Find out before the work that a map cannot be written under a name.

    Raises
    ------
    MapFileError
        The name does not end as a map's, or its files exist (and `force` is not set).
    """
    from mapmeld.io import MapFileError
    from mapmeld.io.atomic import check_targets

    if out.suffix.lower() not in (".yaml", ".yml"):
        raise MapFileError.of(
            out, "a map is written as a .yaml file with an image beside it; end it in .yaml"
        )
    check_targets([out, out.with_suffix(".pgm")], force=force)


def exact_mode(grid: OccupancyGrid) -> Mode:
    """Return the mode of a map file that loses nothing: "trinary" where there are no percentages."""
    import numpy as np

    from mapmeld.grid import FREE, OCCUPIED, UNKNOWN

    return "trinary" if np.isin(grid.cells, (UNKNOWN, FREE, OCCUPIED)).all() else "scale"
