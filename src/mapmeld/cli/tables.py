"""Results as people read them: rich tables on stdout, metres and degrees."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from pathlib import Path

    from mapmeld.matching import MatchResult
    from mapmeld.merging import MergeResult
    from mapmeld.se2 import Pose2

_COLOUR_OF = {"accepted": "bold green", "rejected": "bold red", "ambiguous": "bold yellow"}


def console() -> Console:
    """Return the console for stdout; in files and pipes lines are not broken at 80 columns."""
    return Console(highlight=False, width=None if sys.stdout.isatty() else 110)


def rounded(value: float, digits: int) -> str:
    """Return a number in plain digits, never as -0.000."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


def pose_text(pose: Pose2 | None) -> str:
    """Return a transform or pose in metres and degrees."""
    if pose is None:
        return "-"
    x, y = rounded(pose.x, 3), rounded(pose.y, 3)
    return f"x {x} m, y {y} m, theta {rounded(math.degrees(pose.theta), 2)} deg"


def print_lines(*lines: str) -> None:
    """Print lines as they are: names may hold brackets, and nothing is broken or coloured."""
    out = console()
    for line in lines:
        out.print(Text(line), soft_wrap=True)


def _print_table(table: Table) -> None:
    """Print a table without the blanks that rich fills its lines up with."""
    out = console()
    with out.capture() as captured:
        out.print(table)
    typer.echo("\n".join(line.rstrip() for line in captured.get().splitlines()))


def print_match(result: MatchResult, names: Sequence[str]) -> None:
    """Print the answer for two maps and the evidence for it."""
    table = Table.grid(padding=(0, 3))
    table.add_column(style="dim", no_wrap=True)
    table.add_column(overflow="fold")
    verdict = str(result.verdict)
    probability = "-" if result.probability is None else rounded(result.probability, 3)
    for label, value in (
        ("a", Text(names[0])),
        ("b", Text(names[1])),
        ("T_a_b", Text(pose_text(result.T_a_b), style="bold")),
        ("verdict", Text(verdict, style=_COLOUR_OF.get(verdict, ""))),
        ("reason", Text(result.reason)),
        ("similarity", Text(rounded(result.similarity, 3))),
        ("overlap", Text(rounded(result.overlap, 3))),
        ("probability", Text(probability)),
        ("seconds", Text(rounded(result.seconds, 3))),
    ):
        table.add_row(label, value)
    _print_table(table)


def print_merge(result: MergeResult, names: Sequence[str]) -> None:
    """Print where every map and every robot's start lies, and why a map is left out."""
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim", pad_edge=False)
    table.add_column("", justify="right")
    table.add_column("map", overflow="fold")
    for heading in ("x [m]", "y [m]", "theta [deg]", "similarity"):
        table.add_column(Text(heading), justify="right", no_wrap=True)
    table.add_column("", no_wrap=True)
    similarity = {joint.index: joint.result.similarity for joint in result.joints}
    for i, (name, pose) in enumerate(zip(names, result.poses, strict=True)):
        numbers = ["-"] * 3 if pose is None else _numbers(pose)
        state = Text("the reference") if i == 0 else Text("joined", style="green")
        if pose is None:
            state = Text("not joined", style="bold red")
        shown = rounded(similarity[i], 3) if i in similarity else "-"
        table.add_row(str(i + 1), Text(name), *numbers, shown, state)
    out = console()
    out.print(Text("Transforms T_1_i: each map's frame in the frame of map 1", style="bold"))
    _print_table(table)
    out.print()
    out.print(Text("Start poses of the robots in the frame of map 1", style="bold"))
    for i, start in enumerate(result.starts):
        out.print(Text(f"{i + 1}  {pose_text(start)}"))
    for index, refused in sorted(result.refused.items()):
        out.print()
        line = Text(f"{names[index]} was not joined: ", style="bold red")
        out.print(line + Text(refused.reason, style="not bold default"), soft_wrap=True)
    groups = [component for component in result.components[1:] if len(component) > 1]
    for group in groups:
        members = ", ".join(names[i] for i in group)
        out.print(Text(f"These fit one another, but not map 1: {members}"), soft_wrap=True)


def _numbers(pose: Pose2) -> list[str]:
    return [rounded(pose.x, 3), rounded(pose.y, 3), rounded(math.degrees(pose.theta), 2)]


def print_files(files: Sequence[Path]) -> None:
    """Print the names of files that were written, one per line."""
    print_lines("", "Written:", *(f"  {file}" for file in files))
