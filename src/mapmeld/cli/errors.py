"""Known errors become one line on stderr and an exit code; unknown ones keep their traceback."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import typer
from typer.core import TyperGroup

from mapmeld.errors import MapmeldError

NO_MATCH = 1
BAD_INPUT = 2
INTERRUPTED = 130  # as shells count it: 128 + SIGINT

# The class that all complaints about the command line derive from, under the name by which it can be
# reached in every release of Typer.
_UsageError: type[Any] = typer.BadParameter.__mro__[1]


def say(message: str) -> None:
    """Print one line on stderr."""
    typer.echo(f"mapmeld: {' '.join(message.split())}", err=True)


class Commands(TyperGroup):
    """The group of commands, with one place for what goes wrong in any of them."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command that was asked for."""
        try:
            return super().invoke(ctx)
        except MapmeldError as error:
            say(str(error))
            raise typer.Exit(BAD_INPUT) from error
        except KeyboardInterrupt as error:
            say("interrupted, nothing more is written")
            raise typer.Exit(INTERRUPTED) from error

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
        except _UsageError as error:
            if type(error).__name__ == "NoArgsIsHelpError":  # carries the whole help instead of a line
                error.show()
            else:
                command = error.ctx.command_path if error.ctx else "mapmeld"
                say(f"{error.format_message().rstrip('.')} (see {command} --help)")
            code = BAD_INPUT
        except (typer.Abort, KeyboardInterrupt):
            code = INTERRUPTED
        if not standalone_mode:
            return code
        sys.exit(code if isinstance(code, int) else 0)
