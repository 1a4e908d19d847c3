"""Warnings that are said once, and again only after a while."""

from __future__ import annotations

from collections.abc import Callable

AGAIN = 60.0
"""[s]"""


class Throttle:
    """Says a sentence about something at most once in `AGAIN` seconds, and then how often it was kept back.

    Parameters
    ----------
    say
        Takes a sentence.
    clock
        Seconds that only go forward.
    """

    def __init__(self, say: Callable[[str], object], clock: Callable[[], float]) -> None:
        self._say, self._clock = say, clock
        self._said: dict[str, tuple[float, int]] = {}

    def __call__(self, about: str, sentence: str) -> None:
        """Say it, or count it."""
        now = self._clock()
        when, kept_back = self._said.get(about, (-AGAIN, 0))
        if now - when < AGAIN:
            self._said[about] = (when, kept_back + 1)
            return
        self._said[about] = (now, 0)
        self._say(f"{sentence} (and {kept_back} times before)" if kept_back else sentence)
