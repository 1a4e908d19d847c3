"""``--set help``: the settings of a method, for which no maps are needed."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import typer
from typer.core import TyperCommand

_SET, _METHOD, _HELP = "--set", "--method", "help"


class WithSettings(TyperCommand):
    """A command with ``--set``, and with ``--method`` unless it is of the paper's method alone."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Answer ``--set help`` before anything is found missing, wherever it stands."""
        if _HELP in _values(_SET, args):
            defaults = [str(option.default) for option in self.params if option.name == "method"]
            method = [*(defaults or ["alphabet"]), *_values(_METHOD, args)][-1]
            typer.echo(_settings(method), nl=False)
            raise typer.Exit
        return super().parse_args(ctx, args)


def _values(option: str, args: Sequence[str]) -> list[str]:
    """Return what stands behind an option, ``--option value`` or ``--option=value``, each time."""
    apart = [value for name, value in pairwise(args) if name == option]
    joined = [arg.partition("=")[2] for arg in args if arg.startswith(f"{option}=")]
    return apart + joined


def _settings(method: str) -> str:
    from mapmeld import __version__
    from mapmeld.cli.parameters import parameters_as_yaml
    from mapmeld.matching import method_named

    return parameters_as_yaml(method, method_named(method).parameters(), __version__)
