from pathlib import Path

import cv2
import numpy as np
import pytest

from mapmeld.errors import MapmeldError
from mapmeld.report import PictureError, check_picture_path, write_picture

PICTURE = np.random.default_rng(0).integers(0, 256, (30, 40, 3), np.uint8)


def test_what_is_written_reads_back(tmp_path: Path) -> None:
    path = write_picture(PICTURE, tmp_path / "picture.png")
    read = cv2.imread(str(path))
    assert read is not None
    assert np.array_equal(read, PICTURE)
    assert [p.name for p in tmp_path.iterdir()] == ["picture.png"]


def test_nothing_is_replaced_unasked(tmp_path: Path) -> None:
    path = tmp_path / "picture.png"
    path.write_text("mine")
    with pytest.raises(MapmeldError, match="exists"):
        write_picture(PICTURE, path)
    assert path.read_text() == "mine"
    write_picture(PICTURE, path, force=True)
    assert path.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", ["picture.jpg", "picture", "picture.yaml"])
def test_only_png(tmp_path: Path, name: str) -> None:
    with pytest.raises(PictureError, match="PNG"):
        check_picture_path(tmp_path / name)


def test_a_missing_folder_is_found_out_early(tmp_path: Path) -> None:
    with pytest.raises(MapmeldError, match="does not exist"):
        check_picture_path(tmp_path / "no" / "picture.png")
