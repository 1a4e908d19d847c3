"""Functions for workers, which import them by name."""

import os
import signal
import time
from pathlib import Path

import numpy as np


def add(a: int, b: int) -> int:
    return a + b


def where(_: object) -> int:
    return os.getpid()


def total(array: np.ndarray, factor: int) -> tuple[int, int, int]:
    """The sum, who computed it, and which object it was."""
    return int(array.sum()) * factor, os.getpid(), id(array)


def fall(number: int) -> int:
    if number == 2:
        raise ZeroDivisionError("over the edge")
    return number


def threads(_: object) -> str | None:
    return os.environ.get("OMP_NUM_THREADS")


def dies_once(number: int, mark: str) -> int:
    """The worker that gets number 3 first is gone."""
    if number == 3:
        try:
            Path(mark).touch(exist_ok=False)
        except FileExistsError:
            return number
        os._exit(9)
    return number


def dies(number: int) -> int:
    os._exit(9)


def slow(array: np.ndarray, number: int, log: str) -> int:
    """Say who works on what, in files that a test looks at, and take a while."""
    Path(log, f"{number}-{os.getpid()}-{time.monotonic_ns()}").touch()
    time.sleep(0.1)
    return number + int(array[0])


prepared: list[int] = []


def prepare() -> None:
    prepared.append(os.getpid())


def times_prepared(_: object) -> int:
    return len(prepared)


def deaf(_: object) -> tuple[bool, bool]:
    """Whether the process began with interruptions held back, and ignores them."""
    held_back = signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, [])
    return held_back, signal.getsignal(signal.SIGINT) is signal.SIG_IGN
