import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.merging.graph import KnownPose, KnownPosesError, read_known_poses
from mapmeld.se2 import Pose2

MAPS = ["maps/one.yaml", "maps/two.yaml", "other/two.yaml"]


def read(folder: Path, text: str) -> tuple[dict[int, KnownPose], bool]:
    file = folder / "poses.yaml"
    file.write_text(text)
    return read_known_poses(file, MAPS)


def test_degrees_and_radians_say_so(tmp_path: Path) -> None:
    known, matching = read(
        tmp_path,
        "one.yaml: {x: 1.5, y: -2, theta_deg: 90}\n"
        "maps/two.yaml: {x: 0, y: 0, yaw_rad: 0.25, sigma_m: 0.5, sigma_deg: 180}\n"
        "other/two.yaml: {x: 1e1, y: 0, theta_rad: -1, sigma_m: 0.1, sigma_rad: 0.2}\n",
    )
    assert matching
    assert known == {
        0: KnownPose(Pose2(1.5, -2, math.pi / 2)),
        1: KnownPose(Pose2(0, 0, 0.25), 0.5, math.pi),
        2: KnownPose(Pose2(10, 0, -1), 0.1, 0.2),
    }


@pytest.mark.parametrize(("word", "matching"), [("off", False), ("no", False), ("on", True), ("true", True)])
def test_matching_can_be_switched_off(tmp_path: Path, word: str, matching: bool) -> None:
    assert read(tmp_path, f"one.yaml: {{x: 0, y: 0, theta_deg: 0}}\nmatching: {word}\n")[1] is matching


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("one.yaml: {x: 0, y: 0}", "exactly one of theta_deg, theta_rad, yaw_deg, yaw_rad"),
        ("one.yaml: {x: 0, y: 0, theta_deg: 0, yaw_rad: 0}", "exactly one of"),
        ("one.yaml: {x: 0, y: 0, theta: 0}", "no key 'theta'"),
        ("one.yaml: {y: 0, theta_deg: 0}", "x is missing"),
        ("one.yaml: {x: a, y: 0, theta_deg: 0}", "x must be a number"),
        ("one.yaml: {x: 0, y: 0, theta_rad: 90}", "90 rad is more than 2 turns: degrees"),
        ("one.yaml: {x: .inf, y: 0, theta_deg: 0}", "x must be a number"),
        ("one.yaml: {x: 1e300, y: 0, theta_deg: 0}", "x must be a number"),
        ("one.yaml: {x: [1], y: 0, theta_deg: 0}", "nests more than 2"),
        ("one.yaml: {x: 0, x: 1, y: 0, theta_deg: 0}", "'x' twice"),
        ("one.yaml: {[1]: 0}", "nests more than 2"),
        ("one.yaml: {x: 0, y: 0, theta_deg: 0, sigma_m: 1}", "exactly one of sigma_deg, sigma_rad"),
        ("one.yaml: {x: 0, y: 0, theta_deg: 0, sigma_deg: 1}", "sigma_m is missing"),
        ("one.yaml: {x: 0, y: 0, theta_deg: 0, sigma_m: -1, sigma_deg: 1}", "cannot be negative"),
        ("one.yaml: [0, 0, 0]", "a pose is needed, as {x: 1.5, y: 0, theta_deg: 90}"),
        ("one.yaml: 3", "a pose is needed"),
        ("two.yaml: {x: 0, y: 0, theta_deg: 0}", "fits several maps"),
        ("three.yaml: {x: 0, y: 0, theta_deg: 0}", "names no map of this call"),
        ("'': {x: 0, y: 0, theta_deg: 0}", "names no map"),
        ("matching: off", "holds no pose"),
        ("matching: perhaps\none.yaml: {x: 0, y: 0, theta_deg: 0}", "matching must be on or off"),
        ("matching: {x: 1}", "matching must be on or off"),
        (
            "one.yaml: {x: 0, y: 0, theta_deg: 0}\nmaps/one.yaml: {x: 1, y: 0, theta_deg: 0}",
            "the pose of maps/one.yaml twice",
        ),
        ("", "is empty"),
        ("- 1", "is not a file of known poses"),
        ("one.yaml: &a {x: 0}\ntwo: *a", "anchor"),
        ("one.yaml: {x: {x: {x: 1}}}", "nests more than 2"),
    ],
)
def test_bad_files_are_one_line_with_what_is_wrong(tmp_path: Path, text: str, complaint: str) -> None:
    with pytest.raises(KnownPosesError) as refused:
        read(tmp_path, text)
    line = str(refused.value)
    assert complaint in line
    assert "poses.yaml" in line
    assert "\n" not in line


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(KnownPosesError, match=r"nowhere\.yaml"):
        read_known_poses(tmp_path / "nowhere.yaml", MAPS)


@given(st.text(max_size=60))
def test_any_text_is_read_or_refused(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    file = tmp_path_factory.mktemp("known") / "p.yaml"
    file.write_text(text, encoding="utf-8", newline="")
    with pytest.raises(KnownPosesError):
        read_known_poses(file, MAPS)


def test_sigma_is_a_covariance_and_exact_is_next_to_none() -> None:
    np.testing.assert_allclose(KnownPose(Pose2(), 0.5, 0.1).covariance(), np.diag([0.25, 0.25, 0.01]))
    assert 0 < KnownPose(Pose2()).covariance().max() <= 1e-12


@pytest.mark.parametrize("numbers", [(math.nan, 0, 0), (0, -1, 0), (0, 0, -1), (0, math.inf, 0)])
def test_impossible_known_poses(numbers: tuple[float, float, float]) -> None:
    x, metres, theta = numbers
    with pytest.raises(ValueError, match=r"known pose|negative"):
        KnownPose(Pose2(x), metres, theta)
