"""How long the node's callbacks take."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

import numpy as np

F = TypeVar("F", bound=Callable[..., Any])


class Latencies:
    """Durations [s] of the last calls of any function that is `timed`, and the longest ever.

    `busiest` is the longest processor time of a call: what is left of a duration without it, the
    machine gave to others.
    """

    def __init__(self, kept: int = 5000) -> None:
        self._last: deque[float] = deque(maxlen=kept)
        self.longest = self.busiest = 0.0
        self.longest_of: dict[str, float] = {}
        self.count = 0

    def add(self, seconds: float) -> None:
        """Take a duration."""
        self._last.append(seconds)
        self.longest = max(self.longest, seconds)
        self.count += 1

    def percentile(self, percent: float) -> float:
        """Return that percentile of the last durations; 0 if there are none."""
        return float(np.percentile(list(self._last), percent)) if self._last else 0.0

    def timed(self, function: F) -> F:
        """Return the function with its calls measured."""

        @wraps(function)
        def measured(*args: Any, **kwargs: Any) -> Any:
            begun, busy = time.perf_counter(), time.thread_time()
            try:
                return function(*args, **kwargs)
            finally:
                took = time.perf_counter() - begun
                self.add(took)
                self.busiest = max(self.busiest, time.thread_time() - busy)
                name = function.__name__
                self.longest_of[name] = max(self.longest_of.get(name, 0.0), took)

        return measured  # type: ignore[return-value]
