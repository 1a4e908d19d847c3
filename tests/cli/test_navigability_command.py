import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from drawing import around, built
from listing import contents
from running import T_A_B, run, write_maps

from mapmeld.io import save
from mapmeld.report.palette import GREEN, ORANGE, RED


def with_a_wall(folder: Path, name: str, *wall: tuple[float, float, float, float]) -> Path:
    path = folder / f"{name}.yaml"
    save(built(8, 4, [*around(8, 4), *wall]), path)
    return path


def test_a_map_alone(tmp_path: Path) -> None:
    (a,) = write_maps(tmp_path, "a")
    outcome = run("navigability", a, "--pairs", 20, "--picture", tmp_path / "p.png")
    assert outcome.code == 0
    assert "20 of 20 pairs" in outcome.out
    assert "false" not in outcome.out
    assert (tmp_path / "p.png").is_file()


def test_compared_with_the_truth(tmp_path: Path) -> None:
    truth = with_a_wall(tmp_path, "truth", (4, 0, 4.1, 4))
    open_map = with_a_wall(tmp_path, "map")
    picture = tmp_path / "p.png"
    found = json.loads(
        run("navigability", open_map, "--truth", truth, "--pairs", 40, "--json", "--picture", picture).out
    )
    assert found["T_truth_map"] == {"x": 0, "y": 0, "theta": 0}
    compared = found["compared"]
    assert compared["reachable_map"] == compared["pairs"] == len(compared["ways"]) == 40
    assert compared["false_passages"] == 40 - compared["reachable_truth"] > 5
    assert compared["length_ratio"]["least"] == 1
    pixels = cv2.imread(str(picture))
    assert pixels is not None
    for colour in (GREEN, RED, ORANGE):
        assert (pixels == np.array(colour)).all(axis=2).sum() > 100
    # The other way round, the map has the wall.
    back = run("navigability", truth, "--truth", open_map, "--pairs", 40)
    assert back.code == 0
    assert "false passages   0\n" in back.out
    assert "false blocks     0\n" not in back.out


def test_the_pose_is_given_or_found(tmp_path: Path) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    given = f"{T_A_B.x},{T_A_B.y},{np.degrees(T_A_B.theta)}"
    for option in (("--pose", given), ("--align",)):
        found = json.loads(run("navigability", b, "--truth", a, *option, "--pairs", 10, "--json").out)
        assert found["T_truth_map"] == pytest.approx(
            {"x": T_A_B.x, "y": T_A_B.y, "theta": T_A_B.theta}, abs=0.02
        )
        assert found["compared"]["reachable_both"] == 10
        assert (found["match"] is None) == (option[0] == "--pose")


def test_starts(tmp_path: Path) -> None:
    walled = with_a_wall(tmp_path, "map", (4, 0, 4.1, 4))
    one = run("navigability", walled, "--start", "1,1", "--pairs", 30)
    assert "30 of 30 pairs" in one.out
    both = json.loads(run("navigability", walled, "--start", "1,1", "--start", "6,1", "--json").out)
    assert both["settings"]["starts"] == [[1, 1], [6, 1]]
    assert 0 < both["reach"]["reachable"] < both["reach"]["pairs"] == 200


def test_no_floor_for_the_robot(tmp_path: Path) -> None:
    (a,) = write_maps(tmp_path, "a")
    outcome = run("navigability", a, "--truth", a, "--radius", 20)
    assert outcome.code == 0
    assert "0 of 0 pairs" in outcome.out
    assert "length ratio" not in outcome.out


def test_no_match(tmp_path: Path) -> None:
    a, empty = write_maps(tmp_path, "a", "empty")
    before = contents(tmp_path)
    outcome = run("navigability", empty, "--truth", a, "--align", "--picture", tmp_path / "p.png")
    assert outcome.code == 1
    assert "nothing compared" in outcome.line
    assert contents(tmp_path) == before


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--align"], "needs a true map"),
        (["--pose", "1,2,3"], "needs a true map"),
        (["--truth", "a.yaml", "--pose", "1,2"], "three numbers x,y,degrees are needed"),
        (["--truth", "a.yaml", "--pose", "1,2,3", "--align"], "give one of them"),
        (["--start", "1"], "two numbers x,y"),
        (["--start", "1,b"], "two numbers x,y"),
        (["--start", "1000,0"], "within a metre of the start"),
        (["--truth", "a.yaml", "--pose", "1e8,0,0"], "check how they lie"),
        (["--picture", "p.jpg"], "ends in .png"),
        (["--truth", "none.yaml"], "none.yaml"),
    ],
)
def test_bad_input(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: list[str], said: str) -> None:
    write_maps(tmp_path, "a")
    monkeypatch.chdir(tmp_path)
    outcome = run("navigability", "a.yaml", *options)
    assert outcome.code == 2
    assert said in outcome.line
