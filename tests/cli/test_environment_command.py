from pathlib import Path

import mujoco
import numpy as np
import pytest
from listing import contents
from running import run

import mapmeld
from mapmeld.cli.environment import FILES
from mapmeld.simulation import Configuration, read_configuration, read_map_text

SMALL = ("--size", "12x10", "--seed", 3)
MAP = "8:1:1:1:1:7\n0:-2:-2:-2:-2:0\n0:-2:-2:-2:-2:0\n9:1:1:1:1:6\n"


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "config.txt"
    path.write_text("2\n4:4\n5:4\n")
    return path


def test_what_is_written(tmp_path: Path, config: Path) -> None:
    out = tmp_path / "out"
    outcome = run("environment", "-o", out, *SMALL, "--config", config, "--resolution", 0.1)
    assert outcome.code == 0
    assert contents(out) == set(FILES)
    assert outcome.out.startswith("12 x 10 m, ")
    assert read_configuration(out / "config.txt") == Configuration(2, ((4, 4), (5, 4)))
    assert read_map_text(out / "map.txt").shape == (10, 12)
    grid = mapmeld.load(out / "map.yaml")
    assert (grid.shape, grid.resolution) == ((100, 120), 0.1)
    assert mujoco.MjModel.from_xml_path(str(out / "environment.xml")).ngeom > 4
    assert (out / "plan.png").read_bytes().startswith(b"\x89PNG")


def test_a_map_text_and_its_seed_give_the_same_again(tmp_path: Path, config: Path) -> None:
    run("environment", "-o", tmp_path / "a", *SMALL, "--config", config)
    outcome = run("environment", tmp_path / "a" / "map.txt", "-o", tmp_path / "b", "--seed", 3)
    assert outcome.code == 0
    assert contents(tmp_path / "b") == set(FILES) - {"config.txt"}
    for name in ("map.txt", "map.pgm", "environment.xml"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_options_reach_the_environment(tmp_path: Path) -> None:
    source = tmp_path / "map.txt"
    source.write_text(MAP)
    for name, options in (("thin", ()), ("thick", ("--wall", 0.3))):
        assert run("environment", source, "-o", tmp_path / name, "--furniture", 0, *options).code == 0
    thin, thick = (mapmeld.load(tmp_path / name / "map.yaml") for name in ("thin", "thick"))
    assert np.count_nonzero(thick.occupied) > 2 * np.count_nonzero(thin.occupied)


def test_nothing_is_overwritten_unasked(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "notes").write_text("mine")
    refused = run("environment", "-o", out, *SMALL, "--furniture", 0)
    assert refused.code == 2
    assert "--force" in refused.line
    assert contents(out) == {"notes"}
    assert run("environment", "-o", out, *SMALL, "--furniture", 0, "--force").code == 0
    assert contents(out) == {"notes", *FILES}


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--size", "12"], "12"),
        (["--size", "3x3"], "3 x 3"),
        (["--size", "9999x20"], "9999"),
        (["--config", "nowhere.txt"], "no such file"),
        (["--resolution", "0"], "cells of"),
        (["--wall", "9"], "thick"),
        (["--door", "nan"], "doors"),
        (["--furniture", "nan"], "--furniture"),
        (["--seed", "-1"], "--seed"),
        (["nowhere.txt"], "no such file"),
        (["map.txt", "--size", "12x12"], "--size"),
        (["map.txt", "--config", "c.txt"], "--config"),
        (["map.txt", "--extra-doors", "0.5"], "--extra-doors"),
        (["bad.txt"], "line 2, field 2"),
    ],
)
def test_bad_input_is_one_line(
    options: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("map.txt").write_text(MAP)
    Path("bad.txt").write_text(MAP.replace("-2", "x"))
    outcome = run("environment", "-o", "out", *options)
    assert outcome.code == 2
    assert said in outcome.line
    assert not Path("out").exists()


def test_large_requests_do_not_fit_on_small_grounds(tmp_path: Path) -> None:
    config = tmp_path / "config.txt"
    config.write_text("300\n8:8\n")
    outcome = run("environment", "-o", tmp_path / "out", "--size", "10x10", "--config", config)
    assert outcome.code == 2
    assert "do not fit" in outcome.line
