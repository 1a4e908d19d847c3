import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import pytest
import yaml
from running import run, run_for_real

import mapmeld
from mapmeld.changes.diff import MAX_BEND, MIN_AREA, TOLERANCE
from mapmeld.cli.options import DEFAULT_METHOD, Fusion, WriteMode
from mapmeld.io import Mode
from mapmeld.matching import DEFAULT_METHOD as THE_DEFAULT_METHOD
from mapmeld.matching.alphabet import AlphabetParameters
from mapmeld.matching.correlative import CorrelativeParameters
from mapmeld.merging import FUSIONS

COMMANDS = (
    "match",
    "merge",
    "graph",
    "follow",
    "diff",
    "rebase",
    "transform-points",
    "show",
    "explain",
    "demo",
    "benchmark",
    "environment",
    "simulate",
    "slam",
    "bag",
)


def test_help_names_every_command_and_the_exit_codes() -> None:
    outcome = run("--help")
    assert outcome.code == 0
    assert all(command in outcome.out for command in COMMANDS)
    assert "Exit codes" in outcome.out
    assert all(f"{code} " in outcome.out for code in (0, 1, 2, 70, 130, 141))


@pytest.mark.parametrize(
    "command", ["match", "merge", "follow", "diff", "rebase", "transform-points", "show"]
)
def test_help_names_the_default_method_and_the_way_to_its_settings(command: str) -> None:
    words = " ".join(run(command, "--help").out.replace("│", " ").split())
    assert f"[default: {DEFAULT_METHOD}]" in words
    assert "'--set help'" in words


@pytest.mark.parametrize(
    "command", ["match", "merge", "graph", "follow", "diff", "rebase", "transform-points", "show"]
)
def test_settings_are_listed_without_maps(command: str) -> None:
    listed = run(command, "--set", "help")
    assert (listed.code, listed.err) == (0, "")
    assert yaml.safe_load(listed.out) == asdict(CorrelativeParameters())
    for words in (
        ["--method", "alphabet", "--set=help"],
        ["a", "--set", "help", "--method=alphabet", "--force"],
    ):
        assert yaml.safe_load(run(command, *words).out) == asdict(AlphabetParameters())


def test_settings_of_the_one_method_that_is_explained() -> None:
    assert yaml.safe_load(run("explain", "--set", "help").out) == asdict(AlphabetParameters())


def test_settings_of_a_method_that_does_not_exist() -> None:
    refused = run("match", "--set", "help", "--method", "luck")
    assert refused.code == 2
    assert "unknown method 'luck'" in refused.line


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help(command: str) -> None:
    assert run(command, "--help").code == 0
    assert run(command, "-h").code == 0


@pytest.mark.parametrize(
    "arguments", [["--help"], ["--version"], ["merge", "--help"], ["bag", "export", "--help"]]
)
def test_help_imports_nothing_heavy(arguments: list[str]) -> None:
    script = (
        "import sys\n"
        f"sys.argv = ['mapmeld', *{arguments!r}]\n"
        "from mapmeld.cli import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "heavy = {'numpy', 'cv2', 'scipy', 'yaml', 'mapmeld.matching', 'mapmeld.grid'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_version() -> None:
    outcome = run("--version")
    assert (outcome.code, outcome.out) == (0, f"mapmeld {mapmeld.__version__}\n")


def test_without_a_command_there_is_help_and_exit_code_2(tmp_path: Path) -> None:
    outcome = run_for_real(cwd=tmp_path)
    assert outcome.code == 2
    assert "merge" in outcome.out + outcome.err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["frobnicate"], "frobnicate"),
        (["--frobnicate"], "--frobnicate"),
        (["match", "a.yaml"], "'B'"),
        (["match", "a.yaml", "b.yaml", "--resolution", "wide"], "'--resolution': "),
        (["match", "a.yaml", "b.yaml", "--resolution", "wide"], "'wide'"),
        (["benchmark", "d", "--workers", "0"], "0"),
        (["merge", "a.yaml", "-o", "m.yaml"], "two maps"),
        (["merge", "a.yaml", "b.yaml"], "--out"),
        (["merge", "a.yaml", "b.yaml", "-o", "m.yaml", "--fusion", "glue"], "'--fusion': 'glue'"),
        (["merge", "a.yaml", "b.yaml", "-o", "m.yaml", "--fusion", "glue"], "colour"),
        (["merge", "a.yaml", "b.yaml", "-o", "m.yaml", "--mode", "fancy"], "trinary"),
        (["show", "a.yaml", "-o", "p.png", "--transform", "1,2,3"], "second map"),
        (["diff", "a.yaml", "b.yaml"], "--out"),
        (["rebase", "a.yaml", "-o", "m.yaml"], "--onto"),
        (["transform-points", "p.yaml", "-o", "o.yaml"], "--from"),
    ],
)
def test_wrong_usage_is_one_line_and_exit_code_2(
    arguments: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    outcome = run(*arguments)
    assert outcome.code == 2
    assert outcome.out == ""
    assert said in outcome.line
    assert outcome.line.startswith("mapmeld: ")
    # Phrases of the library that checks values, none of which is for users.
    assert not any(phrase in outcome.line for phrase in ("Value error", "Input should", "parse"))


def test_what_help_lists_is_what_there_is() -> None:
    assert DEFAULT_METHOD == THE_DEFAULT_METHOD
    assert [str(f) for f in Fusion] == list(FUSIONS)
    assert [str(m) for m in WriteMode] == list(Mode.__args__)  # type: ignore[attr-defined]
    words = " ".join(run("diff", "--help").out.replace("│", " ").split())
    assert all(f"[default: {value:g}]" in words for value in (TOLERANCE, MAX_BEND, MIN_AREA))
