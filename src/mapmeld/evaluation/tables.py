"""The outcome of a benchmark in one table: a line per data set and method."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from mapmeld.evaluation.calibration import brier_score, expected_calibration_error, recall_without_wrong
from mapmeld.evaluation.pairs import Kind
from mapmeld.evaluation.rows import ERROR, TrialRow
from mapmeld.matching import Verdict

if TYPE_CHECKING:
    from rich.table import Table


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """What one method did on one data set. Shares are of the trials with the same place, 0..1.

    A value is None where there is nothing to take it from.

    Attributes
    ----------
    same, different
        How many trials showed the same place, different places.
    accepted_right
        Share accepted and right.
    guess_right
        Share whose best guess is right, whatever the verdict.
    ambiguous
        Share with the verdict "ambiguous".
    wrong_accepts_same, wrong_accepts_different
        How many accepted answers were wrong.
    errors
        How many trials failed with an exception.
    calibration_error, brier
        See `mapmeld.evaluation.calibration`; over all trials with a probability.
    recall_without_wrong
        Greatest share that a threshold on `TrialRow.score` could accept without a wrong accept.
    translation_error, rotation_error
        Median errors of answers that were accepted and right [m], [rad].
    seconds, seconds_p95
        Median and 95th percentile of the wall time of the trials that did not fail.
    time_ratio
        Median of their time relative to `TrialRow.time_against` on the same maps.
    """

    dataset: str
    method: str
    same: int
    different: int
    accepted_right: float | None
    guess_right: float | None
    ambiguous: float | None
    wrong_accepts_same: int
    wrong_accepts_different: int
    errors: int
    calibration_error: float | None
    brier: float | None
    recall_without_wrong: float | None
    translation_error: float | None
    rotation_error: float | None
    seconds: float | None
    seconds_p95: float | None
    time_ratio: float | None


def grouped(rows: Iterable[TrialRow]) -> dict[tuple[str, str], list[TrialRow]]:
    """Return rows by (data set, method), in the order in which these first occur.

    A method that occurs with several settings counts once for each, named "method 1", "method 2" …
    """
    settings: dict[str, list[str]] = {}
    rows = list(rows)
    for row in rows:
        known = settings.setdefault(row.method, [])
        if row.parameters not in known:
            known.append(row.parameters)
    groups: dict[tuple[str, str], list[TrialRow]] = {}
    for row in rows:
        known = settings[row.method]
        name = row.method if len(known) == 1 else f"{row.method} {known.index(row.parameters) + 1}"
        groups.setdefault((row.dataset, name), []).append(row)
    return groups


def summaries(rows: Iterable[TrialRow]) -> tuple[Summary, ...]:
    """Sum up rows, one line per data set and method."""
    return tuple(_summary(dataset, method, group) for (dataset, method), group in grouped(rows).items())


def _summary(dataset: str, method: str, rows: Sequence[TrialRow]) -> Summary:
    same = [row for row in rows if row.kind == Kind.SAME]
    accepted = [row for row in rows if row.verdict == Verdict.ACCEPTED]
    good = [row for row in accepted if row.right]
    wrong = [row for row in accepted if not row.right]
    guessed = [row for row in rows if row.x is not None]
    stated = [row for row in rows if row.probability is not None]
    probabilities = [row.probability for row in stated if row.probability is not None]
    right = [row.right for row in stated]
    answered = [row for row in rows if row.verdict != ERROR]
    seconds = [row.seconds for row in answered]
    return Summary(
        dataset=dataset,
        method=method,
        same=len(same),
        different=len(rows) - len(same),
        accepted_right=_share(same, lambda row: row.right and row.verdict == Verdict.ACCEPTED),
        guess_right=_share(same, lambda row: row.right),
        ambiguous=_share(same, lambda row: row.verdict == Verdict.AMBIGUOUS),
        wrong_accepts_same=sum(row.kind == Kind.SAME for row in wrong),
        wrong_accepts_different=sum(row.kind != Kind.SAME for row in wrong),
        errors=sum(row.verdict == ERROR for row in rows),
        calibration_error=expected_calibration_error(probabilities, right),
        brier=brier_score(probabilities, right),
        recall_without_wrong=recall_without_wrong(
            [row.score for row in guessed], [row.right for row in guessed], len(same)
        ),
        translation_error=_median([row.translation_error for row in good]),
        rotation_error=_median([row.rotation_error for row in good]),
        seconds=_median(seconds),
        seconds_p95=float(np.percentile(seconds, 95)) if seconds else None,
        time_ratio=_median([row.time_ratio for row in answered]),
    )


def _share(rows: Sequence[TrialRow], holds: Callable[[TrialRow], bool]) -> float | None:
    return sum(map(holds, rows)) / len(rows) if rows else None


def _median(values: Iterable[float | None]) -> float | None:
    there = [value for value in values if value is not None]
    return float(np.median(there)) if there else None


# ---------------------------------------------------------------------- as text
_HEADINGS = (
    "data set",
    "method",
    "pairs same / different",
    "accepted and right %",
    "best guess right %",
    "ambiguous %",
    "wrong accepts same / different",
    "errors",
    "recall at no wrong %",
    "ECE",
    "Brier",
    "median error m",
    "deg",
    "seconds median",
    "p95",
    "time ratio",
)
_TEXT_COLUMNS = 2
_GAP = 2  # blanks between two columns of a terminal
_HARMLESS = {_HEADINGS.index("wrong accepts same / different"): "0 / 0", _HEADINGS.index("errors"): "0"}
_LEAST_NEEDED_FIRST = (
    "Brier",
    "p95",
    "deg",
    "recall at no wrong %",
    "pairs same / different",
    "ambiguous %",
    "ECE",
    "errors",
    "time ratio",
)


def _cells(s: Summary) -> tuple[str, ...]:
    degrees = None if s.rotation_error is None else math.degrees(s.rotation_error)
    return (
        s.dataset,
        s.method,
        f"{s.same} / {s.different}",
        _percent(s.accepted_right),
        _percent(s.guess_right),
        _percent(s.ambiguous),
        f"{s.wrong_accepts_same} / {s.wrong_accepts_different}",
        str(s.errors),
        _percent(s.recall_without_wrong),
        _digits(s.calibration_error, 3),
        _digits(s.brier, 3),
        _digits(s.translation_error, 3),
        _digits(degrees, 3),
        _digits(s.seconds, 4),
        _digits(s.seconds_p95, 4),
        _digits(s.time_ratio, 2),
    )


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{100 * share:.1f}"


def _digits(value: float | None, digits: int) -> str:
    return "–" if value is None else f"{value:.{digits}f}"


def _shown(lines: Sequence[Summary]) -> list[int]:
    """Return the columns worth showing: the last only if something was timed against another method."""
    timed = any(s.time_ratio is not None for s in lines)
    return [i for i, heading in enumerate(_HEADINGS) if timed or heading != "time ratio"]


def markdown_table(lines: Sequence[Summary]) -> str:
    """Return the table as Markdown."""
    shown = _shown(lines)
    rule = ["---" if i < _TEXT_COLUMNS else "--:" for i in shown]
    rows = [[_HEADINGS[i] for i in shown], rule]
    rows += [[_cells(s)[i].replace("|", "\\|") for i in shown] for s in lines]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def rich_table(lines: Sequence[Summary], width: int | None = None) -> Table:
    """Return the table for a terminal of `width` columns, None: as wide as need be.

    Wrong accepts and errors stand out. What is too wide loses columns, not its legibility: the caption
    names those left out.
    """
    from rich.table import Table
    from rich.text import Text

    cells = [_cells(s) for s in lines]
    shown = _shown(lines)
    needed = {i: max(map(len, [*_HEADINGS[i].split(), *(row[i] for row in cells)])) for i in shown}
    left_out = []
    for heading in _LEAST_NEEDED_FIRST:
        if width is not None and sum(needed[i] + _GAP for i in shown) > width:
            i = _HEADINGS.index(heading)
            if i in shown:
                shown.remove(i)
                left_out.append(heading)
    caption = f"left out, the terminal is too narrow: {', '.join(left_out)}" if left_out else None
    table = Table(
        box=None,
        padding=(0, _GAP, 0, 0),
        header_style="dim",
        pad_edge=False,
        caption=caption,
        caption_justify="left",
    )
    for i in shown:
        justify: Literal["left", "right"] = "left" if i < _TEXT_COLUMNS else "right"
        # Broken here, as rich may narrow one column below its longest word to leave another wider.
        heading = "\n".join(textwrap.wrap(_HEADINGS[i], needed[i]))
        table.add_column(Text(heading), justify=justify, vertical="bottom", no_wrap=True)
    for row in cells:
        table.add_row(
            *(Text(row[i], style="bold red" if row[i] != _HARMLESS.get(i, row[i]) else "") for i in shown)
        )
    return table
