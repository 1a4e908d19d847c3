"""Write files whole or not at all, and never over another one unasked."""

from __future__ import annotations

import contextlib
import os
import secrets
import stat
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

from mapmeld.io import AnyPath, MapFileError

Chunks = Sequence[bytes | memoryview]


def check_targets(paths: Sequence[AnyPath], *, force: bool) -> None:
    """Find out early, before any work is put into them, that files cannot be written.

    Raises
    ------
    MapFileError
        A folder is missing, a path exists and `force` is not set, or it is not a plain file.
    """
    for path in map(Path, paths):
        with _explained(path):
            if not path.parent.is_dir():
                raise MapFileError.of(path, f"the folder {path.parent} does not exist; make it first")
            if not os.path.lexists(path):
                continue
            if not force:
                raise MapFileError.of(
                    path, "exists already; choose another name, or force=True to replace it"
                )
            if path.exists() and not stat.S_ISREG(path.stat().st_mode):
                raise MapFileError.of(path, "exists and is not a plain file, so it is not replaced")


def write_files(files: Sequence[tuple[AnyPath, Chunks]], *, force: bool = False) -> None:
    """Write files that belong together, each whole or not at all.

    Every content goes to a temporary file in the target's own folder first; only when all are
    on disk do they take their names, in the given order. Put last the file that readers open.
    A symbolic link that is replaced keeps pointing where it did.

    Parameters
    ----------
    files
        Each path with its content in pieces.
    force
        Replace files that exist. Without it a file that appears in the last moment is safe too.

    Raises
    ------
    MapFileError
        As `check_targets`, or the disk refuses. Temporary files are gone, and so are (without
        `force`) those that had their names already; with `force` a failure between two renames
        can leave the first file new and the second old.
    """
    check_targets([path for path, _ in files], force=force)
    targets = [Path(os.path.realpath(path)) if force else Path(path) for path, _ in files]
    temporary = [target.with_name(f".mapmeld-{secrets.token_hex(8)}.tmp") for target in targets]
    placed: list[Path] = []
    try:
        for target, temp, (_, chunks) in zip(targets, temporary, files, strict=True):
            with _explained(target):
                _write(temp, chunks)
        for target, temp in zip(targets, temporary, strict=True):
            with _explained(target):
                if force:
                    temp.replace(target)
                else:
                    _place(temp, target)
                    placed.append(target)
        placed.clear()
    finally:
        for leftover in [*temporary, *placed]:
            with contextlib.suppress(OSError):
                leftover.unlink()


@contextlib.contextmanager
def whole_file(path: AnyPath, *, force: bool = False) -> Iterator[BinaryIO]:
    """Give a temporary file beside `path` to write to, that takes its name when the block ends well.

    For what is too large, or takes too long, to hold in memory; else as `write_files`. With an exception
    in the block nothing is left behind.

    Raises
    ------
    MapFileError
        As `check_targets`, or the disk refuses.
    """
    check_targets([path], force=force)
    target = Path(os.path.realpath(path)) if force else Path(path)
    temp = target.with_name(f".mapmeld-{secrets.token_hex(8)}.tmp")
    try:
        with _explained(target):
            file = temp.open("xb")
        with file:
            yield file
            with _explained(target):
                file.flush()
                os.fsync(file.fileno())
        with _explained(target):
            if force:
                temp.replace(target)
            else:
                _place(temp, target)
    finally:
        with contextlib.suppress(OSError):
            temp.unlink()


def _write(path: Path, chunks: Chunks) -> None:
    # "x" gives the permissions that the umask asks for, which tempfile's private files lack.
    with path.open("xb") as file:
        for chunk in chunks:
            file.write(chunk)
        file.flush()
        # Without this a power cut soon after the rename could leave an empty file of the right name.
        os.fsync(file.fileno())


def _place(temp: Path, target: Path) -> None:
    """Give `temp` the name `target`, failing if that exists (which a rename would not)."""
    try:
        os.link(temp, target)
    except FileExistsError:
        raise
    except OSError:  # a file system without hard links
        if os.path.lexists(target):
            raise FileExistsError from None
        temp.rename(target)


@contextlib.contextmanager
def _explained(path: Path) -> Iterator[None]:
    """Turn what the operating system says about `path` into one line."""
    try:
        yield
    except FileExistsError:
        raise MapFileError.of(
            path, "exists already; choose another name, or force=True to replace it"
        ) from None
    except OSError as error:
        raise MapFileError.of(path, f"cannot be written: {error.strerror or error}") from error
    except ValueError as error:  # a null character in the name
        raise MapFileError.of(path, f"not a usable file name: {error}") from error
