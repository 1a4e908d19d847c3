"""Running the command line in tests: in this process, or for real in one of its own."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from drawing import office, seen_from
from typer.testing import CliRunner

from mapmeld.cli.commands import app
from mapmeld.grid import OccupancyGrid
from mapmeld.io import save
from mapmeld.se2 import Pose2

T_B_A = Pose2(3.0, -2.0, math.radians(40))
T_A_B = T_B_A.inverse()


@dataclass(frozen=True)
class Outcome:
    code: int
    out: str
    err: str

    @property
    def line(self) -> str:
        """The complaint, which must be one line."""
        assert self.err.endswith("\n")
        assert self.err.count("\n") == 1, self.err
        return self.err.strip()


def run(*arguments: object) -> Outcome:
    """Run a command; an exception that is not turned into an exit code fails the test."""
    result = CliRunner().invoke(app, [str(a) for a in arguments], catch_exceptions=False)
    return Outcome(result.exit_code, result.stdout, result.stderr)


def run_for_real(*arguments: object, cwd: Path) -> Outcome:
    done = subprocess.run(
        [sys.executable, "-m", "mapmeld", *(str(a) for a in arguments)],
        cwd=cwd,
        capture_output=True,
        text=True,
        encoding="utf-8",
        env={**os.environ, "PYTHONIOENCODING": "utf-8"},
    )
    return Outcome(done.returncode, done.stdout, done.stderr)


@cache
def _grids() -> dict[str, OccupancyGrid]:
    a = office()
    third = seen_from(a, Pose2(-1.0, 4.0, math.radians(-75)))
    bare = OccupancyGrid(a.cells * 0, 0.05)
    mirrored = OccupancyGrid(a.cells[:, ::-1], 0.05)
    return {"a": a, "b": seen_from(a, T_B_A), "c": third, "empty": bare, "mirrored": mirrored}


def write_maps(folder: Path, *names: str) -> list[Path]:
    """Write test maps: "a"; "b" and "c", the same in other frames; "empty", without walls; "mirrored"."""
    for name in names:
        save(_grids()[name], folder / f"{name}.yaml")
    return [folder / f"{name}.yaml" for name in names]
