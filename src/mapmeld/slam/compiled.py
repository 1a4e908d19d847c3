"""Functions that are translated to machine code when they are first called."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

from mapmeld.extras import required

Function = TypeVar("Function", bound=Callable[..., object])


def compiled(function: Function) -> Function:
    """Have numba compile a function at its first call, and keep the result on disk for later runs.

    Functions that call one another have to stay in one file: what is kept on disk is renewed when
    the file of the caller changes, not when that of the called one does.
    """
    return cast(Function, required("numba", "sim").njit(cache=True)(function))
