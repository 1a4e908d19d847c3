"""``mapmeld follow A_DIR B_DIR`` and ``mapmeld follow RECORDING --topics T1 T2``."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mapmeld.cli.errors import BAD_INPUT, NO_MATCH, say
from mapmeld.cli.options import DEFAULT_METHOD, Force, Method, ParamsFile, Settings

if TYPE_CHECKING:
    from mapmeld.cli.follow_outputs import Outputs
    from mapmeld.history import Step


class Strategy(StrEnum):
    """The strategies of `mapmeld.history.STRATEGIES`, listed here so that help need not import them."""

    EVIDENCE = "evidence"
    PAPER = "paper"


def follow(
    sources: Annotated[
        list[str],
        typer.Argument(
            metavar="A [B]",
            help="Two histories: folders of map_server maps whose names or times.txt say the time, or "
            "RECORDING#topic. Or one recording with the maps of two robots.",
        ),
    ],
    topics: Annotated[
        tuple[str, str] | None,
        typer.Option("--topics", metavar="T1 T2", help="Where the two maps of the recording are published."),
    ] = None,
    strategy: Annotated[
        Strategy,
        typer.Option(
            help="evidence: over time, may be withdrawn; paper: its Algorithm 1, the most similar stays."
        ),
    ] = Strategy.EVIDENCE,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", metavar="DIR", help="Write transform.json and, if matched, merged.yaml."),
    ] = None,
    every: Annotated[
        str | None,
        typer.Option(
            metavar="N|SECONDSs",
            help="Also write the merged map every N states (as 10) or seconds (as 30s) into DIR/snapshots.",
        ),
    ] = None,
    strip: Annotated[
        Path | None, typer.Option(metavar="PNG", help="Draw the merge growing, some moments in a row.")
    ] = None,
    gif: Annotated[Path | None, typer.Option(metavar="GIF", help="Draw the merge growing, animated.")] = None,
    rerun: Annotated[
        Path | None,
        typer.Option(metavar="RRD", help="Write a recording for the rerun viewer (extra 'rerun')."),
    ] = None,
    force: Force = False,
    json: Annotated[
        bool, typer.Option("--json", help="Print a JSON object per state and one at the end (docs/json.md).")
    ] = False,
    method: Method = DEFAULT_METHOD,
    params: ParamsFile = None,
    settings: Settings = None,
) -> None:
    """Follow two robots that map at the same time: match their maps again with every new state.

    Exits with 1, and writes no merged map, if no match is accepted at the end.
    """
    from mapmeld.cli.follow_outputs import Outputs, Wanted, read_interval
    from mapmeld.cli.follow_sources import processes
    from mapmeld.cli.parameters import effective_parameters
    from mapmeld.history import Standing
    from mapmeld.history import follow as follow_processes

    if every is not None and out is None:
        raise typer.BadParameter("snapshots go to the folder of -o", param_hint="--every")
    interval = None if every is None else read_interval(every)
    parameters = effective_parameters(method, params, settings)
    with ExitStack() as stack:
        wanted = Wanted(out, interval, strip, gif, rerun, force)
        outputs = stack.enter_context(Outputs(wanted))
        names, (process_1, process_2) = processes(sources, topics, stack)
        started = time.perf_counter()
        steps = follow_processes(process_1, process_2, method, parameters, strategy.value)
        last = _shown(steps, outputs, json)
        outcome = outputs.finish(
            last, names, method, parameters, strategy.value, time.perf_counter() - started
        )
    if json:
        from mapmeld.cli.json_output import as_json_line

        typer.echo(as_json_line(outcome))
    else:
        from mapmeld.cli.follow_table import print_outcome

        print_outcome(last, outputs.files)
    for problem in outputs.problems:
        say(problem)
    if outputs.problems:
        raise typer.Exit(BAD_INPUT)
    if last is None or last.standing is not Standing.ACCEPTED:
        raise typer.Exit(NO_MATCH)


def _shown(steps: Iterator[Step], outputs: Outputs, json: bool) -> Step | None:
    """Print and keep every step as it comes; return the last."""
    from mapmeld.cli.follow_table import LiveTable
    from mapmeld.cli.json_output import as_json_line, step_fields

    last = None
    with LiveTable(shown=not json) as table:
        for last in steps:
            outputs.take(last)
            if json:
                typer.echo(as_json_line(step_fields(last)))
            else:
                table.row(last)
    return last
