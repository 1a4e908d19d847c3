"""All commands put together, and one place for what goes wrong in any of them.

Nothing imported here imports NumPy or OpenCV, so that ``mapmeld --help`` is quick; each command
imports what it needs when it runs.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from mapmeld import __version__
from mapmeld.cli.bag import bag
from mapmeld.cli.benchmark import benchmark
from mapmeld.cli.demo import demo
from mapmeld.cli.diff import diff
from mapmeld.cli.environment import environment
from mapmeld.cli.errors import BAD_INPUT, CLOSED_PIPE, FAULT, INTERRUPTED, NO_MATCH, say
from mapmeld.cli.explain import explain
from mapmeld.cli.find import find
from mapmeld.cli.follow import follow
from mapmeld.cli.graph import graph
from mapmeld.cli.index import index
from mapmeld.cli.match import match
from mapmeld.cli.merge import merge
from mapmeld.cli.navigability import navigability
from mapmeld.cli.rebase import rebase
from mapmeld.cli.reproduce import reproduce
from mapmeld.cli.ros import ros
from mapmeld.cli.settings_help import WithSettings
from mapmeld.cli.show import show
from mapmeld.cli.simulate import simulate
from mapmeld.cli.slam import slam
from mapmeld.cli.transform_points import transform_points
from mapmeld.errors import MapmeldError

# The class that all complaints about the command line derive from, under the name by which it can be
# reached in every release of Typer.
_UsageError: type[Any] = typer.BadParameter.__mro__[1]


@contextmanager
def _interruption_said() -> Iterator[None]:
    """Turn Ctrl-C into a line and an exit code; Typer itself would say nothing."""
    try:
        yield
    except KeyboardInterrupt as error:
        say("interrupted, nothing more is written")
        raise typer.Exit(INTERRUPTED) from error


class Commands(TyperGroup):
    """The group of commands; known errors become one line on stderr and an exit code."""

    def make_context(self, *args: Any, **kwargs: Any) -> Any:
        """Read the command line as far as the name of the command."""
        with _interruption_said():
            return super().make_context(*args, **kwargs)

    def invoke(self, ctx: Any) -> Any:
        """Run the command that was asked for."""
        try:
            with _interruption_said():
                return super().invoke(ctx)
        except MapmeldError as error:
            say(str(error).replace(" force=True ", " --force "))  # as it is written here
            raise typer.Exit(BAD_INPUT) from error

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        windows_expand_args: bool = True,
        **extra: Any,
    ) -> Any:
        """Parse the command line and run it; usage errors are one line too."""
        try:
            code = super().main(args, prog_name, complete_var, False, windows_expand_args, **extra)
            sys.stdout.flush()
        except _UsageError as error:
            if type(error).__name__ == "NoArgsIsHelpError":  # carries the whole help instead of a line
                error.show()
            else:
                command = error.ctx.command_path if error.ctx else "mapmeld"
                say(f"{_complaint(error)} (see {command} --help)")
            code = BAD_INPUT
        except typer.Abort:
            code = INTERRUPTED
        except BrokenPipeError:
            code = CLOSED_PIPE
        except SystemExit as leaving:
            # What Typer and rich do about a closed pipe; their exit code would mean "no match".
            if not isinstance(leaving.__context__, BrokenPipeError):
                raise
            code = CLOSED_PIPE
        except OSError as error:
            if not _stdout_refuses():
                raise
            say(f"standard output cannot be written: {error.strerror or error}")
            code = BAD_INPUT
        code = code if isinstance(code, int) else 0
        if not standalone_mode:
            return code
        sys.exit(code)


def _complaint(error: Any) -> str:
    """Return what a usage error says, without the phrases of Typer's library for checking values."""
    text = str(error.format_message()).rstrip(".").replace("Value error, ", "")
    details = getattr(error.__cause__, "errors", None)
    if details is not None and "Input should be" in text:
        text = re.sub(r"Input should be (.*?)(, unable to .*)?$", r"should be \1", text)
        text += f", not {details()[0].get('input')!r}"
    return text


def _stdout_refuses() -> bool:
    """Whether it was stdout that could not be written (its disk is full, say), and not anything else."""
    try:
        sys.stdout.flush()
    except OSError:
        return True  # still holds what it could not write
    return False


app = typer.Typer(
    cls=Commands,
    help="Find how occupancy grid maps fit together, say how sure that is, and merge them.",
    epilog=f"Exit codes: 0 matched (all maps joined), {NO_MATCH} no acceptable match, "
    f"{BAD_INPUT} bad input or usage, or the output cannot be written, {FAULT} a fault in mapmeld itself, "
    f"{INTERRUPTED} interrupted, {CLOSED_PIPE} nobody reads the output any more.",
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


_TAKES_SETTINGS: tuple[Callable[..., None], ...] = (
    match, merge, graph, find, follow, diff, rebase, transform_points, show, explain,
)  # fmt: skip
_OTHERS: tuple[Callable[..., None], ...] = (
    index, navigability, demo, benchmark, environment, simulate, slam, reproduce,
)  # fmt: skip

for _command in _TAKES_SETTINGS:
    app.command(cls=WithSettings)(_command)
for _command in _OTHERS:
    app.command()(_command)
app.command(context_settings={"allow_extra_args": True, "ignore_unknown_options": True})(ros)
app.add_typer(bag)
