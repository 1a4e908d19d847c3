"""Libraries that are extras, imported where they are used."""

from __future__ import annotations

import importlib
from typing import Any

from mapmeld.errors import MapmeldError


class MissingExtraError(MapmeldError):
    """A library of an extra is not installed."""


def required(module: str, extra: str) -> Any:
    """Import a module that comes with an extra.

    Raises
    ------
    MissingExtraError
        It is not installed; the message has the command that installs it.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        library = module.partition(".")[0]
        raise MissingExtraError(
            f'{library} is needed for this and cannot be imported ({error}): pip install "mapmeld[{extra}]"'
        ) from error
