"""The README's examples run as they stand; what it says of commands is what the project does."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from mapmeld.cli.commands import app
from mapmeld.history import EvidenceParameters
from mapmeld.matching.correlative import CorrelativeParameters

ROOT = Path(__file__).parents[1]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def blocks(language: str) -> list[object]:
    found: list[object] = []
    for document in DOCUMENTS:
        text = document.read_text(encoding="utf-8")
        for number, block in enumerate(re.findall(rf"^```{language}\n(.*?)^```$", text, re.M | re.S), 1):
            found.append(pytest.param(block, id=f"{document.name}-{number}"))
    return found


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder with the examples in it, as in a clone."""
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("block", blocks("python"))
def test_python_examples_run(block: str, workplace: Path) -> None:
    run = subprocess.run([sys.executable, "-W", "error", "-c", block], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize("block", blocks("console"))
def test_commands_run_and_exit_as_shown(block: str, workplace: Path) -> None:
    commands = re.findall(r"^\$ (.*)$", block, re.M)
    assert commands, "a console block shows commands after '$ '"
    for command in commands:
        assert command.startswith("mapmeld "), command
        command, _, comment = command.partition("  #")
        expected = int(match[1]) if (match := re.search(r"exit code (\d)", comment)) else 0
        # In this process: a start takes longer than most commands, and tests/cli has some for real.
        done = CliRunner().invoke(app, command.split()[1:], catch_exceptions=False)
        assert done.exit_code == expected, f"{command}\n{done.output}"


def test_examples_run_one_after_the_other_do_not_write_over_one_another() -> None:
    written: list[str] = []
    for block in blocks("console"):
        for command in re.findall(r"^\$ (.*)$", block.values[0], re.M):  # type: ignore[attr-defined]
            written += re.findall(r" (?:-o|--out|--strip|--gif|--rerun) (\S+)", command)
    for block in blocks("python"):
        written += re.findall(r"""(?:save|write_history)\(.*["']([\w.]+)["']\)""", block.values[0])  # type: ignore[attr-defined]
    assert len(written) > 10
    assert sorted(written) == sorted(set(written))


def test_the_thresholds_of_histories_are_those_of_the_code() -> None:
    text = " ".join((ROOT / "docs" / "histories.md").read_text(encoding="utf-8").split())
    evidence = EvidenceParameters()
    assert f"`accept_probability` ({CorrelativeParameters().accept_probability:g} unless set)" in text
    assert f"at least {evidence.keep_probability:g} in the newest state" in text
    assert f"or one reaches {evidence.sure_probability:g}" in text


def test_the_readme_has_the_two_set_up_commands_and_ci_runs_the_second() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    commands = {}
    for marker in ("demo", "tests"):
        block = re.search(rf"<!-- {marker} -->\n```\n(.*?)\n```", text, re.S)
        assert block, f"the README has no command marked {marker}"
        assert "\n" not in block[1]
        commands[marker] = block[1]
    find = re.search(r"readme_tests=\$\((.*)\)$", (ROOT / ".ci" / "run").read_text(encoding="utf-8"), re.M)
    assert find
    found = subprocess.run(["bash", "-c", find[1]], cwd=ROOT, capture_output=True, text=True, check=True)
    assert found.stdout.strip() == commands["tests"]


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda d: d.name)
def test_links_and_pictures_exist(document: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", document.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (document.parent / target).exists(), target
