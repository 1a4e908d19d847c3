import json
from pathlib import Path

import cv2
import pytest
from changed_maps import CAME, WENT, write_old_and_new
from listing import contents
from running import T_A_B, run, write_maps

import mapmeld
from mapmeld.cli.diff import OURS
from mapmeld.report.palette import BLUE, RED

FILES = {"changes.png", "changes.yaml", "changes.pgm", "updated.yaml", "updated.pgm", "changes.geojson"}


def test_a_folder_with_all_that_changed(tmp_path: Path) -> None:
    old, new = write_old_and_new(tmp_path)
    outcome = run("diff", old, new, "-o", tmp_path / "d")
    assert (outcome.code, outcome.err) == (0, "")
    summary = outcome.out.splitlines()[0]
    assert "appeared in 1 place; " in summary
    assert "vanished in 1 place; " in summary
    assert contents(tmp_path / "d") == FILES
    for name in FILES:
        assert f"  {tmp_path / 'd' / name}\n" in outcome.out

    picture = cv2.imread(str(tmp_path / "d" / "changes.png"))
    assert picture is not None
    for colour in (RED, BLUE):
        assert (picture == colour).all(axis=2).sum() > 300

    listed = json.loads((tmp_path / "d" / "changes.geojson").read_text())
    assert [f["properties"]["kind"] for f in listed["features"]] == ["appeared", "vanished"]
    for feature, box in zip(listed["features"], (CAME, WENT), strict=True):
        assert feature["bbox"] == pytest.approx(box, abs=0.11)

    before = mapmeld.load(old)
    changes = mapmeld.load(tmp_path / "d" / "changes.yaml")
    assert set(changes.cells.ravel().tolist()) >= {0, 60, 100}
    updated = mapmeld.load(tmp_path / "d" / "updated.yaml")
    assert updated.resolution == changes.resolution == before.resolution
    for grid in (updated, changes):
        x, y = before.metres_to_lattice((grid.origin.x, grid.origin.y))
        assert (x, y) == pytest.approx((round(x), round(y)), abs=1e-6)
    for (x0, y0, x1, y1), there in ((CAME, True), (WENT, False)):
        col, row = updated.metres_to_lattice(((x0 + x1) / 2, (y0 + y1) / 2)).astype(int)
        assert updated.occupied[row, col] == there
        assert changes.occupied[row, col] == there


def test_json_of_a_diff(tmp_path: Path) -> None:
    old, new = write_old_and_new(tmp_path)
    outcome = run("diff", old, new, "-o", tmp_path / "d", "--json")
    assert (outcome.code, outcome.err) == (0, "")
    printed = json.loads(outcome.out)
    assert printed["schema"] == "mapmeld.diff/1"
    assert printed["match"]["verdict"] == "accepted"
    assert printed["match"]["method"] == "correlative"
    assert [region["kind"] for region in printed["regions"]] == ["appeared", "vanished"]
    assert printed["areas"]["appeared"] == pytest.approx(0.72, abs=0.12)
    assert {Path(file).name for file in printed["files"]} == FILES


def test_maps_that_do_not_match(tmp_path: Path) -> None:
    a, other = write_maps(tmp_path, "a", "empty")
    before = contents(tmp_path)
    outcome = run("diff", a, other, "-o", tmp_path / "d")
    assert outcome.code == 1
    assert outcome.out == ""
    assert "rejected: nothing to match on" in outcome.line
    assert "nothing written" in outcome.line
    outcome = run("diff", a, other, "-o", tmp_path / "d", "--json")
    assert outcome.code == 1
    printed = json.loads(outcome.out)
    assert printed["match"]["verdict"] == "rejected"
    assert (printed["T_old_new"], printed["areas"], printed["files"]) == (None, None, [])
    assert contents(tmp_path) == before


def test_a_transform_that_is_given(tmp_path: Path) -> None:
    a, other = write_maps(tmp_path, "a", "empty")
    outcome = run("diff", a, other, "-o", tmp_path / "d", "--transform", "0,0,0", "--json")
    assert outcome.code == 0
    printed = json.loads(outcome.out)
    assert printed["match"] is None
    assert printed["T_old_new"] == {"x": 0, "y": 0, "theta": 0}
    assert printed["areas"]["vanished"] > 1


def test_the_answer_of_a_match_can_be_given(tmp_path: Path) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    (tmp_path / "m.json").write_text(run("match", b, a, "--json").out)
    outcome = run("diff", a, b, "-o", tmp_path / "d", "--transform", tmp_path / "m.json", "--json")
    assert outcome.err == "", "the walls support it"
    printed = json.loads(outcome.out)
    assert mapmeld.Pose2(**printed["T_old_new"]).distance_to(T_A_B)[0] < 0.1
    assert printed["regions"] == []


def test_a_wrong_transform_is_carried_out_with_a_note(tmp_path: Path) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    outcome = run("diff", a, b, "-o", tmp_path / "d", "--transform", "4,-3,50")
    assert outcome.code == 0
    assert (
        "note: the walls of a.yaml and b.yaml do not support --transform 4,-3,50 (probability" in outcome.line
    )


def test_settings_are_heeded(tmp_path: Path) -> None:
    old, new = write_old_and_new(tmp_path)
    for setting, value in (("--min-area", 0.5), ("--tolerance", 3)):
        outcome = run("diff", old, new, "-o", tmp_path / setting, setting, value, "--json")
        assert len(json.loads(outcome.out)["regions"]) < 2
    outcome = run("diff", old, new, "-o", tmp_path / "rigid", "--max-bend", 0, "--json")
    assert json.loads(outcome.out)["bend"] == 0


@pytest.mark.parametrize("option", ["--tolerance", "--max-bend", "--min-area"])
@pytest.mark.parametrize("value", ["-1", "nan", "inf", "wide"])
def test_settings_that_make_no_sense(tmp_path: Path, option: str, value: str) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    before = contents(tmp_path)
    outcome = run("diff", a, b, "-o", tmp_path / "d", option, value)
    assert outcome.code == 2
    assert option in outcome.line
    assert contents(tmp_path) == before


def test_nothing_is_replaced_unasked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    old, new = write_old_and_new(tmp_path)
    (tmp_path / "d").mkdir()
    (tmp_path / "d" / "mine").write_text("mine")
    (tmp_path / "d" / "updated.png").write_text("of an earlier run")
    with monkeypatch.context() as patch:
        patch.setattr("mapmeld.changes.diff", lambda *_, **__: pytest.fail("compared before it looked"))
        outcome = run("diff", old, new, "-o", tmp_path / "d")
    assert outcome.code == 2
    assert "not empty" in outcome.line
    assert run("diff", old, new, "-o", tmp_path / "d", "--force").code == 0
    assert contents(tmp_path / "d") == {*FILES, "mine"}
    assert set(OURS) >= FILES


def test_percentages_are_kept_in_the_updated_map(tmp_path: Path) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    grid = mapmeld.load(a)
    cells = grid.cells.copy()
    cells[60:70, 30:40] = 10
    mapmeld.save(mapmeld.OccupancyGrid(cells, grid.resolution), tmp_path / "p.yaml", mode="scale")
    assert run("diff", tmp_path / "p.yaml", b, "-o", tmp_path / "d").code == 0
    assert (mapmeld.load(tmp_path / "d" / "updated.yaml").cells == 10).sum() == 100
