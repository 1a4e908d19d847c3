"""Jobs on a Dask cluster, through its `concurrent.futures` interface."""

from __future__ import annotations

import contextlib
import logging
import secrets
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import CancelledError, Future, as_completed
from typing import Any, TypeVar

from mapmeld.errors import MapmeldError
from mapmeld.extras import required
from mapmeld.parallel.job import RESTARTS, Job, Shared, WorkerDiedError

R = TypeVar("R")

_PATIENCE = 15  # [s] for a scheduler to answer, and for a first worker


class ClusterError(MapmeldError):
    """A Dask cluster that cannot be reached or has nobody to work."""


def run_on_cluster(
    function: Callable[..., R],
    jobs: Sequence[Job],
    shared: Sequence[object],
    address: str,
    prepare: Callable[[], object] | None,
) -> Generator[tuple[int, R]]:
    """As `mapmeld.parallel.run_jobs`, by the workers of the scheduler at `address`.

    They must have mapmeld installed, in the same version.
    """
    distributed = required("distributed", "dask")
    waiting, run = dict(enumerate(jobs)), secrets.token_hex(8)
    with _connected(distributed, address) as client:
        for _ in range(RESTARTS + 1):
            # On every worker at once, so that one that dies is not the only one to have it.
            sent = _sent(client, shared, address)
            executor = client.get_executor(pure=False)
            try:
                futures: dict[Future[R], int] = {
                    executor.submit(
                        _call,
                        function,
                        prepare,
                        run,
                        *(sent[part.number] if isinstance(part, Shared) else part for part in job),
                    ): number
                    for number, job in waiting.items()
                }
                for future in as_completed(futures):
                    try:
                        result = future.result()
                    except CancelledError:
                        continue  # a worker took with it what only it had been sent
                    except distributed.scheduler.KilledWorker as error:  # several times, on this job
                        raise _died(address) from error
                    del waiting[futures[future]]
                    yield futures[future], result
            finally:
                with contextlib.suppress(OSError, TimeoutError):
                    executor.shutdown(wait=False)
            if not waiting:
                return
            if client.status != "running":
                raise ClusterError(f"{address}: the Dask scheduler went away")
    raise _died(address)


def _died(address: str) -> WorkerDiedError:
    return WorkerDiedError(
        f"{address}: workers died again and again (out of memory, or a crash in a library); "
        "run the same again to continue"
    )


@contextlib.contextmanager
def _connected(distributed: Any, address: str) -> Iterator[Any]:
    """Give a client; what it would log of a lost connection is said in our own words."""
    log = logging.getLogger("distributed.client")
    before = log.level
    log.setLevel(logging.CRITICAL)
    try:
        client = _client(distributed, address)
        try:
            yield client
        finally:
            with contextlib.suppress(OSError, TimeoutError):
                client.close(timeout=5)
    finally:
        log.setLevel(before)


def _client(distributed: Any, address: str) -> Any:
    try:
        client = distributed.Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise ClusterError(
            f"{address}: no Dask scheduler answers there ({' '.join(str(error).split())[:120]}); "
            "start one with: dask scheduler"
        ) from error
    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
    except TimeoutError as error:
        client.close(timeout=5)
        raise ClusterError(
            f"{address}: the Dask scheduler has no workers; "
            f"start some with: dask worker {address} --nthreads 1"
        ) from error
    return client


def _sent(client: Any, shared: Sequence[object], address: str) -> Sequence[Any]:
    if not shared:
        return ()
    try:
        sent: Sequence[Any] = client.scatter(list(shared), broadcast=True, hash=False)
    except TimeoutError as error:
        raise ClusterError(f"{address}: no worker takes what it is sent") from error
    return sent


_prepared: set[str] = set()


def _call(function: Callable[..., R], prepare: Callable[[], object] | None, run: str, *job: Any) -> R:
    if prepare and run not in _prepared:
        prepare()
        _prepared.add(run)
    return function(*job)
