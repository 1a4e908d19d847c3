"""How a run ends that nobody foresaw: never with 1, which says that maps do not match."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import pytest
from running import write_maps

from mapmeld.cli.errors import BAD_INPUT, CLOSED_PIPE, FAULT, INTERRUPTED

posix = pytest.mark.skipif(os.name != "posix", reason="a matter of POSIX")
full = pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")

COMMANDS = [
    ["match", "a.yaml", "b.yaml", "--json"],
    ["match", "a.yaml", "b.yaml"],
    ["merge", "a.yaml", "b.yaml", "-o", "m.yaml", "--force"],
    ["show", "a.yaml", "-o", "p.png", "--force"],
    ["--help"],
    ["match", "--help"],
    ["--version"],
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("maps")
    write_maps(folder, "a", "b")
    return folder


@pytest.fixture
def closed_pipe() -> Iterator[IO[bytes]]:
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "wb") as stream:
        yield stream


def start(folder: Path, *arguments: str, unbuffered: bool = False, **streams: Any) -> tuple[int, str]:
    """Run for real; return the exit code and what was said on stderr."""
    environment = {**os.environ, "PYTHONUNBUFFERED": "1" if unbuffered else ""}
    streams = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, **streams}
    command = [sys.executable, "-m", "mapmeld", *arguments]
    done = subprocess.run(command, cwd=folder, text=True, env=environment, **streams)
    return done.returncode, done.stderr


def run_script(folder: Path, prepared: str) -> tuple[int, str]:
    """Match two maps after some lines of Python; return the exit code and what was said on stderr."""
    script = (
        f"{prepared}\n"
        "import sys\n"
        "sys.argv = ['mapmeld', 'match', 'a.yaml', 'b.yaml']\n"
        "from mapmeld.cli import main\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=folder, capture_output=True, text=True)
    assert done.stdout == ""
    return done.returncode, done.stderr


def failing_match(error: str) -> str:
    return f"import mapmeld.matching\ndef fail(*_):\n    {error}\nmapmeld.matching.match = fail"


def interrupted_import(module: str) -> str:
    return (
        "import builtins\n"
        "original = builtins.__import__\n"
        "def import_(name, *rest):\n"
        f"    if name == {module!r}:\n"
        "        raise KeyboardInterrupt\n"
        "    return original(name, *rest)\n"
        "builtins.__import__ = import_"
    )


@posix
@pytest.mark.parametrize("unbuffered", [False, True])
@pytest.mark.parametrize("arguments", COMMANDS, ids=" ".join)
def test_a_closed_pipe_is_silent(
    folder: Path, arguments: list[str], unbuffered: bool, closed_pipe: IO[bytes]
) -> None:
    assert start(folder, *arguments, stdout=closed_pipe, unbuffered=unbuffered) == (CLOSED_PIPE, "")
    assert CLOSED_PIPE == 128 + signal.SIGPIPE


@full
@pytest.mark.parametrize("unbuffered", [False, True])
@pytest.mark.parametrize("arguments", COMMANDS, ids=" ".join)
def test_a_full_disk_is_one_line(folder: Path, arguments: list[str], unbuffered: bool) -> None:
    with Path("/dev/full").open("w") as stdout:
        code, said = start(folder, *arguments, stdout=stdout, unbuffered=unbuffered)
    assert code == BAD_INPUT
    assert said == "mapmeld: standard output cannot be written: No space left on device\n"


@posix
def test_a_closed_stdout_is_refused_before_any_work(folder: Path) -> None:
    command = f"{sys.executable} -m mapmeld show a.yaml -o closed.png >&-"
    done = subprocess.run(["/bin/sh", "-c", command], cwd=folder, capture_output=True, text=True)
    assert done.returncode == BAD_INPUT
    assert done.stderr == "mapmeld: standard output is closed; if it is not wanted, send it to /dev/null\n"
    assert not (folder / "closed.png").exists()


@posix
def test_without_stderr_the_exit_code_still_tells(folder: Path) -> None:
    for redirected in ("2>&-", "2>/dev/null", *(["2>/dev/full"] if Path("/dev/full").exists() else [])):
        for arguments, code in (("match a.yaml b.yaml", 0), ("match a.yaml nowhere.yaml", BAD_INPUT)):
            command = f"{sys.executable} -m mapmeld {arguments} {redirected}"
            done = subprocess.run(["/bin/sh", "-c", command], cwd=folder, capture_output=True, text=True)
            assert done.returncode == code
            assert ("T_a_b" in done.stdout) == (code == 0)


@pytest.mark.parametrize(
    ("error", "said"),
    [
        ("raise MemoryError", "MemoryError"),
        ("raise RecursionError", "RecursionError"),
        ("[][0]", "IndexError"),
        ("raise OSError(28, 'No space left on device')", "OSError"),
        ("open('/nowhere/at/all')", "FileNotFoundError"),
    ],
)
def test_a_fault_keeps_its_traceback_and_has_its_own_exit_code(folder: Path, error: str, said: str) -> None:
    code, stderr = run_script(folder, failing_match(error))
    assert code == FAULT
    assert stderr.startswith("Traceback")
    assert said in stderr.splitlines()[-1]


@pytest.mark.parametrize(
    "prepared",
    [
        failing_match("raise KeyboardInterrupt"),
        *map(interrupted_import, ("traceback", "typer", "mapmeld.matching.match")),
    ],
)
def test_ctrl_c_at_work_and_in_imports(folder: Path, prepared: str) -> None:
    code, stderr = run_script(folder, prepared)
    assert code == INTERRUPTED
    assert stderr.startswith("mapmeld: interrupted")
    assert stderr.count("\n") == 1


def test_the_face_of_the_command_line_is_light() -> None:
    code = "import sys, mapmeld.cli; print({'typer', 'rich', 'numpy', 'traceback'} & set(sys.modules))"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "set()"
