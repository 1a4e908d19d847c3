"""Recordings in the order of their time stamps, of which single ones may be wrong."""

from __future__ import annotations

import math
from collections import Counter
from typing import Generic, TypeVar

T = TypeVar("T")


class InOrder(Generic[T]):
    """Gives items on in the order of their stamps, one late.

    Each waits for the next one: if that is earlier than it, but later than the one before it, then the stamp
    of the waiting one is wrong, and it is left out. What else goes back in time is left out itself.

    Parameters
    ----------
    what
        The items' name ("a scan").
    left_out
        Counts what is left out.
    repeats
        Whether items may have the same stamp; else the first of them counts.
    """

    def __init__(self, what: str, left_out: Counter[str], *, repeats: bool = False) -> None:
        self._what, self._left_out, self._repeats = what, left_out, repeats
        self._before = -math.inf
        self._held: tuple[float, T] | None = None

    def add(self, stamp: float, item: T) -> list[tuple[float, T]]:
        """Take the next item; return what can be given on, with its stamp."""
        held = self._held
        if held is None:
            self._held = stamp, item
            return []
        if stamp > held[0] or (stamp == held[0] and self._repeats):
            self._held, self._before = (stamp, item), held[0]
            return [held]
        if self._before < stamp < held[0]:
            self._left_out[f"{self._what} with a time stamp later than that of the next one"] += 1
            self._held = stamp, item
        elif self._repeats:
            self._left_out[f"{self._what} that is older than the one before it"] += 1
        else:
            self._left_out[f"{self._what} that is no later than the one before it"] += 1
        return []

    def rest(self) -> list[tuple[float, T]]:
        """Return what still waits, when nothing follows."""
        held, self._held = self._held, None
        return [] if held is None else [held]
