import json
import math
import os
import re
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from running import T_A_B, run, run_for_real, write_maps

from mapmeld.matching import METHODS, Alternative, MatchResult, Verdict
from mapmeld.se2 import Pose2
from mapmeld.wording import probability_text


def test_an_accepted_match(tmp_path: Path) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    outcome = run("match", a, b)
    assert outcome.code == 0
    assert outcome.err == ""
    rows = dict(line.split(maxsplit=1) for line in outcome.out.splitlines())
    assert rows["verdict"] == "accepted"
    assert 0.98 < float(rows["probability"].removeprefix("> ")) <= 1
    assert "wall in the overlap" in rows["reason"]
    deviations = r"dev +x 0\.0\d\d m, y 0\.0\d\d m, theta 0\.\d\d deg"
    assert re.fullmatch(rf"{deviations} \(of the best rigid fit; drift .*\)", rows["std"])
    x, y, theta = (float(rows["T_a_b"].split()[i]) for i in (1, 4, 7))
    assert math.hypot(x - T_A_B.x, y - T_A_B.y) < 0.2
    assert theta == pytest.approx(math.degrees(T_A_B.theta), abs=1)


def test_a_method_without_calibration(tmp_path: Path) -> None:
    outcome = run("match", *write_maps(tmp_path, "a", "b"), "--method", "alphabet")
    assert outcome.code == 0
    rows = dict(line.split(maxsplit=1) for line in outcome.out.splitlines())
    assert rows["probability"] == "-"
    assert "Jaccard similarity" in rows["reason"]
    assert "std" not in rows


def test_nothing_to_match_on_is_an_answer_not_an_error(tmp_path: Path) -> None:
    a, empty = write_maps(tmp_path, "a", "empty")
    outcome = run("match", a, empty)
    assert outcome.code == 1
    assert "rejected" in outcome.out
    assert "nothing to match on" in outcome.out
    parsed = json.loads(run("match", a, empty, "--json").out)
    assert parsed["T_a_b"] is None
    assert parsed["alternatives"] == []


def test_json_is_all_of_stdout(tmp_path: Path) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    outcome = run_for_real("match", a.name, b.name, "--json", "--set", "hypotheses=10", cwd=tmp_path)
    assert outcome.code == 0
    assert outcome.err == ""
    parsed = json.loads(outcome.out)
    assert parsed["schema"] == "mapmeld.match/1"
    assert parsed["maps"] == {"a": "a.yaml", "b": "b.yaml"}
    assert parsed["verdict"] == "accepted"
    assert parsed["parameters"]["hypotheses"] == 10
    found = Pose2(**parsed["T_a_b"])
    assert found.distance_to(T_A_B)[0] < 0.2
    assert found.distance_to(T_A_B)[1] < math.radians(1)


def test_covariance_and_probability_are_passed_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    answer = MatchResult(
        Pose2(1, 2, 3),
        Verdict.AMBIGUOUS,
        "two ways",
        0.5,
        0.4,
        0.3,
        np.diag([1.0, 4.0, math.radians(3) ** 2]),
        (Alternative(Pose2(4, 5, 0), 0.3, 0.41),),
    )
    monkeypatch.setattr("mapmeld.matching.match", lambda *_: answer)
    outcome = run("match", a, b, "--json")
    assert outcome.code == 1
    parsed = json.loads(outcome.out)
    assert parsed["probability"] == 0.5
    assert parsed["covariance"] == [[1, 0, 0], [0, 4, 0], [0, 0, math.radians(3) ** 2]]
    table = re.sub(" +", " ", run("match", a, b).out)
    assert "\nstd dev x 1.000 m, y 2.000 m, theta 3.00 deg (of the best rigid fit; " in table
    assert "\nprobability 0.500\n" in table
    assert "\nor x 4.000 m, y 5.000 m, theta 0.00 deg; probability 0.410\n" in table


@pytest.mark.parametrize(
    ("probability", "text"),
    [(None, "-"), (0.0, "0.000"), (1e-9, "< 0.001"), (0.0005, "0.001"), (0.998, "0.998"),
     (0.9994, "0.999"), (0.99951, "> 0.999"), (1.0, "1.000")],
)  # fmt: skip
def test_probabilities_do_not_look_like_certainty(probability: float | None, text: str) -> None:
    assert probability_text(probability) == text


@pytest.mark.parametrize("text", ["resolution: nan", "- 1", "!!python/object:os.system {}", "\0", ""])
def test_a_bad_map_is_one_line_that_names_it(tmp_path: Path, text: str) -> None:
    (a,) = write_maps(tmp_path, "a")
    bad = tmp_path / "bad.yaml"
    bad.write_text(text)
    for flags in ([], ["--json"]):
        outcome = run("match", a, bad, *flags)
        assert outcome.code == 2
        assert outcome.out == ""
        assert "bad.yaml" in outcome.line


def test_a_missing_map_in_a_real_run(tmp_path: Path) -> None:
    (a,) = write_maps(tmp_path, "a")
    outcome = run_for_real("match", a, "nowhere.yaml", cwd=tmp_path)
    assert outcome.code == 2
    assert outcome.out == ""
    assert "nowhere.yaml" in outcome.line


def test_an_unknown_method(tmp_path: Path) -> None:
    outcome = run("match", *write_maps(tmp_path, "a", "b"), "--method", "magic")
    assert outcome.code == 2
    assert all(name in outcome.line for name in METHODS)


def test_bare_images_need_a_resolution(tmp_path: Path) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    image = b.with_suffix(".pgm")
    assert run("match", a, image).code == 2
    # The YAML file keeps its own resolution; only the image gets the one that is given.
    assert run("match", a, image, "--resolution", 0.05).code == 0
    outcome = run("match", a, b, "--resolution", 0.05)
    assert outcome.code == 2
    assert "bare images" in outcome.line
    assert run("match", a, image, "--resolution", "nan").code == 2


def test_resolutions_that_cannot_both_be_right_are_one_line(tmp_path: Path) -> None:
    a, b = write_maps(tmp_path, "a", "b")
    b.write_text(b.read_text().replace("resolution: 0.05", "resolution: 50"))
    for command in (["match", a, b], ["match", b, a, "--json"], ["merge", a, b, "-o", tmp_path / "m.yaml"]):
        outcome = run(*command)
        assert outcome.code == 2
        assert outcome.out == ""
        assert "check the resolutions" in outcome.line
        assert str(a) in outcome.line
        assert str(b) in outcome.line
    assert not (tmp_path / "m.yaml").exists()


def test_settings_reach_the_method(tmp_path: Path) -> None:
    maps = write_maps(tmp_path, "a", "b")
    strict = tmp_path / "strict.yaml"
    strict.write_text("accept_similarity: 0.99\n")
    command = ["match", *maps, "--method", "alphabet", "--params", strict]
    assert run(*command).code == 1
    # What is set on the command line wins over the file.
    assert run(*command, "--set", "accept_similarity=0.1").code == 0
    sure = "accept_probability=0.9999999999999"
    assert run("match", *maps, "--set", sure).code == 1


@pytest.mark.skipif(sys.platform != "linux", reason="file names of any bytes are a matter of Linux")
def test_names_that_are_no_text_can_be_printed(tmp_path: Path) -> None:
    folder = os.fsencode(tmp_path) + b"/caf\xe9 [red]"
    os.mkdir(folder)  # noqa: PTH102
    a, b = write_maps(Path(os.fsdecode(folder)), "a", "b")
    outcome = run_for_real("match", a, b, cwd=tmp_path)
    assert outcome.code == 0, outcome.err
    assert "[red]" in outcome.out
    assert json.loads(run_for_real("match", a, b, "--json", cwd=tmp_path).out)["verdict"] == "accepted"


@pytest.mark.skipif(sys.platform == "win32", reason="such file names are not to be had on Windows")
def test_a_name_with_a_line_end_does_not_break_the_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # a short path: a long one would be broken to fit the terminal
    folder = Path("two\nlines \x1b[31m")
    folder.mkdir()
    a, b = write_maps(folder, "a", "b")
    outcome = run("match", a, b)
    assert "two\\nlines \\x1b[31m" in outcome.out
    assert "\x1b" not in outcome.out
    names = [line.split()[0] for line in outcome.out.splitlines()]
    assert names[:3] == ["a", "b", "T_a_b"]
    assert run("show", a, "-o", tmp_path / "p\nq.png").out == f"Written: {tmp_path}/p\\nq.png\n"


def test_a_folder_is_no_map(tmp_path: Path) -> None:
    (a,) = write_maps(tmp_path, "a")
    outcome = run("match", a, tmp_path)
    assert outcome.code == 2
    assert "is a folder" in outcome.line


def test_opencv_speaks_no_word(tmp_path: Path) -> None:
    (a,) = write_maps(tmp_path, "a")
    torn = tmp_path / "torn.png"
    encoded = cv2.imencode(".png", np.zeros((50, 50), np.uint8))[1].tobytes()
    torn.write_bytes(encoded[: len(encoded) // 2])
    outcome = run_for_real("match", a, torn, "--resolution", "0.05", cwd=tmp_path)
    assert outcome.code == 2
    assert "torn.png" in outcome.line


def test_a_map_whose_unknown_space_reads_as_free_is_noted(tmp_path: Path) -> None:
    a = Path(write_maps(tmp_path, "a")[0])
    quiet = run("match", a, a)
    text = a.read_text()
    assert "free_thresh: 0.196" in text
    old = tmp_path / "old.yaml"
    old.write_text(text.replace("free_thresh: 0.196", "free_thresh: 0.25"))
    outcome = run("match", old, a)
    assert outcome.err.count("note:") == 1
    assert f"{old} has nothing unknown, and free_thresh 0.25" in outcome.err
    assert "0.196" in outcome.err
    assert "note:" not in quiet.err
