"""Jobs in a pool of processes of this machine."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import Any, TypeVar

from mapmeld.parallel.job import RESTARTS, Job, WorkerDiedError, filled

R = TypeVar("R")

# Read by the numeric libraries when they are loaded, so they must be there before a worker starts.
_THREAD_SETTINGS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)

_shared: Sequence[object] = ()


def run_in_pool(
    function: Callable[..., R],
    jobs: Sequence[Job],
    shared: Sequence[object],
    workers: int,
    prepare: Callable[[], object] | None,
) -> Generator[tuple[int, R]]:
    """As `mapmeld.parallel.run_jobs`, by so many processes."""
    waiting = dict(enumerate(jobs))
    for _ in range(RESTARTS + 1):
        # "spawn" because a fork of a process with threads (progress display, OpenCV) can deadlock.
        context = multiprocessing.get_context("spawn")
        pool = ProcessPoolExecutor(workers, context, _start_worker, (shared, prepare))
        whole = False
        try:
            futures = _submitted(pool, function, waiting)
            for future in as_completed(futures):
                try:
                    result = future.result()
                except BrokenProcessPool:
                    continue  # what others had finished by then is still to come
                del waiting[futures[future]]
                yield futures[future], result
            whole = not waiting
        finally:
            if not whole:
                # After an interruption nobody wants to wait for the jobs that are under way.
                for process in list((pool._processes or {}).values()):
                    process.terminate()
            pool.shutdown(wait=True, cancel_futures=True)
        if not waiting:
            return
    raise WorkerDiedError(
        "worker processes died again and again (out of memory, or a crash in a library); "
        "run the same again to continue, with fewer workers if memory is short"
    )


def _submitted(
    pool: ProcessPoolExecutor, function: Callable[..., R], waiting: dict[int, Job]
) -> dict[Future[R], int]:
    futures: dict[Future[R], int] = {}
    # It is here that workers are started.
    with one_thread_each(), _not_to_be_interrupted(), contextlib.suppress(BrokenProcessPool):
        for number, job in waiting.items():
            futures[pool.submit(_call, function, job)] = number
    return futures


def _call(function: Callable[..., R], job: Job) -> R:
    return function(*filled(job, _shared))


@contextlib.contextmanager
def one_thread_each() -> Iterator[None]:
    """Let the numeric libraries of processes that are started meanwhile use one thread."""
    before = {name: os.environ.get(name) for name in _THREAD_SETTINGS}
    os.environ.update(dict.fromkeys(_THREAD_SETTINGS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextlib.contextmanager
def _not_to_be_interrupted() -> Iterator[None]:
    """Hold Ctrl-C back from this process, and from the processes that it starts meanwhile.

    It reaches the whole group of processes. A worker that has not come to `_start_worker` yet would
    say, with a traceback, that it was interrupted: so it inherits a mask. This process may have more
    threads, and any of them may take the signal: so its handler only remembers that it came.
    """
    if not hasattr(signal, "pthread_sigmask") or threading.current_thread() is not threading.main_thread():
        yield  # not POSIX, or a thread that Ctrl-C does not interrupt
        return
    came: list[int] = []
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    handler = signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)  # what the mask held back comes now
        signal.signal(signal.SIGINT, handler)
        if came:
            signal.raise_signal(signal.SIGINT)


def _start_worker(shared: Sequence[object], prepare: Callable[[], Any] | None) -> None:
    global _shared
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends the workers
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _shared = shared
    if prepare:
        prepare()


def _end_with_parent() -> None:
    """Leave when the parent is gone: a worker that waits for its next job would wait for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
