from pathlib import Path

import cv2
import numpy as np
import pytest
from listing import contents
from numpy.typing import NDArray
from running import T_A_B, run, write_maps

from mapmeld.report.palette import BLUE, GREEN, RED


def read(path: Path) -> NDArray[np.uint8]:
    picture = cv2.imread(str(path))
    assert picture is not None
    return np.asarray(picture, np.uint8)


def share(picture: NDArray[np.uint8], colour: tuple[int, int, int]) -> int:
    return int((picture == colour).all(axis=2).sum())


def test_one_map(tmp_path: Path) -> None:
    (a,) = write_maps(tmp_path, "a")
    outcome = run("show", a, "-o", tmp_path / "p.png")
    assert outcome.code == 0
    assert str(tmp_path / "p.png") in outcome.out
    assert max(read(tmp_path / "p.png").shape) > 600


def test_two_maps_matched(tmp_path: Path) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    outcome = run("show", a, b, "-o", tmp_path / "p.png")
    assert outcome.code == 0
    assert "T_a_b" in outcome.out
    picture = read(tmp_path / "p.png")
    assert share(picture, GREEN) > 3 * (share(picture, RED) + share(picture, BLUE))


def test_a_given_transform_is_taken_as_it_is(tmp_path: Path) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    degrees = np.degrees(T_A_B.theta)
    run("show", a, b, "--transform", f"{T_A_B.x},{T_A_B.y},{degrees}", "-o", tmp_path / "right.png")
    outcome = run("show", a, b, "--transform", "-1, 2, -30", "-o", tmp_path / "wrong.png")
    assert outcome.code == 0
    assert "x -1.000 m, y 2.000 m, theta -30.00 deg" in outcome.out
    right, wrong = read(tmp_path / "right.png"), read(tmp_path / "wrong.png")
    assert share(right, GREEN) > 3 * share(wrong, GREEN)


def test_no_match_no_picture(tmp_path: Path) -> None:
    a, empty = write_maps(tmp_path, "a", "empty")
    before = contents(tmp_path)
    outcome = run("show", a, empty, "-o", tmp_path / "p.png")
    assert outcome.code == 1
    assert "nothing to match on" in outcome.line
    assert contents(tmp_path) == before


@pytest.mark.parametrize("text", ["1,2", "1,2,3,4", "a,b,c", "", "nan,0,0", "inf,0,0"])
def test_a_transform_that_is_none(tmp_path: Path, text: str) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    outcome = run("show", a, b, "--transform", text, "-o", tmp_path / "p.png")
    assert outcome.code == 2
    assert "--transform" in outcome.line


def test_pictures_are_png_and_not_replaced_unasked(tmp_path: Path) -> None:
    (a,) = write_maps(tmp_path, "a")
    assert run("show", a, "-o", tmp_path / "p.jpg").code == 2
    (tmp_path / "p.png").write_text("mine")
    outcome = run("show", a, "-o", tmp_path / "p.png")
    assert outcome.code == 2
    assert "p.png" in outcome.line
    assert (tmp_path / "p.png").read_text() == "mine"
    assert run("show", a, "-o", tmp_path / "p.png", "--force").code == 0
