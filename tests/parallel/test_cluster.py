"""A real scheduler and real workers, as processes of their own on loopback."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from typing import Any

import job_functions as functions
import numpy as np
import pyarrow.parquet  # type: ignore[import-untyped]
import pytest
from drawing import office, seen_from

pytest.importorskip("distributed")

from mapmeld.fingerprint import grid_digest
from mapmeld.merging.graph import match_all_pairs
from mapmeld.parallel import Shared, WorkerDiedError, run_jobs
from mapmeld.parallel.cluster import ClusterError
from mapmeld.se2 import Pose2

PATIENCE = 60


class Cluster:
    """A scheduler and workers; everything that is started here is ended here."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        here = Path(__file__).parent
        path = os.pathsep.join([str(here), str(here.parents[1] / "src"), os.environ.get("PYTHONPATH", "")])
        self.environment = {**os.environ, "PYTHONPATH": path, "DASK_DISTRIBUTED__WORKER__DAEMON": "False"}
        self.processes: list[subprocess.Popen[bytes]] = []
        found = folder / "scheduler.json"
        self.start(
            "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", found
        )
        self.address = self.address_in(found)

    def start(self, what: str, *arguments: object) -> subprocess.Popen[bytes]:
        log = (self.folder / f"{what}-{len(self.processes)}.log").open("wb")
        process = subprocess.Popen(
            [sys.executable, "-m", "distributed.cli.dask_" + what, *map(str, arguments)],
            env=self.environment,
            stdout=log,
            stderr=subprocess.STDOUT,
            cwd=self.folder,
        )
        log.close()
        self.processes.append(process)
        return process

    def worker(self) -> subprocess.Popen[bytes]:
        # Without a nanny: what is killed stays dead.
        options = ("--nthreads", 1, "--no-nanny", "--no-dashboard", "--host", "127.0.0.1")
        return self.start("worker", self.address, *options)

    def address_in(self, file: Path) -> str:
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            try:
                return str(json.loads(file.read_text())["address"])
            except (OSError, ValueError):
                time.sleep(0.05)
        raise TimeoutError((self.folder / "scheduler-0.log").read_text())

    def wait_for(self, count: int) -> None:
        from distributed import Client

        with Client(self.address, set_as_default=False) as client:  # type: ignore[no-untyped-call]
            client.wait_for_workers(count, timeout=PATIENCE)

    def end(self) -> None:
        for process in reversed(self.processes):
            process.kill()
            process.wait()


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    running = Cluster(tmp_path)
    try:
        yield running
    finally:
        running.end()


def results(cluster: Cluster, function: Any, jobs: list[tuple[Any, ...]], **options: Any) -> dict[int, Any]:
    found: dict[int, Any] = {}
    for number, result in run_jobs(function, jobs, cluster=cluster.address, **options):
        assert number not in found, "each job once"
        found[number] = result
    return found


def test_jobs_on_a_cluster(cluster: Cluster) -> None:
    cluster.worker()
    cluster.worker()
    cluster.wait_for(2)
    shared = [np.arange(1000), np.arange(2000)]
    jobs: list[tuple[Any, ...]] = [(Shared(k % 2), k) for k in range(40)]
    found = results(cluster, functions.total, jobs, shared=shared)
    sums = [int(array.sum()) for array in shared]
    assert [found[k][0] for k in range(40)] == [sums[k % 2] * k for k in range(40)]
    # Every worker has one object of each array, however many jobs used it.
    objects = Counter(worker for worker, _ in {(worker, identity) for _, worker, identity in found.values()})
    assert set(objects.values()) <= {1, 2}

    with pytest.raises(ZeroDivisionError, match="over the edge"):
        results(cluster, functions.fall, [(n,) for n in range(4)])
    # The cluster serves the next run.
    assert results(cluster, functions.add, [(1, 2)]) == {0: 3}
    prepared = results(cluster, functions.times_prepared, [(n,) for n in range(6)], prepare=functions.prepare)
    assert set(prepared.values()) == {1}


def test_a_killed_worker_loses_no_result(cluster: Cluster, tmp_path: Path) -> None:
    """Two workers, one of which is killed in the middle: every result is there, and there once."""
    log = tmp_path / "log"
    log.mkdir()
    victim, other = cluster.worker(), cluster.worker()
    cluster.wait_for(2)
    shared = [np.array([1000])]
    jobs = [(Shared(0), number, str(log)) for number in range(60)]
    found: dict[int, int] = {}
    killed_at = None
    for number, result in run_jobs(functions.slow, jobs, cluster=cluster.address, shared=shared):
        assert number not in found
        found[number] = result
        worked = {int(name.name.split("-")[1]) for name in log.iterdir()}
        if killed_at is None and len(found) >= 15 and victim.pid in worked:
            victim.send_signal(signal.SIGKILL)
            victim.wait()
            killed_at = len(found)
    assert killed_at is not None
    assert killed_at < 60
    assert found == {number: 1000 + number for number in range(60)}
    # Both had worked, and the survivor did what the other had not finished.
    started = Counter(int(name.name.split("-")[1]) for name in log.iterdir())
    assert set(started) == {victim.pid, other.pid}
    assert started[victim.pid] < 60


def test_maps_are_matched_and_stored_once_each_though_a_worker_is_killed(
    cluster: Cluster, tmp_path: Path
) -> None:
    victim, _ = cluster.worker(), cluster.worker()
    cluster.wait_for(2)
    grid = office(0.2)
    maps = [seen_from(grid, Pose2(n, -n, n / 2)) for n in range(9)]
    done: list[int] = []

    def kill_in_the_middle() -> None:
        done.append(1)
        if len(done) == 6:
            victim.send_signal(signal.SIGKILL)
            victim.wait()

    store = tmp_path / "pairs"
    found = match_all_pairs(maps, cluster=cluster.address, store=store, on_pair=kill_in_the_middle)
    assert [(i, j) for i, j, _ in found] == list(combinations(range(9), 2))
    assert len(done) == len(found)
    stored = pyarrow.parquet.read_table(store)
    assert stored.num_rows == len(found)
    digests = [grid_digest(grid).hex() for grid in maps]
    pairs = set(zip(stored["map_a"].to_pylist(), stored["map_b"].to_pylist(), strict=True))
    assert pairs == set(combinations(digests, 2))
    for (_, _, there), (_, _, here) in zip(found[:3], match_all_pairs(maps[:4])[:3], strict=True):
        assert there.T_a_b == here.T_a_b


def test_the_only_worker_that_had_the_maps_is_killed_and_another_comes(
    cluster: Cluster, tmp_path: Path
) -> None:
    log = tmp_path / "log"
    log.mkdir()
    victim = cluster.worker()
    cluster.wait_for(1)
    jobs = [(Shared(0), number, str(log)) for number in range(30)]
    found: dict[int, int] = {}
    for number, result in run_jobs(functions.slow, jobs, cluster=cluster.address, shared=[np.array([1000])]):
        assert number not in found
        found[number] = result
        if len(found) == 5:
            victim.send_signal(signal.SIGKILL)
            victim.wait()
            cluster.worker()
    assert found == {number: 1000 + number for number in range(30)}


def test_a_job_that_kills_every_worker_is_an_end(cluster: Cluster) -> None:
    # A nanny starts a new worker for each that dies.
    options = ("--nthreads", 1, "--no-dashboard", "--host", "127.0.0.1")
    cluster.start("worker", cluster.address, *options)
    cluster.wait_for(1)
    with pytest.raises(WorkerDiedError, match="again and again"):
        results(cluster, functions.dies, [(1,)])


def test_a_scheduler_that_goes_away_is_named(cluster: Cluster, tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.mkdir()
    cluster.worker()
    cluster.wait_for(1)
    jobs = [(Shared(0), number, str(log)) for number in range(30)]
    running = run_jobs(functions.slow, jobs, cluster=cluster.address, shared=[np.array([1000])])
    next(running)
    cluster.processes[0].kill()
    with pytest.raises(ClusterError, match="the Dask scheduler went away"):
        list(running)


def test_no_scheduler_and_no_workers_are_one_line(cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mapmeld.parallel.cluster._PATIENCE", 1)
    for address, complaint in (
        (cluster.address, "has no workers"),
        ("tcp://127.0.0.1:9", "no Dask scheduler answers there"),
        ("nonsense://x", "no Dask scheduler answers there"),
    ):
        with pytest.raises(ClusterError, match=complaint) as refused:
            next(run_jobs(functions.add, [(1, 2)], cluster=address))
        assert "\n" not in str(refused.value)
        assert address in str(refused.value)
