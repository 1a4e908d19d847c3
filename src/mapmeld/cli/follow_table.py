"""What a user sees while two mapping processes are followed: a row for each state, as it comes."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType

from rich.console import Console
from rich.text import Text

from mapmeld.cli.tables import (
    console,
    deviations_text,
    pose_text,
    print_files,
    print_lines,
)
from mapmeld.history import Change, Standing, Step
from mapmeld.io import printable
from mapmeld.wording import probability_text, rounded

_STYLES = {Standing.ACCEPTED: "green", Standing.WITHDRAWN: "bold red", Standing.UNDECIDED: "yellow"}
_LOUD = {Change.FOUND: "bold green", Change.LOWERED: "bold yellow", Change.SWITCHED: "bold red"}
_WIDTHS = (9, 10, 8, 12, 10, 10)
_HEADINGS = ("states", "time [s]", "overlap", "probability", "verdict", "change")
_NARROWEST_WORDS = 20


class LiveTable:
    """Rows of one width, so that each can be printed when it comes; on a terminal a sign of life too."""

    def __init__(self, *, shown: bool) -> None:
        self._out = console()
        self._begin: float | None = None
        self._shown = shown
        terminal = shown and sys.stdout.isatty()
        self._status = self._out.status("Waiting for the next state") if terminal else None

    def __enter__(self) -> LiveTable:
        if self._shown:
            self._print(Text(_cells(_HEADINGS) + "why", style="dim"))
        if self._status is not None:
            self._status.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._status is not None:
            self._status.stop()

    def row(self, step: Step) -> None:
        """Print a step."""
        time = "-"
        if step.stamp is not None:
            self._begin = step.stamp if self._begin is None else self._begin
            time = rounded(step.stamp - self._begin, 1)
        best = step.best
        found = best is not None and best.T_a_b is not None
        words = (
            f"{step.states[0]} + {step.states[1]}",
            time,
            rounded(best.overlap, 2) if best is not None and found else "-",
            probability_text(best.probability) if best is not None and found else "-",
            str(step.standing),
            "" if step.change is Change.NONE else str(step.change),
        )
        line = Text(_cells(words))
        start = sum(_WIDTHS[:4])
        line.stylize(_STYLES[step.standing], start, start + _WIDTHS[4])
        line.stylize(_LOUD.get(step.change, ""), start + _WIDTHS[4])
        self._print(line + Text(printable(step.why), style="dim"))

    def _print(self, line: Text) -> None:
        if sys.stdout.isatty():  # a row is a line; files and pipes get all of it
            line.truncate(max(self._out.width, sum(_WIDTHS) + _NARROWEST_WORDS), overflow="ellipsis")
        self._out.print(line, soft_wrap=True)
        _flush(self._out)


def _flush(out: Console) -> None:
    out.file.flush()  # into a pipe too, rows shall come while there is something to see


def _cells(words: Sequence[str]) -> str:
    """Lay words into the columns: the first four, which are numbers, to the right."""
    laid = [word.rjust(width - 2) + "  " for word, width in zip(words[:4], _WIDTHS, strict=False)]
    return "".join([*laid, *(word.ljust(width) for word, width in zip(words[4:], _WIDTHS[4:], strict=True))])


def print_outcome(last: Step | None, files: Sequence[Path]) -> None:
    """Print what it came to."""
    lines = [""]
    best = None if last is None else last.best
    if last is not None and best is not None and best.T_a_b is not None:
        if last.T_1_2 is not None:
            lines.append(f"T_1_2        {pose_text(last.T_1_2)}")
            deviations = deviations_text(best.covariance)
            lines += [] if deviations is None else [f"std dev      {deviations}"]
        lines.append(f"probability  {probability_text(best.probability)}")
        why = (
            last.why
            if last.standing is Standing.WITHDRAWN and last.change is Change.WITHDRAWN
            else best.reason
        )
        lines.append(f"verdict      {last.standing}: {why}")
    else:
        lines.append("There was nothing to match.")
    print_lines(*lines)
    if last is None or last.T_1_2 is None:
        print_lines("", "No match is accepted, so nothing is merged.")
    if files:
        print_files(files)
