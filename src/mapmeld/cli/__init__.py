"""The command line: one thin file per command, and here what ties them together.

Nothing imported here imports NumPy or OpenCV, so that ``mapmeld --help`` is quick; each command
imports what it needs when it runs.
"""

from __future__ import annotations

import contextlib
import io
import sys
from typing import Annotated

import typer

from mapmeld import __version__
from mapmeld.cli.benchmark import benchmark
from mapmeld.cli.demo import demo
from mapmeld.cli.errors import Commands
from mapmeld.cli.explain import explain
from mapmeld.cli.match import match
from mapmeld.cli.merge import merge
from mapmeld.cli.show import show

__all__ = ["app", "main"]

app = typer.Typer(
    cls=Commands,
    help="Find how occupancy grid maps fit together, say how sure that is, and merge them.",
    epilog="Exit codes: 0 matched (all maps joined), 1 no acceptable match, 2 bad input or usage.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"mapmeld {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
) -> None:
    pass


for _command in (match, merge, show, explain, demo, benchmark):
    app.command()(_command)


def main() -> None:
    """Run the command line on ``sys.argv`` and exit."""
    for stream in (sys.stdout, sys.stderr):
        # File names may hold bytes that are no text; to print them must not fail.
        if isinstance(stream, io.TextIOWrapper):
            with contextlib.suppress(ValueError):
                stream.reconfigure(errors="backslashreplace")
    app(prog_name="mapmeld")
