import json
import math
from pathlib import Path

import numpy as np
import pytest
from listing import contents
from running import T_A_B, run, write_maps

import mapmeld
from mapmeld.se2 import Pose2


def test_only_the_origin_changes(tmp_path: Path) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    outcome = run("rebase", b, "--onto", a, "-o", tmp_path / "r.yaml")
    assert outcome.code == 0
    assert outcome.out.startswith("T_old_new: x ")
    assert f"  {tmp_path / 'r.pgm'}\n" in outcome.out
    before, after = mapmeld.load(b), mapmeld.load(tmp_path / "r.yaml")
    np.testing.assert_array_equal(after.cells, before.cells)
    assert after.resolution == before.resolution
    metres, radians = (after.origin @ before.origin.inverse()).distance_to(T_A_B)
    assert metres < 0.1
    assert radians < 0.01
    # What nav2 makes of that.
    assert "yaw of -40.0" in outcome.line
    assert "--lattice" in outcome.line


def test_on_the_lattice(tmp_path: Path) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    outcome = run("rebase", b, "--onto", a, "-o", tmp_path / "r.yaml", "--lattice")
    assert (outcome.code, outcome.err) == (0, "")
    old, new = mapmeld.load(a), mapmeld.load(tmp_path / "r.yaml")
    assert (new.resolution, new.origin.theta) == (old.resolution, 0)
    col, row = np.rint(old.metres_to_lattice((new.origin.x, new.origin.y))).astype(int)
    rows, cols = old.shape
    same = new.cells[-row : rows - row, -col : cols - col]
    # Walls are one or two cells thick and were sampled twice.
    assert (same == old.cells).mean() > 0.98


def test_percentages_are_kept(tmp_path: Path) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    grid = mapmeld.load(b)
    cells = grid.cells.copy()
    cells[cells == 0] = 10
    mapmeld.save(mapmeld.OccupancyGrid(cells, grid.resolution, grid.origin), tmp_path / "p.yaml", mode="raw")
    outcome = run("rebase", tmp_path / "p.yaml", "--onto", a, "-o", tmp_path / "r.yaml")
    assert outcome.code == 0
    assert f"  {tmp_path / 'r.png'}\n" in outcome.out
    np.testing.assert_array_equal(mapmeld.load(tmp_path / "r.yaml").cells, cells)


def test_json_of_a_rebase(tmp_path: Path) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    outcome = run("rebase", b, "--onto", a, "-o", tmp_path / "r.yaml", "--transform", "1,2,0", "--json")
    assert outcome.code == 0
    assert "note: the walls of a.yaml and b.yaml do not support --transform 1,2,0" in outcome.line
    printed = json.loads(outcome.out)
    assert printed["T_old_new"] == {"x": 1, "y": 2, "theta": 0}
    assert printed["match"] is None
    origin = mapmeld.load(b).origin
    assert Pose2(**printed["origin"]) == Pose2(origin.x + 1, origin.y + 2, 0)
    assert printed["maps"] == {"old": str(a), "new": str(b)}


def test_a_yaw_that_the_earlier_map_has_cannot_be_helped(tmp_path: Path) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    mapmeld.save(mapmeld.load(a).moved(Pose2(0, 0, 0.5)), tmp_path / "turned.yaml")
    outcome = run("rebase", b, "--onto", tmp_path / "turned.yaml", "-o", tmp_path / "r.yaml", "--lattice")
    assert outcome.code == 0
    assert f"yaw of {math.degrees(0.5):.2f} degrees" in outcome.line
    assert "--lattice" not in outcome.line


def test_no_match_nothing_written(tmp_path: Path) -> None:
    a, empty = write_maps(tmp_path, "a", "empty")
    before = contents(tmp_path)
    outcome = run("rebase", empty, "--onto", a, "-o", tmp_path / "r.yaml")
    assert outcome.code == 1
    assert "nothing to match on" in outcome.line
    assert contents(tmp_path) == before


@pytest.mark.parametrize("out", ["r.pgm", "r", "nowhere/r.yaml"])
def test_a_name_that_cannot_be(tmp_path: Path, out: str) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    before = contents(tmp_path)
    assert run("rebase", b, "--onto", a, "-o", tmp_path / out).code == 2
    assert contents(tmp_path) == before


def test_nothing_is_replaced_unasked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    with monkeypatch.context() as patch:
        patch.setattr("mapmeld.matching.match", lambda *_, **__: pytest.fail("matched before it looked"))
        outcome = run("rebase", b, "--onto", a, "-o", b)
    assert outcome.code == 2
    assert "exists already" in outcome.line
    cells = mapmeld.load(b).cells
    assert run("rebase", b, "--onto", a, "-o", b, "--force").code == 0
    np.testing.assert_array_equal(mapmeld.load(b).cells, cells)
