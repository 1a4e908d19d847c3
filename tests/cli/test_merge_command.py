import json
import os
import re
from pathlib import Path

import cv2
import pytest
from listing import contents
from running import T_A_B, run, run_for_real, write_maps

import mapmeld
from mapmeld.report.palette import BLUE, ORANGE
from mapmeld.se2 import Pose2


def test_three_maps_are_joined_and_written(tmp_path: Path) -> None:
    maps = write_maps(tmp_path, "a", "b", "c")
    outcome = run("merge", *maps, "-o", tmp_path / "m.yaml", "--overlay", tmp_path / "o.png")
    assert outcome.code == 0
    for name in ("m.yaml", "m.pgm", "o.png"):
        assert f"  {tmp_path / name}\n" in outcome.out
    merged = mapmeld.load(tmp_path / "m.yaml")
    assert merged.known_area > mapmeld.load(maps[0]).known_area * 0.99
    assert cv2.imread(str(tmp_path / "o.png")) is not None
    assert "T_1_i" in outcome.out
    assert outcome.out.count(" joined\n") == 2
    assert "theta [deg]" in outcome.out


def test_json_of_a_merge(tmp_path: Path) -> None:
    maps = write_maps(tmp_path, "a", "b")
    outcome = run_for_real("merge", "a.yaml", "b.yaml", "-o", "m.yaml", "--json", cwd=tmp_path)
    assert outcome.code == 0
    assert outcome.err == ""
    parsed = json.loads(outcome.out)
    assert parsed["schema"] == "mapmeld.merge/1"
    assert parsed["complete"] is True
    assert parsed["files"] == ["m.yaml", "m.pgm"]
    assert [m["path"] for m in parsed["maps"]] == [m.name for m in maps]
    assert Pose2(**parsed["maps"][1]["T_1_i"]).distance_to(T_A_B)[0] < 0.2
    assert parsed["components"] == [[0, 1]]


def test_a_map_that_does_not_fit_is_named_and_nothing_written(tmp_path: Path) -> None:
    maps = write_maps(tmp_path, "a", "b", "empty")
    before = contents(tmp_path)
    outcome = run("merge", *maps, "-o", tmp_path / "m.yaml", "--overlay", tmp_path / "o.png")
    assert outcome.code == 1
    assert "empty.yaml was not joined: nothing to match on" in outcome.out
    assert outcome.out.endswith("Nothing written. --partial writes the 2 maps that were joined.\n")
    assert contents(tmp_path) == before
    parsed = json.loads(run("merge", *maps, "-o", tmp_path / "m.yaml", "--json").out)
    assert parsed["complete"] is False
    assert parsed["maps"][2]["T_1_i"] is None
    assert parsed["files"] == []
    assert [r["index"] for r in parsed["refused"]] == [2]


def test_a_part_is_written_when_asked_for(tmp_path: Path) -> None:
    maps = write_maps(tmp_path, "a", "empty", "b")
    outcome = run("merge", *maps, "-o", tmp_path / "m.yaml", "--overlay", tmp_path / "o.png", "--partial")
    assert outcome.code == 1
    assert contents(tmp_path) >= {"m.yaml", "m.pgm", "o.png"}
    assert "empty.yaml was not joined" in outcome.out


def test_one_map_alone_is_no_part(tmp_path: Path) -> None:
    maps = write_maps(tmp_path, "a", "empty")
    before = contents(tmp_path)
    outcome = run("merge", *maps, "-o", tmp_path / "m.yaml", "--partial")
    assert outcome.code == 1
    assert outcome.out.endswith("Nothing written.\n")
    assert contents(tmp_path) == before


@pytest.mark.parametrize("taken", ["m.yaml", "m.pgm", "o.png"])
def test_nothing_is_replaced_unasked(tmp_path: Path, taken: str, monkeypatch: pytest.MonkeyPatch) -> None:
    maps = write_maps(tmp_path, "a", "b")
    (tmp_path / taken).write_text("mine")
    arguments = ["merge", *maps, "-o", tmp_path / "m.yaml", "--overlay", tmp_path / "o.png"]
    before = contents(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr("mapmeld.merging.merge", lambda *_, **__: pytest.fail("matched before it looked"))
        outcome = run(*arguments)
    assert outcome.code == 2
    assert taken in outcome.line
    assert contents(tmp_path) == before
    assert (tmp_path / taken).read_text() == "mine"
    assert run(*arguments, "--force").code == 0
    assert (tmp_path / taken).read_bytes() != b"mine"


@pytest.mark.parametrize(
    ("out", "overlay", "mode"),
    [
        ("m.pgm", None, "trinary"),
        ("m", None, "trinary"),
        ("nowhere/m.yaml", None, "trinary"),
        ("m.yaml", "o.jpg", "trinary"),
        ("m.yaml", "m.png", "scale"),
    ],
)
def test_outputs_that_cannot_be_are_found_out_early(
    tmp_path: Path, out: str, overlay: str | None, mode: str
) -> None:
    maps = write_maps(tmp_path, "a", "b")
    before = contents(tmp_path)
    more = [] if overlay is None else ["--overlay", tmp_path / overlay]
    outcome = run("merge", *maps, "-o", tmp_path / out, "--mode", mode, *more)
    assert outcome.code == 2
    assert Path(overlay or out).name in outcome.line
    assert contents(tmp_path) == before


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_may_not_be_written(tmp_path: Path) -> None:
    maps = write_maps(tmp_path, "a", "b")
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o500)
    outcome = run("merge", *maps, "-o", locked / "m.yaml")
    assert outcome.code == 2
    assert "locked" in outcome.line


@pytest.mark.parametrize("fusion", ["log-odds", "average"])
def test_what_trinary_loses_is_said(tmp_path: Path, fusion: str) -> None:
    maps = write_maps(tmp_path, "a", "b")
    outcome = run("merge", *maps, "-o", tmp_path / "m.yaml", "--fusion", fusion)
    assert outcome.code == 0
    assert "--mode scale" in outcome.line
    outcome = run("merge", *maps, "-o", tmp_path / "s.yaml", "--fusion", fusion, "--mode", "scale")
    assert (outcome.code, outcome.err) == (0, "")
    assert "mode: scale" in (tmp_path / "s.yaml").read_text()


def test_maps_that_fit_one_another_but_not_the_first(tmp_path: Path) -> None:
    maps = write_maps(tmp_path, "empty", "a", "b")
    outcome = run("merge", *maps, "-o", tmp_path / "m.yaml")
    assert outcome.code == 1
    assert "These fit one another, but not map 1: a.yaml, b.yaml" in outcome.out


def test_a_map_given_twice_is_noted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    (tmp_path / "link.yaml").symlink_to(a)
    monkeypatch.chdir(tmp_path)
    outcome = run("merge", a, b, "./a.yaml", "link.yaml", "-o", "m.yaml")
    assert outcome.code == 0
    assert outcome.line == f"mapmeld: note: maps 1, 3 and 4 are the same file, {a}; it counts 3 times"
    outcome = run("merge", b, a, b, "-o", "m2.yaml", "--json")
    assert "maps 1 and 3 are the same file" in outcome.line
    assert "counts twice" in outcome.line
    assert json.loads(outcome.out)["complete"] is True


def test_the_table_of_a_merge_says_how_sure_it_is(tmp_path: Path) -> None:
    maps = write_maps(tmp_path, "a", "b")
    lines = run("merge", *maps, "-o", tmp_path / "m.yaml").out.splitlines()
    assert lines[1].split()[-2:] == ["similarity", "probability"]
    assert re.search(r" (> 0\.999|0\.9\d\d) ", lines[3])
    lines = run("merge", *maps, "-o", tmp_path / "m2.yaml", "--method", "alphabet").out.splitlines()
    assert lines[3].split()[-2:] == ["-", "joined"]


def test_a_map_keeps_its_colour_when_one_before_it_is_left_out(tmp_path: Path) -> None:
    maps = write_maps(tmp_path, "a", "empty", "b")
    run("merge", *maps, "-o", tmp_path / "m.yaml", "--overlay", tmp_path / "o.png", "--partial")
    picture = cv2.imread(str(tmp_path / "o.png"))
    assert picture is not None
    assert (picture == ORANGE).all(axis=2).any()
    assert not (picture == BLUE).all(axis=2).any()
