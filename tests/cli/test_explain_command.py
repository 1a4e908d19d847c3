import errno
import json
import re
from importlib import import_module
from pathlib import Path

import cv2
import pytest
from listing import contents
from running import run, run_for_real, write_maps

from mapmeld.cli.parameters import effective_parameters
from mapmeld.report import FIGURE_NAMES

DOCUMENTS = {"index.md", "parameters.yaml", "result.json"}


def test_a_whole_folder(tmp_path: Path) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    out = tmp_path / "out"
    outcome = run("explain", a, b, "-o", out, "--set", "candidates=20")
    assert outcome.code == 0
    assert contents(out) == {*FIGURE_NAMES, *DOCUMENTS}
    assert all(cv2.imread(str(out / name)) is not None for name in FIGURE_NAMES)
    page = (out / "index.md").read_text()
    assert re.findall(r"\]\((\S+\.png)\)", page) == list(FIGURE_NAMES)
    assert json.loads((out / "result.json").read_text())["parameters"]["candidates"] == 20


def test_the_settings_written_are_settings_that_can_be_read(tmp_path: Path) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    settings = ["candidates=20", "distance_tolerance_px=0.00001"]
    run("explain", a, b, "-o", tmp_path / "out", "--set", settings[0], "--set", settings[1])
    read = effective_parameters("alphabet", tmp_path / "out" / "parameters.yaml", None)
    assert read == effective_parameters("alphabet", None, settings)


def test_maps_that_do_not_match_are_explained_too(tmp_path: Path) -> None:
    a, empty = write_maps(tmp_path, "a", "empty")
    outcome = run("explain", a, empty, "-o", tmp_path / "out")
    assert outcome.code == 1
    assert contents(tmp_path / "out") == {*FIGURE_NAMES[:8], *DOCUMENTS}
    assert "Rejected" in (tmp_path / "out" / "index.md").read_text()


def test_a_folder_that_is_not_empty_is_left_alone(tmp_path: Path) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    out = tmp_path / "out"
    out.mkdir()
    (out / "mine.txt").write_text("mine")
    outcome = run_for_real("explain", a, b, "-o", out, cwd=tmp_path)
    assert outcome.code == 2
    assert "out" in outcome.line
    assert contents(out) == {"mine.txt"}


def test_force_replaces_the_old_run_and_nothing_else(tmp_path: Path) -> None:
    a, b, empty = write_maps(tmp_path, "a", "b", "empty")
    out = tmp_path / "out"
    assert run("explain", a, b, "-o", out).code == 0
    (out / "mine.txt").write_text("mine")
    assert run("explain", a, empty, "-o", out, "--force").code == 1
    assert contents(out) == {*FIGURE_NAMES[:8], *DOCUMENTS, "mine.txt"}
    # A third run, which stops elsewhere and so gives other numbers.
    assert run("explain", a, b, "-o", out, "--force", "--set", "accept_similarity=0.99").code == 1
    third = contents(out)
    assert "14_overlay.png" in third
    assert run("explain", a, b, "-o", out, "--force").code == 0
    assert contents(out) == {*FIGURE_NAMES, *DOCUMENTS, "mine.txt"}


def test_a_full_disk_names_the_folder_that_was_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    a, b = write_maps(tmp_path, "a", "b")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("mapmeld.io.atomic._write", full)
    outcome = run("explain", a, b, "-o", tmp_path / "out")
    assert outcome.code == 2
    assert outcome.line == f"mapmeld: {tmp_path}/out/01_maps.png: cannot be written: No space left on device"
    assert {path.name for path in tmp_path.iterdir()} == {"a.yaml", "a.pgm", "b.yaml", "b.pgm"}


def test_a_bad_map_leaves_no_trace(tmp_path: Path) -> None:
    (a,) = write_maps(tmp_path, "a")
    before = contents(tmp_path)
    assert run("explain", a, tmp_path / "nowhere.yaml", "-o", tmp_path / "out").code == 2
    assert contents(tmp_path) == before
    assert not (tmp_path / "out").exists()


def test_a_failure_in_the_middle_leaves_no_trace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    a, b = write_maps(tmp_path, "a", "b")

    def stop(*_: object) -> str:
        raise KeyboardInterrupt

    # After all pictures have been written.
    monkeypatch.setattr(import_module("mapmeld.cli.explain"), "_page", stop)
    outcome = run("explain", a, b, "-o", tmp_path / "out")
    assert outcome.code == 130
    assert "interrupted" in outcome.line
    assert {path.name for path in tmp_path.iterdir()} == {"a.yaml", "a.pgm", "b.yaml", "b.pgm"}
