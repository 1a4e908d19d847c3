"""``mapmeld reproduce``."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import pytest
from running import run
from small_experiment import AS_OPTIONS

from mapmeld.experiment import Results
from mapmeld.experiment import run as experiment
from mapmeld.experiment.rows import MatchingRow


@pytest.fixture
def copy(small_experiment: tuple[Path, Results], tmp_path: Path) -> Path:
    return Path(shutil.copytree(small_experiment[0], tmp_path / "copy"))


def test_the_command_goes_on_with_an_experiment(copy: Path) -> None:
    done = run("reproduce", *AS_OPTIONS, "-o", copy, "--workers", 1)
    assert (done.code, done.err) == (0, "")
    assert re.search(r"the paper's matchings.*0\.927027.*79 of 100", done.out)
    assert re.search(r"our matchings, default method.* 3 of 3 ", done.out)
    assert str(copy / "report.html") in done.out.replace(str(copy.resolve()), str(copy))


def test_the_command_refuses_other_settings_in_one_line(copy: Path) -> None:
    done = run("reproduce", *AS_OPTIONS, "-o", copy, "--seed", 3)
    assert done.code == 2
    assert "holds an experiment of other settings (seed: 0, now 3)" in done.line
    assert done.line.endswith("or --force to begin it anew")
    done = run("reproduce", *AS_OPTIONS, "-o", copy, "--method", "feature_orb")
    assert "(methods: " in done.line


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--mappings", 1), "mappings must be in 2..9, not 1"),
        (("--method", "guess"), "no method 'guess' (there are: paper, default, "),
        (("--method", "paper", "--method", "alphabet"), "there twice: alphabet, alphabet"),
        (("--size", "10"), "whole metres are needed"),
        (("--size", "3x3"), "the ground needs sides of"),
    ],
)
def test_bad_options_are_said_before_any_work(options: tuple[object, ...], said: str, tmp_path: Path) -> None:
    done = run("reproduce", "-o", tmp_path / "x", *options)
    assert done.code == 2
    assert said in done.line
    assert not (tmp_path / "x").exists()


def test_an_interrupted_command_says_that_it_goes_on(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*job: Any) -> MatchingRow:
        raise KeyboardInterrupt

    monkeypatch.setattr(experiment, "match_histories", interrupted)
    (copy / "matchings" / "alphabet" / "01-1-3.json").unlink()
    done = run("reproduce", *AS_OPTIONS, "-o", copy, "--workers", 1)
    assert done.code == 130
    assert "the same command goes on from there" in done.line
    assert not (copy / "report.html").exists()
