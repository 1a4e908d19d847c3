"""The interface to whatever runs jobs: this process, a pool of processes, or a Dask cluster."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Generator, Sequence
from typing import TypeVar

from mapmeld.parallel.job import Job, filled

R = TypeVar("R")


def run_jobs(
    function: Callable[..., R],
    jobs: Sequence[Job],
    *,
    shared: Sequence[object] = (),
    workers: int = 0,
    cluster: str | None = None,
    prepare: Callable[[], object] | None = None,
) -> Generator[tuple[int, R]]:
    """Yield the number and the result of every job as it is done, each once, in any order.

    Jobs are independent of one another; what a lost worker had not finished is run again elsewhere.
    Closing the generator ends the work. Everything that is sent is pickled.

    Parameters
    ----------
    function
        Called with the arguments of each job; defined at the top of a module.
    jobs
        Their arguments.
    shared
        Objects that many jobs need (`Shared`). Each worker is sent each of them once, not per job.
    workers
        0 runs everything in this process. More are processes of this machine, of one thread each. They
        are started afresh and import the program that calls this, so in a script the call belongs
        under ``if __name__ == "__main__"``.
    cluster
        Address of a Dask scheduler (extra ``dask``), in place of `workers`.
    prepare
        Called once in every process before its first job.

    Raises
    ------
    WorkerDiedError
        Workers died (killed, out of memory, crashed inside a library) more than twice.
    ClusterError
        There is no scheduler at that address, it has no workers, or it went away.
    MissingExtraError
        The libraries for a cluster are not installed.
    Exception
        Whatever `function` raised.
    """
    if workers < 0:
        raise ValueError(f"the number of workers cannot be negative, as {workers} is")
    if not jobs:
        return
    if cluster is not None:
        from mapmeld.parallel.cluster import run_on_cluster

        running = run_on_cluster(function, jobs, shared, cluster, prepare)
    elif workers:
        from mapmeld.parallel.local import run_in_pool

        running = run_in_pool(function, jobs, shared, min(workers, len(jobs)), prepare)
    else:
        running = _run_here(function, jobs, shared, prepare)
    with contextlib.closing(running):
        yield from running


def _run_here(
    function: Callable[..., R],
    jobs: Sequence[Job],
    shared: Sequence[object],
    prepare: Callable[[], object] | None,
) -> Generator[tuple[int, R]]:
    if prepare:
        prepare()
    for number, job in enumerate(jobs):
        yield number, function(*filled(job, shared))
