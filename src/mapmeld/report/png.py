"""The only part of the report that touches files."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np

from mapmeld.errors import MapmeldError
from mapmeld.io.atomic import check_targets, write_files
from mapmeld.report.canvas import Picture


class PictureError(MapmeldError):
    """A picture that cannot be written as asked."""


def check_picture_path(path: str | os.PathLike[str], *, force: bool = False) -> None:
    """Find out, before the picture is made, that it could not be written.

    Raises
    ------
    PictureError
        The name does not end in ``.png``.
    MapFileError
        The file exists (and `force` is not set) or its folder does not.
    """
    if Path(path).suffix.lower() != ".png":
        raise PictureError(f"{os.fspath(path)}: pictures are written as PNG; choose a name that ends in .png")
    check_targets([path], force=force)


def write_picture(picture: Picture, path: str | os.PathLike[str], *, force: bool = False) -> Path:
    """Write a picture as PNG, whole or not at all; return the path.

    Raises
    ------
    PictureError, MapFileError
        As `check_picture_path`, or the disk refuses.
    """
    check_picture_path(path, force=force)
    write_files([(path, (png_bytes(picture),))], force=force)
    return Path(path)


def png_bytes(picture: Picture) -> bytes:
    """Return the content of a PNG file.

    Raises
    ------
    PictureError
        OpenCV fails.
    """
    done, data = cv2.imencode(".png", picture)
    if not done:
        raise PictureError("OpenCV could not encode the picture")
    return np.asarray(data, dtype=np.uint8).tobytes()
