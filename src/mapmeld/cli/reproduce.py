"""``mapmeld reproduce -o DIR``."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mapmeld.cli.errors import INTERRUPTED, say
from mapmeld.cli.options import Cluster
from mapmeld.cli.simulation_options import Seed, Size

if TYPE_CHECKING:
    from mapmeld.experiment import Results

PAPER, DEFAULT = "paper", "default"


def reproduce(
    out: Annotated[
        Path,
        typer.Option(
            "-o", "--out", metavar="DIR", help="Folder of the experiment; one that was interrupted goes on."
        ),
    ],
    environments: Annotated[
        int, typer.Option(metavar="N", help="Environments to draw (the paper: 10).")
    ] = 10,
    mappings: Annotated[int, typer.Option(metavar="N", help="Mappings of each (the paper: 5).")] = 5,
    seed: Seed = 0,
    method: Annotated[
        list[str] | None,
        typer.Option(
            "--method",
            metavar="NAME",
            help="How to match: paper, default, or a method of 'mapmeld match'; may be repeated. "
            "Both, paper and default, if none is named.",
        ),
    ] = None,
    size: Size = None,
    rooms: Annotated[
        int | None, typer.Option(metavar="N", min=0, help="Rooms to draw in each (10 if not given).")
    ] = None,
    common: Annotated[
        float | None,
        typer.Option(
            metavar="PART",
            help="Part of the floor that all mappings of an environment drive through (0.35 if not given).",
        ),
    ] = None,
    share: Annotated[
        float | None,
        typer.Option(
            metavar="PART", help="Part of the floor that each mapping drives through (0.65 if not given)."
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            metavar="N", min=1, help="Processes, of one thread each; as many as there are cores if not given."
        ),
    ] = None,
    cluster: Cluster = None,
    force: Annotated[
        bool, typer.Option("--force", help="Throw away the experiment in DIR and begin it anew.")
    ] = False,
) -> None:
    """Repeat the paper's experiment from nothing: environments, robots, SLAM, matchings, report.

    Everything is drawn and driven by chance from one seed and judged by the known truth. What is done is
    kept as it is done: the same command goes on where the last run stopped. Look at DIR/report.html.
    """
    from dataclasses import replace

    from mapmeld.extras import required

    # Before what imports them, which asks for them in the name of other extras.
    for module in ("numba", "matplotlib.figure"):
        required(module, "reproduce")

    from mapmeld.cli.progress import counting, working
    from mapmeld.cli.simulation_options import sides
    from mapmeld.cli.tables import print_files
    from mapmeld.experiment import ExperimentSettings, run_experiment
    from mapmeld.experiment.pages.report import RESULTS, write_report
    from mapmeld.experiment.settings import PAPER_METHOD
    from mapmeld.matching import DEFAULT_METHOD
    from mapmeld.matching.match import METHODS
    from mapmeld.simulation import Settings

    names = {PAPER: PAPER_METHOD, DEFAULT: DEFAULT_METHOD}
    for name in method or ():
        if name not in names and name not in METHODS:
            there = ", ".join((*names, *METHODS))
            raise typer.BadParameter(f"no method {name!r} (there are: {there})", param_hint="--method")
    place = Settings()
    if size is not None:
        width, height = sides(size)
        place = replace(place, width=width, height=height)
    if rooms is not None:
        place = replace(place, configuration=replace(place.configuration, rooms=rooms))
    settings = ExperimentSettings(
        environments=environments,
        mappings=mappings,
        seed=seed,
        methods=tuple(names.get(name, name) for name in method or (PAPER, DEFAULT)),
        place=place,
    )
    settings = replace(
        settings,
        common=settings.common if common is None else common,
        share=settings.share if share is None else share,
    )
    count = workers or _cores()
    try:
        results = run_experiment(
            out,
            settings,
            force=force,
            workers=0 if count == 1 else count,
            cluster=cluster,
            progress=counting,
        )
        with working("Writing the report"):
            report = write_report(out, results)
    except KeyboardInterrupt:
        say(f"interrupted; what was done is in {out}, the same command goes on from there")
        raise typer.Exit(INTERRUPTED) from None
    _print(results)
    print_files([report, out / RESULTS])


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))  # those that this process may use
    return os.cpu_count() or 1


def _print(results: Results) -> None:
    from rich.table import Table

    from mapmeld.cli.tables import print_table
    from mapmeld.experiment.statistics import (
        PAPER_MATCHED,
        PAPER_MATCHINGS,
        PAPER_SINGLE,
        PAPER_SUCCESSES,
        Successes,
        method_label,
        table_1,
    )

    table = Table(title="Accuracy by Equation 3, and successes")
    for heading in ("", "mean", "median", "std. dev.", "right", "accepted and wrong"):
        table.add_column(heading, justify="right" if heading else "left")
    ours = table_1(results)
    of_paper = f"{PAPER_SUCCESSES} of {PAPER_MATCHINGS}"
    for name, column, right, wrong in (
        ("the paper's GMapping", PAPER_SINGLE, "", ""),
        ("our GMapping", ours[""], "", ""),
        ("the paper's matchings", PAPER_MATCHED, of_paper, ""),
        *(
            (
                f"our matchings, {method_label(method)}",
                ours[method],
                f"{s.right} of {s.total}",
                str(s.accepted_wrong),
            )
            for method in results.methods
            for s in [Successes.of(results.matchings_of(method))]
        ),
    ):
        figures = (column.mean, column.median, column.deviation)
        table.add_row(name, *("-" if f is None else f"{f:.6f}" for f in figures), right, wrong)
    print_table(table)
