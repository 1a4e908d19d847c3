"""Ctrl-C while machine code runs."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


def interruptible(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Let a compiled function raise KeyboardInterrupt when it was interrupted.

    numba returns its result although Python has an exception for it, for which Python raises SystemError
    in place of the KeyboardInterrupt that it then hides.
    """

    @wraps(function)
    def called(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
        try:
            return function(*args, **kwargs)
        except SystemError as error:
            if is_interruption(error):
                raise KeyboardInterrupt from error
            raise

    return called


def is_interruption(error: BaseException) -> bool:
    """Whether a KeyboardInterrupt is what led to an error."""
    seen: list[BaseException] = []
    waiting: list[BaseException | None] = [error]
    while waiting:
        found = waiting.pop()
        if found is None or found in seen:
            continue
        if isinstance(found, KeyboardInterrupt):
            return True
        seen.append(found)
        waiting += [found.__cause__, found.__context__]
    return False
