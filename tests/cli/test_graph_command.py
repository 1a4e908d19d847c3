import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from listing import contents
from running import T_A_B, run, write_maps

from mapmeld.se2 import Pose2


def pose(fields: dict[str, float]) -> Pose2:
    return Pose2(fields["x"], fields["y"], fields["theta"])


def test_maps_of_one_place_and_another_map(tmp_path: Path) -> None:
    maps = write_maps(tmp_path, "a", "b", "mirrored", "c")
    outcome = run("graph", *maps, "-o", tmp_path / "g.json")
    assert outcome.code == 1
    assert "Component 1: transforms into the frame of a.yaml" in outcome.out
    assert "Component 2: mirrored.yaml alone" in outcome.out
    assert "Of 6 pairs: 3 used." in outcome.out
    assert outcome.err == ""
    written = json.loads((tmp_path / "g.json").read_text())
    assert written["schema"] == "mapmeld.graph/1"
    assert written["components"] == [[0, 1, 3], [2]]
    assert pose(written["maps"][1]["T_c_i"]).distance_to(T_A_B)[0] < 0.1
    assert [p["state"] for p in written["pairs"]] == ["used", "unused", "used", "unused", "used", "unused"]


def test_all_maps_joined_is_exit_code_0_and_json_is_the_same_object(tmp_path: Path) -> None:
    maps = write_maps(tmp_path, "a", "b", "c")
    outcome = run("graph", *maps, "--json", "-o", tmp_path / "g.json")
    assert outcome.code == 0
    assert json.loads(outcome.out) == json.loads((tmp_path / "g.json").read_text())


def test_g2o_is_read_by_gtsam(tmp_path: Path) -> None:
    gtsam = pytest.importorskip("gtsam")
    maps = write_maps(tmp_path, "a", "b", "c")
    assert run("graph", *maps, "-o", tmp_path / "g.g2o").code == 0
    factors, values = gtsam.readG2o(str(tmp_path / "g.g2o"), False)
    assert (factors.size(), values.size()) == (3, 3)
    found = values.atPose2(1)
    assert Pose2(found.x(), found.y(), found.theta()).distance_to(T_A_B)[0] < 0.1


def test_nothing_is_written_over_unasked(tmp_path: Path) -> None:
    maps = write_maps(tmp_path, "a", "b")
    out = tmp_path / "g.g2o"
    out.write_text("mine")
    outcome = run("graph", *maps, "-o", out)
    assert outcome.code == 2
    assert "g.g2o: exists already" in outcome.line
    assert out.read_text() == "mine"
    assert run("graph", *maps, "-o", out, "--force").code == 0
    assert out.read_text() != "mine"


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["a.yaml"], "two maps or more are needed"),
        (["a.yaml", "b.yaml", "-o", "g.txt"], ".json or a .g2o file"),
        (["a.yaml", "b.yaml", "-o", "nowhere/g.json"], "nowhere does not exist"),
        (["a.yaml", "b.yaml", "--no-match"], "needs --known-poses"),
        (["a.yaml", "b.yaml", "--known-poses", "nothing.yaml"], "nothing.yaml"),
        (["a.yaml", "b.yaml", "--solver", "magic"], "magic"),
        (["a.yaml", "b.yaml", "--workers", "0"], "--workers"),
        (["a.yaml", "b.yaml", "--method", "magic"], "unknown method"),
        (["a.yaml", "none.yaml"], "none.yaml"),
    ],
)
def test_bad_usage_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], complaint: str
) -> None:
    write_maps(tmp_path, "a", "b")
    monkeypatch.chdir(tmp_path)
    before = contents(tmp_path)
    outcome = run("graph", *arguments)
    assert outcome.code == 2
    assert complaint in outcome.line
    assert contents(tmp_path) == before


# ------------------------------------------------------------------ known poses
def test_known_poses_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    maps = write_maps(tmp_path, "a", "mirrored")
    monkeypatch.setattr("mapmeld.merging.graph.all_pairs.match", lambda *_: pytest.fail("matched"))
    poses = tmp_path / "poses.yaml"
    poses.write_text("a.yaml: {x: 1, y: 2, theta_deg: 90}\nmirrored.yaml: {x: 1, y: 5, theta_deg: 180}\n")
    outcome = run("graph", *maps, "--known-poses", poses, "--no-match", "--json")
    assert outcome.code == 0
    printed = json.loads(outcome.out)
    assert printed["pairs"] == []
    assert [m["known"] for m in printed["maps"]] == [True, True]
    assert printed["maps"][1]["T_w_i"] == pytest.approx({"x": 1, "y": 5, "theta": 3.14159265})
    assert pose(printed["maps"][1]["T_c_i"]).x == pytest.approx(3)  # along map 1's x axis, which points up
    poses.write_text(poses.read_text() + "matching: off\n")
    merged = run("merge", *maps, "--known-poses", poses, "-o", tmp_path / "m.yaml")
    assert merged.code == 0
    assert "joined" in merged.out


def test_a_known_pose_that_a_match_contradicts(tmp_path: Path) -> None:
    maps = write_maps(tmp_path, "a", "b")
    poses = tmp_path / "poses.yaml"
    poses.write_text("a.yaml: {x: 0, y: 0, theta_deg: 0}\nb.yaml: {x: 9, y: 9, theta_deg: 0}\n")
    outcome = run("graph", *maps, "--known-poses", poses)
    assert "false: a.yaml - b.yaml: contradicted by the known poses" in outcome.out
    assert outcome.code == 0
    assert "note: an accepted match does not agree with the known poses (a.yaml - b.yaml: " in outcome.line
    assert outcome.line.endswith("deg off); they are used as given")
    merged = run("merge", *maps, "--known-poses", poses, "-o", tmp_path / "m.yaml")
    assert merged.code == 0
    assert merged.line == outcome.line
    unmatched = run("merge", *maps, "--known-poses", poses, "--no-match", "-o", tmp_path / "n.yaml")
    assert (unmatched.code, unmatched.err) == (0, "")


def test_a_known_pose_that_the_walls_do_not_support(tmp_path: Path) -> None:
    maps = write_maps(tmp_path, "a", "mirrored")
    poses = tmp_path / "poses.yaml"
    there = "a.yaml: {x: 0, y: 0, theta_deg: 0}\nmirrored.yaml: {x: 0, y: 0, theta_deg: 0"
    poses.write_text(there + "}\n")
    outcome = run("graph", *maps, "--known-poses", poses)
    assert outcome.code == 0
    assert "the walls of a.yaml and mirrored.yaml do not support their known poses (prob" in outcome.line
    poses.write_text(there + ", sigma_m: 1, sigma_deg: 5}\n")  # nor need they
    assert run("graph", *maps, "--known-poses", poses).err == ""


def test_a_known_pose_that_is_right_needs_no_note(tmp_path: Path) -> None:
    maps = write_maps(tmp_path, "a", "b")
    poses = tmp_path / "poses.yaml"
    b = f"{{x: {T_A_B.x}, y: {T_A_B.y}, theta_rad: {T_A_B.theta}}}"
    poses.write_text(f"a.yaml: {{x: 0, y: 0, theta_deg: 0}}\nb.yaml: {b}\n")
    outcome = run("graph", *maps, "--known-poses", poses)
    assert (outcome.code, outcome.err) == (0, "")


# ------------------------------------------------------------------ merge
def test_both_strategies_of_merge(tmp_path: Path) -> None:
    maps = write_maps(tmp_path, "a", "b", "c")
    for strategy in ("graph", "sequential"):
        outcome = run("merge", *maps, "-o", tmp_path / f"{strategy}.yaml", "--strategy", strategy, "--json")
        assert outcome.code == 0
        printed = json.loads(outcome.out)
        assert pose(printed["maps"][1]["T_1_i"]).distance_to(T_A_B)[0] < 0.1
        assert bool(printed["pairs"]) == (strategy == "graph")
        assert (printed["maps"][1]["covariance"] is None) == (strategy == "sequential")


def test_sequential_knows_no_known_poses(tmp_path: Path) -> None:
    maps = write_maps(tmp_path, "a", "b")
    poses = tmp_path / "poses.yaml"
    poses.write_text("a.yaml: {x: 0, y: 0, theta_deg: 0}\n")
    options = ("--strategy", "sequential", "--known-poses", poses)
    outcome = run("merge", *maps, "-o", tmp_path / "m.yaml", *options)
    assert outcome.code == 2
    assert "strategy 'graph'" in outcome.line


# ------------------------------------------------------------------ the store, and Ctrl-C
def test_a_second_run_goes_on_from_the_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    maps = write_maps(tmp_path, "a", "b", "c")
    assert run("graph", *maps, "--store", tmp_path / "pairs", "--workers", 2).code == 0
    monkeypatch.setattr("mapmeld.merging.graph.all_pairs.match", lambda *_: pytest.fail("matched"))
    assert run("graph", *maps, "--store", tmp_path / "pairs").code == 0
    assert run("merge", *maps, "--store", tmp_path / "pairs", "-o", tmp_path / "m.yaml").code == 0


@pytest.mark.skipif(sys.platform == "win32", reason="sends a signal")
@pytest.mark.parametrize("workers", [1, 2])
def test_an_interrupted_run_says_so_and_keeps_what_was_done(tmp_path: Path, workers: int) -> None:
    maps = write_maps(tmp_path, "a", "b", "c") * 12  # many pairs
    script = (
        "import mapmeld.merging.graph.all_pairs as a; a.BATCH_SECONDS = 0.0\n"
        "from mapmeld.cli import main\n"
        "if __name__ == '__main__':\n    main()\n"
    )
    (tmp_path / "run.py").write_text(script)
    store = tmp_path / "pairs"
    arguments = ["graph", *map(str, maps), "--store", str(store), "--workers", str(workers)]
    process = subprocess.Popen(
        [sys.executable, str(tmp_path / "run.py"), *arguments, "-o", str(tmp_path / "g.json")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ},
        start_new_session=True,
    )
    patience = time.monotonic() + 60
    while not list(store.glob("rows-*.parquet")):
        assert time.monotonic() < patience
        assert process.poll() is None
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert err.count("\n") == 1
    assert "interrupted" in err
    assert not (tmp_path / "g.json").exists()
    from mapmeld.merging.graph.all_pairs import PAIR_STORE

    assert PAIR_STORE.read(store)
