"""The parameters: the node's names and defaults, and its files."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from mapmeld.slam import GMappingParameters, ParameterFileError, read_parameters


def test_defaults_are_those_of_the_node() -> None:
    p = GMappingParameters()
    assert (p.sigma, p.kernelSize, p.lstep, p.astep, p.iterations) == (0.05, 1, 0.05, 0.05, 5)
    assert (p.lsigma, p.ogain, p.lskip, p.minimumScore) == (0.075, 3.0, 0, 0.0)
    assert (p.srr, p.srt, p.str, p.stt) == (0.1, 0.2, 0.1, 0.2)
    assert (p.linearUpdate, p.angularUpdate, p.temporalUpdate) == (1.0, 0.5, -1.0)
    assert (p.resampleThreshold, p.particles, p.delta, p.occ_thresh) == (0.5, 30, 0.05, 0.25)
    assert (p.xmin, p.ymin, p.xmax, p.ymax) == (-100, -100, 100, 100)
    assert (p.llsamplerange, p.llsamplestep, p.lasamplerange, p.lasamplestep) == (0.01, 0.01, 0.005, 0.005)


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        ({"particles": 0}, "particles must be more than 0"),
        ({"delta": -0.05}, "delta must be more than 0"),
        ({"delta": math.inf}, "delta must be finite"),
        ({"sigma": math.nan}, "sigma must be a number"),
        ({"maxUrange": 0.0}, "maxUrange must be more than 0"),
        ({"maxUrange": math.inf}, "maxUrange must be finite"),
        ({"maxRange": math.inf}, "maxUrange has to be set"),
        ({"iterations": -1}, "iterations must not be negative"),
        ({"kernelSize": 16}, "kernelSize must be at most 15"),
        ({"xmin": 3.0, "xmax": 3.0}, "xmin must be less than xmax"),
        ({"occ_thresh": 1.0}, "occ_thresh must be less than 1"),
        ({"proposal": "guessed"}, "proposal must be"),
    ],
)
def test_what_makes_no_sense_is_refused(settings: dict[str, object], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        GMappingParameters(**settings)  # type: ignore[arg-type]


# ---------------------------------------------------------------- files
def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "gmapping.yaml"
    path.write_text(text, encoding="utf-8")
    return path


FLAT = "maxUrange: 6\nparticles: 80\nsigma: 5e-2\nbase_frame: base_footprint\nmap_update_interval: 2.0\n"


@pytest.mark.parametrize(
    "text",
    [
        FLAT,
        "slam_gmapping:\n" + "".join(f"  {line}\n" for line in FLAT.splitlines()),
        "/**:\n  ros__parameters:\n" + "".join(f"    {line}\n" for line in FLAT.splitlines()),
        "# a comment\n---\n" + FLAT,
    ],
    ids=["flat", "ros1 node", "ros2", "document start"],
)
def test_files_of_the_node_are_read(tmp_path: Path, text: str) -> None:
    found = read_parameters(written(tmp_path, text))
    assert found.settings == {"maxUrange": 6.0, "particles": 80, "sigma": 0.05}
    assert isinstance(found.settings["maxUrange"], float)
    assert found.passed_over == ("base_frame", "map_update_interval")
    assert found.parameters() == GMappingParameters(maxUrange=6.0, particles=80, sigma=0.05)


@pytest.mark.parametrize("text", ["# nothing yet\n", "slam_gmapping: {}\n"])
def test_an_empty_file_sets_nothing(tmp_path: Path, text: str) -> None:
    assert read_parameters(written(tmp_path, text)).settings == {}


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("particels: 30", "has no parameter 'particels'; did you mean particles"),
        ("particles: many", "particles must be a whole number, not 'many'"),
        ("particles: 3.5", "particles must be a whole number"),
        ("particles: true", "particles must be a whole number"),
        ("sigma: wide", "sigma must be a number, not 'wide'"),
        ("sigma: .nan", "sigma must be a number"),
        ("sigma: [1]", "sigma must be a number"),
        ("sigma: {a: 1}", "sigma must be a number"),
        ("sigma: null", "sigma must be a number"),
        ("slam_gmapping: 5", "has no parameter 'slam_gmapping'"),
        ("a: &x 1", "anchor"),
        ("a: !!python/object:os.system x", "tag"),
        ("{", "not valid YAML"),
        ("- 1", "no 'key: value' lines"),
        ("a:\n b:\n  c:\n   d:\n    e: 1\n", "levels deep"),
        ("a:\n  sigma: 1\nb:\n  sigma: 1\n", "has no parameter 'a'"),
    ],
)
def test_bad_files_are_refused_in_one_line(tmp_path: Path, text: str, problem: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(ParameterFileError, match=problem) as caught:
        read_parameters(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(ParameterFileError, match=r"none\.yaml: no such file"):
        read_parameters(tmp_path / "none.yaml")
