"""Writing a folder of results whole or not at all, and never over another one unasked."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from mapmeld.errors import MapmeldError


class FolderError(MapmeldError):
    """A folder that cannot be written as asked."""


def check_folder(folder: Path, *, force: bool) -> None:
    """Find out, before any work is put into it, that a folder cannot be written.

    Raises
    ------
    FolderError
        It is not empty (and `force` is not set), not a folder, or its parent does not exist.
    """
    try:
        if not os.path.lexists(folder):
            if not folder.absolute().parent.is_dir():
                raise FolderError(f"{folder}: the folder {folder.parent} does not exist; make it first")
        elif not folder.is_dir():
            raise FolderError(f"{folder}: exists and is not a folder")
        elif not force and any(True for _ in folder.iterdir()):
            raise FolderError(
                f"{folder}: is not empty; choose another folder, or force=True to write into it"
            )
    except OSError as error:
        raise FolderError(f"{folder}: cannot be written: {error.strerror}") from error


@contextmanager
def whole_folder(folder: Path, *, force: bool, ours: Collection[str]) -> Iterator[Path]:
    """Yield a temporary folder whose files go to `folder` when the block ends without an error.

    Parameters
    ----------
    folder
        A new folder appears under its name all at once. In one that exists, files of the
        same names are replaced one after the other; what else lies in it is left alone.
    force
        Write into a folder that is not empty.
    ours
        Relative paths that earlier runs may have left; those not written anew are removed, and folders
        that are empty then, so that the folder never holds a mixture of two runs.

    Raises
    ------
    FolderError
        As `check_folder`, or the disk refuses.
    """
    check_folder(folder, force=force)
    # Beside a new folder, inside one that exists: always on the same file system.
    name = f".mapmeld-{secrets.token_hex(8)}.tmp"
    exists = folder.is_dir()
    temporary = folder / name if exists else folder.with_name(name)
    try:
        try:
            temporary.mkdir()
        except OSError as error:
            raise FolderError(f"{folder}: cannot be written: {error.strerror}") from error
        try:
            yield temporary
        # The temporary folder is nothing that the user knows of.
        except MapmeldError as error:
            problem = str(error)
            if name not in problem:
                raise
            named = problem.replace(f"{name}{os.sep}", "") if exists else problem.replace(name, folder.name)
            raise FolderError(named) from error
        except OSError as error:
            if name not in str(error.filename):
                raise
            raise FolderError(f"{folder}: cannot be written: {error.strerror}") from error
        try:
            if exists:
                _move_into(temporary, folder, force, ours)
            else:
                temporary.rename(folder)
        except OSError as error:
            raise FolderError(f"{folder}: cannot be written: {error.strerror}") from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _move_into(temporary: Path, folder: Path, force: bool, ours: Collection[str]) -> None:
    others = [path for path in folder.iterdir() if path != temporary]
    if others and not force:
        raise FolderError(
            f"{folder}: is not empty any more; choose another folder, or force=True to write into it"
        )
    written = sorted(path.relative_to(temporary) for path in temporary.rglob("*") if path.is_file())
    for path in written:
        if (folder / path).is_dir():
            raise FolderError(f"{folder / path}: is a folder, so no file can be written there")
    for path in written:
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (temporary / path).replace(folder / path)
    for stale in {Path(name) for name in ours} - set(written):
        (folder / stale).unlink(missing_ok=True)
        for parent in list(stale.parents)[:-1]:  # without `folder` itself
            with suppress(OSError):  # something else lies in it
                (folder / parent).rmdir()
