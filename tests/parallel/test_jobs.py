import multiprocessing
import os
import signal
import threading
from pathlib import Path
from typing import Any

import job_functions as functions
import numpy as np
import pytest

from mapmeld.parallel import Shared, WorkerDiedError, local, run_jobs

WORKERS = pytest.mark.parametrize("workers", [0, 1, 2])


@pytest.fixture(autouse=True)
def _workers_find_the_functions(monkeypatch: pytest.MonkeyPatch) -> None:
    here = str(Path(__file__).parent)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([here, os.environ.get("PYTHONPATH", "")]))


def results(*args: Any, **options: Any) -> dict[int, Any]:
    found: dict[int, Any] = {}
    for number, result in run_jobs(*args, **options):
        assert number not in found, "each job once"
        found[number] = result
    return found


@WORKERS
def test_every_job_is_done_once(workers: int) -> None:
    jobs = [(n, 2 * n) for n in range(7)]
    assert results(functions.add, jobs, workers=workers) == {n: 3 * n for n in range(7)}


@WORKERS
def test_no_jobs(workers: int) -> None:
    assert results(functions.add, [], workers=workers) == {}


@WORKERS
def test_shared_objects_are_put_in_their_places(workers: int) -> None:
    shared = [np.arange(3), np.arange(5)]
    jobs = [(Shared(k), factor) for k in (0, 1, 0, 1) for factor in (1, 2)]
    found = results(functions.total, jobs, shared=shared, workers=workers)
    assert [found[n][0] for n in range(8)] == [3, 6, 10, 20] * 2


def test_a_worker_is_sent_each_object_once_not_per_job() -> None:
    shared = [np.arange(1000), np.arange(2000)]
    jobs = [(Shared(k % 2), k) for k in range(40)]
    found = results(functions.total, jobs, shared=shared, workers=2)
    objects = {(worker, k % 2): set() for k, (_, worker, _) in found.items()}  # type: ignore[var-annotated]
    for k, (_, worker, identity) in found.items():
        objects[worker, k % 2].add(identity)
    assert all(len(identities) == 1 for identities in objects.values())


def test_nothing_leaves_the_process_without_workers() -> None:
    assert set(results(functions.where, [(1,), (2,)]).values()) == {os.getpid()}
    elsewhere = set(results(functions.where, [(1,), (2,)], workers=1).values())
    assert len(elsewhere) == 1
    assert elsewhere != {os.getpid()}


def test_workers_have_one_thread_each_and_the_caller_keeps_its_own() -> None:
    before = dict(os.environ)
    assert set(results(functions.threads, [(1,)], workers=1).values()) == {"1"}
    assert dict(os.environ) == before


@WORKERS
def test_what_a_job_raises_is_raised(workers: int) -> None:
    with pytest.raises(ZeroDivisionError, match="over the edge"):
        results(functions.fall, [(n,) for n in range(4)], workers=workers)
    assert multiprocessing.active_children() == []


@pytest.mark.parametrize("workers", [0, 1])
def test_prepare_is_called_once_before_the_first_job(workers: int) -> None:
    functions.prepared.clear()
    found = results(functions.times_prepared, [(1,), (2,)], workers=workers, prepare=functions.prepare)
    assert found == {0: 1, 1: 1}


def test_a_worker_that_dies_loses_no_result(tmp_path: Path) -> None:
    jobs = [(n, str(tmp_path / "died")) for n in range(8)]
    assert results(functions.dies_once, jobs, workers=2) == {n: n for n in range(8)}
    assert (tmp_path / "died").exists()


def test_a_job_that_kills_every_worker_is_an_end() -> None:
    with pytest.raises(WorkerDiedError, match="again and again"):
        results(functions.dies, [(n,) for n in range(3)], workers=1)


def test_leaving_early_ends_the_workers() -> None:
    running = run_jobs(functions.add, [(n, n) for n in range(50)], workers=2)
    next(running)
    running.close()
    assert multiprocessing.active_children() == []


def test_a_negative_number_of_workers() -> None:
    with pytest.raises(ValueError, match="cannot be negative"):
        next(run_jobs(functions.add, [(1, 1)], workers=-1))


# ---------------------------------------------------------------------- Ctrl-C
posix = pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="signals as POSIX has them")


@posix
@pytest.mark.parametrize("other_threads", [0, 8])
def test_an_interruption_while_workers_start_waits_until_they_have(other_threads: int) -> None:
    shown: list[str] = []
    over = threading.Event()
    others = [threading.Thread(target=over.wait) for _ in range(other_threads)]

    def start() -> None:
        with local._not_to_be_interrupted():
            os.kill(os.getpid(), signal.SIGINT)  # any thread of the process may take it
            shown.append("went on")

    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # what runs the tests may ignore it
    try:
        for other in others:
            other.start()
        with pytest.raises(KeyboardInterrupt):
            start()
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        over.set()
        signal.signal(signal.SIGINT, before)
    assert shown == ["went on"]
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])


@posix
def test_a_mask_that_was_there_before_stays() -> None:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGUSR1})
    try:
        with local._not_to_be_interrupted():
            pass
        assert signal.pthread_sigmask(signal.SIG_BLOCK, []) == {*before, signal.SIGINT, signal.SIGUSR1}
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@posix
def test_workers_never_take_an_interruption_not_even_before_they_are_ready() -> None:
    """The mask is what they start with; before that there is nothing in them that could be interrupted."""
    assert set(results(functions.deaf, [(1,), (2,)], workers=2).values()) == {(True, True)}
