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

from mapmeld.io import printable
from mapmeld.wording import plural, probability_text, rounded

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from mapmeld.index import Candidate, MapIndex
    from mapmeld.matching import MatchResult
    from mapmeld.merging import MergeResult, PairMatch
    from mapmeld.merging.graph import MapGraph
    from mapmeld.se2 import Pose2

_COLOUR_OF = {"accepted": "bold green", "rejected": "bold red", "ambiguous": "bold yellow"}


def console() -> Console:
    """Return the console for stdout; in files and pipes lines are not broken at 80 columns."""
    return Console(highlight=False, width=None if sys.stdout.isatty() else 110)


def pose_text(pose: Pose2 | None) -> str:
    """Return a transform or pose in metres and degrees."""
    if pose is None:
        return "-"
    x, y = rounded(pose.x, 3), rounded(pose.y, 3)
    return f"x {x} m, y {y} m, theta {rounded(math.degrees(pose.theta), 2)} deg"


def deviations_text(covariance: NDArray[np.float64] | None) -> str | None:
    """Return the standard deviations of x, y and theta that a covariance (3, 3) of a match gives.

    None of None. Words behind them say what they leave out.
    """
    if covariance is None:
        return None
    x, y, theta = (math.sqrt(max(float(covariance[i, i]), 0.0)) for i in range(3))
    spread = f"x {rounded(x, 3)} m, y {rounded(y, 3)} m, theta {rounded(math.degrees(theta), 2)} deg"
    return f"{spread} (of the best rigid fit; drift within the maps is not in it)"


def print_lines(*lines: str) -> None:
    """Print every line on one: names may hold brackets or line ends, and nothing is broken or coloured."""
    out = console()
    for line in lines:
        out.print(Text(printable(line)), soft_wrap=True)


def print_table(table: Table) -> None:
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
    deviations = deviations_text(result.covariance)
    second = result.alternatives[0] if result.alternatives else None
    table.add_row("a", Text(printable(names[0])))
    table.add_row("b", Text(printable(names[1])))
    table.add_row("T_a_b", Text(pose_text(result.T_a_b), style="bold"))
    if deviations is not None:
        table.add_row("std dev", Text(deviations))
    table.add_row("verdict", Text(verdict, style=_COLOUR_OF.get(verdict, "")))
    table.add_row("reason", Text(result.reason))
    table.add_row("probability", Text(probability_text(result.probability)))
    if verdict == "ambiguous" and second is not None:
        sure = "" if second.probability is None else f"; probability {probability_text(second.probability)}"
        table.add_row("or", Text(pose_text(second.T_a_b) + sure))
    table.add_row("similarity", Text(rounded(result.similarity, 3)))
    table.add_row("overlap", Text(rounded(result.overlap, 3)))
    table.add_row("seconds", Text(rounded(result.seconds, 3)))
    print_table(table)


def print_merge(result: MergeResult, names: Sequence[str]) -> None:
    """Print where every map and every robot's start lies, and why a map is left out."""
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim", pad_edge=False)
    table.add_column("", justify="right")
    table.add_column("map", overflow="fold")
    for heading in ("x [m]", "y [m]", "theta [deg]", "similarity", "probability"):
        table.add_column(Text(heading), justify="right", no_wrap=True)
    table.add_column("", no_wrap=True)
    names = [printable(name) for name in names]
    evidence = {joint.index: joint.result for joint in result.joints}
    for i, (name, pose) in enumerate(zip(names, result.poses, strict=True)):
        numbers = ["-"] * 3 if pose is None else _numbers(pose)
        state = Text("the reference") if i == 0 else Text("joined", style="green")
        if pose is None:
            state = Text("not joined", style="bold red")
        shown = ["-", "-"]
        if i in evidence:
            shown = [rounded(evidence[i].similarity, 3), probability_text(evidence[i].probability)]
        table.add_row(str(i + 1), Text(name), *numbers, *shown, state)
    out = console()
    out.print(Text("Transforms T_1_i: each map's frame in the frame of map 1", style="bold"))
    print_table(table)
    out.print()
    out.print(Text("Start poses of the robots in the frame of map 1", style="bold"))
    for i, start in enumerate(result.starts):
        out.print(Text(f"{i + 1}  {pose_text(start)}"))
    for index, refused in sorted(result.refused.items()):
        out.print()
        line = Text(f"{names[index]} was not joined: ", style="bold red")
        out.print(line + Text(refused.reason, style="not bold default"), soft_wrap=True)
    if len(result.poses) > 2:
        print_pairs(result.pairs, names)
    groups = [component for component in result.components[1:] if len(component) > 1]
    for group in groups:
        members = ", ".join(names[i] for i in group)
        out.print(Text(f"These fit one another, but not map 1: {members}"), soft_wrap=True)


def print_graph(graph: MapGraph, names: Sequence[str]) -> None:
    """Print the components, the poses in them, and every pair that the graph has something to say of."""
    names = [printable(name) for name in names]
    out = console()
    for number, members in enumerate(graph.components, start=1):
        first = names[members[0]]
        if len(members) == 1:
            out.print(Text(f"Component {number}: {first} alone", style="bold"), soft_wrap=True)
            continue
        out.print(Text(f"Component {number}: transforms into the frame of {first}", style="bold"))
        table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim", pad_edge=False)
        table.add_column("", justify="right")
        table.add_column("map", overflow="fold")
        for heading in ("x [m]", "y [m]", "theta [deg]", "std dev x, y [m]", "theta [deg]"):
            table.add_column(Text(heading), justify="right", no_wrap=True)
        for i in members:
            covariance = graph.covariances[i]
            x, y, theta = (math.sqrt(max(float(covariance[k, k]), 0.0)) for k in range(3))
            spread = [f"{rounded(x, 3)}, {rounded(y, 3)}", rounded(math.degrees(theta), 2)]
            table.add_row(str(i + 1), Text(names[i]), *_numbers(graph.poses[i]), *spread)
        print_table(table)
    print_pairs(graph.pairs, names)


def print_found(found: Sequence[Candidate], index: MapIndex, name: str) -> None:
    """Print the maps that may show the same place as the map of that name, and where it lies in them."""
    if not found:
        print_lines(f"Of {plural(len(index.maps), 'map')} in the index, none looks like {name}.")
        return
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim", pad_edge=False)
    table.add_column("map", overflow="fold")
    matched = any(candidate.result is not None or candidate.problem for candidate in found)
    for heading in ("looks", *(("x [m]", "y [m]", "theta [deg]", "probability") if matched else ())):
        table.add_column(Text(heading), justify="right", no_wrap=True)
    if matched:
        table.add_column("", no_wrap=True)
    for candidate in found:
        row: list[Text | str] = [
            Text(printable(_within(candidate.path, index.root))),
            rounded(candidate.score, 3),
        ]
        result = candidate.result
        if result is not None:
            numbers = ["-"] * 3 if result.T_a_b is None else _numbers(result.T_a_b)
            verdict = str(result.verdict)
            row += [
                *numbers,
                probability_text(result.probability),
                Text(verdict, style=_COLOUR_OF.get(verdict, "")),
            ]
        elif candidate.problem:
            row += [*["-"] * 4, Text("cannot be read", style="bold red")]
        table.add_row(*row)
    what = "Where it lies in the frame of each" if matched else "By looks alone; nothing was matched"
    line = f"The {len(found)} of {len(index.maps)} maps that look most like {name}. {what}:"
    console().print(Text(printable(line), style="bold"), soft_wrap=True)
    print_table(table)


def _within(path: Path, root: Path) -> str:
    return path.relative_to(root).as_posix() if path.is_relative_to(root) else str(path)


def print_pairs(pairs: Sequence[PairMatch], names: Sequence[str]) -> None:
    """Print how many matches are used, and each that is not simply used or unused, with the reason."""
    if not pairs:
        return
    states = [str(pair.state) for pair in pairs]
    told = ", ".join(
        f"{states.count(state)} {state}"
        for state in ("used", "settled", "false", "doubted")
        if state in states or state == "used"
    )
    print_lines("", f"Of {plural(len(pairs), 'pair')}: {told}.")
    for pair in pairs:
        if pair.state in ("false", "doubted", "settled") or pair.bridge:
            state = "bridge" if pair.bridge else str(pair.state)
            print_lines(f"  {state}: {names[pair.i]} - {names[pair.j]}: {pair.why}")


def _numbers(pose: Pose2) -> list[str]:
    return [rounded(pose.x, 3), rounded(pose.y, 3), rounded(math.degrees(pose.theta), 2)]


def print_files(files: Sequence[Path]) -> None:
    """Print the names of files that were written, one per line."""
    print_lines("", "Written:", *(f"  {file}" for file in files))
