"""``mapmeld benchmark DATASET ...``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mapmeld.cli.errors import INTERRUPTED, say
from mapmeld.cli.options import Cluster
from mapmeld.cli.progress import counting
from mapmeld.errors import MapmeldError

if TYPE_CHECKING:
    from mapmeld.evaluation import Dataset, Summary, Tolerance, TrialRow

ROWS = "rows"
SETTINGS = "settings.yaml"
TABLE = "table.md"


class BenchmarkError(MapmeldError):
    """A benchmark that cannot be run as asked."""


def benchmark(
    datasets: Annotated[
        list[Path],
        typer.Argument(metavar="DATASET", help="Folders with a list of pairs, or such lists themselves."),
    ],
    pairs: Annotated[
        str, typer.Option(metavar="NAME", help="Name of the list of pairs in the folders.")
    ] = "pairs.json",
    methods: Annotated[
        str, typer.Option(metavar="A,B", help="Methods to run, with commas between them.")
    ] = "all",
    workers: Annotated[int, typer.Option(metavar="N", min=1, help="Processes, of one thread each.")] = 1,
    cluster: Cluster = None,
    turn: Annotated[
        int,
        typer.Option(metavar="N", min=0, help="Try each pair N times, map 2 turned by another angle each."),
    ] = 0,
    swap: Annotated[bool, typer.Option("--swap", help="Lay map 1 on map 2 instead of 2 on 1.")] = False,
    seed: Annotated[int, typer.Option(metavar="S", help="Of the angles and of the choice by --limit.")] = 0,
    limit: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Take N pairs of each data set, drawn at random.")
    ] = None,
    tolerance: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[NAME=]M,DEG",
            help="What counts as right, in metres and degrees, for all data sets or the one named.",
        ),
    ] = None,
    time_against: Annotated[
        str | None,
        typer.Option(metavar="METHOD", help="Time this method on the same maps, and print the ratio."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "-o", "--out", metavar="DIR", help="Keep rows, table and plots; an earlier run goes on."
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Start afresh: remove the rows in DIR.")] = False,
) -> None:
    """Run methods over map pairs with known truth and say how often they are right, and how sure.

    With --out every trial is kept as it is done: the same command goes on where the last run stopped.
    """
    from mapmeld.evaluation import markdown_table, plan_trials, read_dataset, run_trials, summaries
    from mapmeld.evaluation.rows import ERROR
    from mapmeld.matching import METHODS

    sets = [read_dataset(path, pairs) for path in datasets]
    names = list(METHODS) if methods == "all" else [name.strip() for name in methods.split(",")]
    tolerances = _tolerances(tolerance or (), sets)
    if out is not None:
        _check_out(out, force)
    with counting("Reading maps", sum(min(limit or len(s.pairs), len(s.pairs)) for s in sets)) as step:
        trials = plan_trials(
            sets,
            names,
            turn=turn,
            seed=seed,
            limit=limit,
            swap=swap,
            tolerances=tolerances,
            time_against=time_against,
            on_pair=step,
        )

    finished: list[TrialRow] = []
    keep: Callable[[Sequence[TrialRow]], None] | None = None
    if out is not None:
        from mapmeld.evaluation.settings import settings_of
        from mapmeld.evaluation.store import add_rows

        store = out / ROWS
        used = settings_of(
            sets, trials, turn=turn, seed=seed, limit=limit, workers=workers, tolerances=tolerances
        )
        finished = _opened(out, used, force)

        def keep(rows: Sequence[TrialRow]) -> None:
            add_rows(store, rows)

    wanted = {trial.key for trial in trials}
    done = sum(row.key in wanted for row in finished)
    if finished:
        aside = f" ({len(finished) - done} rows of other settings or other code)" * (done < len(finished))
        say(f"{out}: {done} of {len(trials)} trials are done already{aside}")
    try:
        with counting("Matching", len(trials) - done) as step:
            rows = run_trials(
                trials,
                workers=workers,
                cluster=cluster,
                finished=finished,
                keep=keep,
                on_row=lambda _: step(),
            )
    except KeyboardInterrupt:
        kept = (
            "" if out is None else f"; what was done is in {out / ROWS}, the same command goes on from there"
        )
        say(f"interrupted{kept}")
        raise typer.Exit(INTERRUPTED) from None

    lines = summaries(rows)
    _print(lines)
    for name in names:
        tried = [row for row in rows if row.method == name]
        failed = [row for row in tried if row.verdict == ERROR]
        if failed:
            say(
                f"{name} failed on {len(failed)} of {len(tried)} trials, "
                f"the first time on {failed[0].pair}: {failed[0].reason}"
            )
    if out is not None:
        _write(out, rows, markdown_table(lines))


def _tolerances(texts: Sequence[str], sets: Sequence[Dataset]) -> dict[str, Tolerance]:
    """Read ``M,DEG`` (all data sets) and ``NAME=M,DEG`` (one, and stronger)."""
    from mapmeld.evaluation import Tolerance

    for_all: Tolerance | None = None
    named: dict[str, Tolerance] = {}
    for text in texts:
        name, equals, numbers = text.rpartition("=")
        try:
            metres, degrees = map(float, numbers.split(","))
            tolerance = Tolerance.of(metres, degrees)
        except ValueError as error:
            raise BenchmarkError(
                f"--tolerance needs metres and degrees, as 0.5,5 or house=0.5,5, not {text!r} ({error})"
            ) from error
        if equals:
            named[name] = tolerance
        else:
            for_all = tolerance
    return ({s.name: for_all for s in sets} if for_all else {}) | named


def _check_out(out: Path, force: bool) -> None:
    """Find out before the work that its outcome could not be kept."""
    from mapmeld.extras import required
    from mapmeld.io.folders import check_folder

    for module in ("pyarrow.parquet", "matplotlib.figure"):
        required(module, "benchmark")
    check_folder(out, force=force or (out / SETTINGS).is_file())


def _opened(out: Path, used: Mapping[str, object], force: bool) -> list[TrialRow]:
    """Write the settings of this run and return the rows of earlier ones."""
    import yaml

    from mapmeld.evaluation.rows import ERROR
    from mapmeld.evaluation.store import clear_rows, read_rows
    from mapmeld.io.atomic import write_files

    if force:
        clear_rows(out / ROWS)
    # What failed is tried again: a library that was missing may be there now.
    finished = [row for row in read_rows(out / ROWS) if row.verdict != ERROR]
    try:
        out.mkdir(exist_ok=True)
    except OSError as error:
        raise BenchmarkError(f"{out}: cannot be made: {error.strerror}") from error
    text = "# The run that table and plots beside this file show.\n"
    text += yaml.safe_dump(used, sort_keys=False, allow_unicode=True)
    write_files([(out / SETTINGS, [text.encode()])], force=True)
    return finished


def _write(out: Path, rows: Sequence[TrialRow], table: str) -> None:
    from mapmeld.cli.tables import print_files
    from mapmeld.evaluation.plots import FIGURES, write_figures
    from mapmeld.evaluation.store import gather_rows
    from mapmeld.io.atomic import write_files

    gather_rows(out / ROWS, rows)
    write_files([(out / TABLE, [table.encode()])], force=True)
    figures = write_figures(rows, out, force=True)
    for name in FIGURES:
        if out / name not in figures:
            (out / name).unlink(missing_ok=True)  # of an earlier run, which had something to draw
    print_files([out / ROWS, out / TABLE, *figures, out / SETTINGS])


def _print(lines: Sequence[Summary]) -> None:
    from rich.console import Console

    from mapmeld.evaluation import rich_table

    terminal = sys.stdout.isatty()
    # In files and pipes it is as wide as it needs to be: nothing is broken into two lines there.
    out = Console(highlight=False, width=None if terminal else 400)
    with out.capture() as captured:
        out.print(rich_table(lines, out.width if terminal else None))
    typer.echo("\n".join(line.rstrip() for line in captured.get().splitlines()))
