"""Making an index of all maps under a folder, and bringing it up to date."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from mapmeld.errors import MapmeldError
from mapmeld.index.entries import IndexedMap, MapIndex, MapIndexError, Stamp
from mapmeld.index.ranking import Ranking
from mapmeld.index.signature import Signature, signature_of
from mapmeld.io.map_server import read_description, read_map
from mapmeld.parallel import run_jobs

SAVE_EVERY = 5.0
"""[s] between two calls of `on_progress`, by which what is done so far can be kept."""

_Described = tuple[IndexedMap, Signature]


@dataclass(frozen=True, slots=True)
class Built:
    """An index, and what it took to make it.

    Attributes
    ----------
    index
        Every map under the folder that can be read.
    read
        How many maps were read for it.
    kept
        How many it knew and had not changed.
    gone
        Names of maps that it had, and that are no more.
    skipped
        Files that are not maps or cannot be read: (name, what is wrong in one line).
    """

    index: MapIndex
    read: int
    kept: int
    gone: tuple[str, ...]
    skipped: tuple[tuple[str, str], ...]


def map_files(root: Path) -> list[str]:
    """Return the names, relative to a folder and in order, of all files in and below it that may be maps.

    Links to folders are not followed, as they may lead round in circles; hidden folders are left out.

    Raises
    ------
    MapIndexError
        It is no folder, or cannot be listed.
    """
    if not root.is_dir():
        raise MapIndexError.of(root, "is not a folder of maps")

    def fail(error: OSError) -> None:
        raise MapIndexError.of(Path(error.filename or root), f"cannot be listed: {error.strerror}")

    found = []
    for folder, inner, files in os.walk(root, onerror=fail):
        inner[:] = [name for name in inner if not name.startswith(".")]
        within = Path(folder).relative_to(root)
        found += [(within / name).as_posix() for name in files if name.lower().endswith((".yaml", ".yml"))]
    return sorted(found)


def build_index(
    root: Path,
    names: list[str],
    known: MapIndex | None = None,
    *,
    workers: int = 0,
    on_map: Callable[[], object] | None = None,
    on_progress: Callable[[MapIndex], object] | None = None,
) -> Built:
    """Describe the maps of a folder.

    Parameters
    ----------
    root
        The folder.
    names
        Files in it, as from `map_files`.
    known
        An earlier index of the folder: maps whose files have the size and time that they had are taken
        from it.
    workers
        As for `mapmeld.parallel.run_jobs`.
    on_map
        Called as each file is done.
    on_progress
        Called now and then, and when the work is interrupted, with what is done so far.

    Raises
    ------
    WorkerDiedError
        Workers died again and again.
    """
    before = {m.name: number for number, m in enumerate(known.maps)} if known else {}
    done: dict[str, _Described] = {}
    for name in names:
        number = before.get(name)
        if known is not None and number is not None and known.maps[number].is_unchanged(root):
            done[name] = known.maps[number], known.ranking.signature(number)
            if on_map:
                on_map()
    kept = len(done)
    waiting = [name for name in names if name not in done]
    skipped: list[tuple[str, str]] = []
    due = time.monotonic() + SAVE_EVERY
    running = run_jobs(_described, [(root, name) for name in waiting], workers=workers)
    try:
        with contextlib.closing(running):
            for number, found in running:
                if isinstance(found, str):
                    skipped.append((waiting[number], found))
                else:
                    done[waiting[number]] = found
                if on_map:
                    on_map()
                if on_progress and time.monotonic() >= due:
                    on_progress(_index(root, done))
                    due = time.monotonic() + SAVE_EVERY
    except BaseException:
        if on_progress and len(done) > kept:
            on_progress(_index(root, done))
        raise
    gone = tuple(sorted(set(before) - set(names)))
    return Built(_index(root, done), len(done) - kept, kept, gone, tuple(sorted(skipped)))


def _index(root: Path, done: dict[str, _Described]) -> MapIndex:
    found = [done[name] for name in sorted(done)]
    return MapIndex(root, tuple(m for m, _ in found), Ranking.of([signature for _, signature in found]))


def _described(root: Path, name: str) -> _Described | str:
    """Return a map's entry and signature, or what is wrong with it."""
    path = root / name
    try:
        # Stamps first: if a file changes while it is read, it will not have them and be read again.
        stamp = Stamp.of(path)
        image = read_description(path).image
        image_stamp = Stamp.of(image)
        grid = read_map(path)
        signature = signature_of(grid)
    except MapmeldError as error:
        return str(error)
    if stamp is None or image_stamp is None:
        return f"{name}: went away while it was read"
    try:
        name.encode()
    except UnicodeEncodeError:
        return f"{name!r}: its name is not Unicode"
    return IndexedMap(name, os.path.relpath(image, path.parent), (stamp, image_stamp)), signature
