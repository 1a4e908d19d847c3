"""The map index: recall on maps with known truth, what `find` then answers, and time among many maps.

    python benchmarks/map_index.py DATA [--parts recall find graph time] [--synthetic 10000]

DATA is the folder that holds the data sets `paper`, `radish` and `halmstad` (benchmarks/README.md); their
maps together are one index. Every map is a query against all others: as it is, turned by a random angle, and
cut by a straight line in a random direction so that 60 or 40 percent of its known area stay, and turned. A
map is relevant if it shows the same building ("same place"), or if the data sets list the two as overlapping
("overlap"). Recall at k is the number of relevant maps among the first k, divided by k or by how many
there are, whichever is less, averaged over all queries. "few shared" counts pairs of overlap below 0.5: the
share of them whose map is among the first 10. Prints Markdown tables.
"""

from __future__ import annotations

import argparse
import math
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from synthetic_maps import synthetic_maps

from mapmeld.evaluation import Kind, Pair, overlap_centroid, pose_errors, read_dataset
from mapmeld.evaluation.turning import turned
from mapmeld.grid import UNKNOWN, OccupancyGrid
from mapmeld.index import (
    IndexedMap,
    MapIndex,
    Ranking,
    Signature,
    build_index,
    find,
    map_files,
    read_index,
    signature_of,
    write_index,
)
from mapmeld.index.entries import Stamp
from mapmeld.io import load, save
from mapmeld.matching import Verdict
from mapmeld.matching.correlative.prepared_map import prepare
from mapmeld.merging.graph import match_all_pairs
from mapmeld.se2 import Pose2

SETS = ("paper", "radish", "halmstad")
BENT = {"halmstad": (1.0, 10.0)}  # tolerance [m], [degrees] of recordings whose truth is no better
USUAL = (0.5, 5.0)
QUERIES = 50
PARTS = ("recall", "find", "graph", "time")

Doubles = NDArray[np.float64]
Scores = Callable[[Sequence[OccupancyGrid], Sequence[OccupancyGrid]], Doubles]


@dataclass(frozen=True)
class Collection:
    """All maps of the data sets, and what is known of pairs of them."""

    paths: list[Path]
    building: list[str]
    grids: list[OccupancyGrid]
    pairs: dict[tuple[int, int], Pair]  # as listed, (map 1, map 2)

    @property
    def same_place(self) -> NDArray[np.bool_]:
        """Whether two maps (n, n) show the same building."""
        b = np.array(self.building)
        return np.asarray((b[:, None] == b) & ~np.eye(len(b), dtype=bool))

    @property
    def overlap(self) -> Doubles:
        """Listed overlap (n, n), 0 where none is."""
        found = np.zeros((len(self.paths),) * 2)
        for (i, j), pair in self.pairs.items():
            found[i, j] = found[j, i] = pair.overlap or 1e-6
        return found


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--synthetic", type=int, default=10_000, metavar="MAPS")
    parser.add_argument(
        "--distinct", type=int, metavar="MAPS", help="draw so many and repeat them, which takes less time"
    )
    parser.add_argument(
        "--queries",
        nargs="+",
        metavar="KIND",
        help="of those for `find`, only these kinds (as in the tables)",
    )
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS, help="what to measure")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    maps = collected(options.data)
    queries = {
        "as they are": [(grid, Pose2()) for grid in maps.grids],
        "turned": [turned(grid, seed) for seed, grid in enumerate(maps.grids)],
        "60 % of it, turned": [cut(grid, 0.6, seed) for seed, grid in enumerate(maps.grids)],
        "40 % of it, turned": [cut(grid, 0.4, seed) for seed, grid in enumerate(maps.grids)],
    }
    if "recall" in options.parts:
        print_recall(maps, queries)
    if "find" in options.parts:
        print_found(maps, {kind: queries[kind] for kind in options.queries or queries})
    if "graph" in options.parts:
        print_graph(maps)
    if "time" in options.parts:
        print_times(maps)
        print_synthetic(options.synthetic, options.distinct or options.synthetic)


def collected(data: Path) -> Collection:
    """Read the maps that are in any pair of one place."""
    same = [(name, p) for name in SETS for p in read_dataset(data / name).pairs if p.kind is Kind.SAME]
    building = {path: f"{name} {p.env}" for name, p in same for path in (p.map_1, p.map_2)}
    paths = sorted(building)
    number = {path: i for i, path in enumerate(paths)}
    pairs = {(number[p.map_1], number[p.map_2]): p for _, p in same}
    return Collection(paths, [building[p] for p in paths], [load(p) for p in paths], pairs)


def cut(grid: OccupancyGrid, share: float, seed: int) -> tuple[OccupancyGrid, Pose2]:
    """Keep a share of what is known of a map, on one side of a line of random direction, and turn it."""
    angle = float(np.random.default_rng(seed).uniform(-math.pi, math.pi))
    row, col = np.indices(grid.shape)
    along = row * math.sin(angle) + col * math.cos(angle)
    cells = np.array(grid.cells)
    cells[along > np.quantile(along[grid.known], share)] = UNKNOWN
    return turned(OccupancyGrid(cells, grid.resolution, grid.origin), 1000 + seed)


# ---------------------------------------------------------------------- recall
def by_words(maps: Sequence[OccupancyGrid], queries: Sequence[OccupancyGrid]) -> Doubles:
    """Score by the signatures of the package."""
    ranking = Ranking.of([signature_of(grid) for grid in maps])
    return np.array([ranking.scores(signature_of(grid)) for grid in queries])


def by_distances(maps: Sequence[OccupancyGrid], queries: Sequence[OccupancyGrid]) -> Doubles:
    """Score by one histogram of a whole map, Bhattacharyya coefficients.

    Of distances between wall points (Osada and others 2002, D2) with the angles between the walls.
    """
    of_maps, of_queries = (np.sqrt([distances_of(g) for g in grids]) for grids in (maps, queries))
    return np.asarray(of_queries @ of_maps.T)


def distances_of(grid: OccupancyGrid) -> Doubles:
    """Histogram over 40 distances of 0.5 m times 3 angles."""
    prepared = prepare(grid)
    if prepared is None:
        return np.zeros(120)
    walls = prepared.walls
    straight = np.flatnonzero(walls.straight[:600] > 0.3)
    places, normals = walls.points[straight], walls.normals[straight]
    distance = np.abs(places[:, None] - places)[~np.eye(len(places), dtype=bool)]
    cosine = np.abs((normals[:, None] * normals.conj()).real)[~np.eye(len(places), dtype=bool)]
    bins = np.minimum((distance / 0.5).astype(int), 39) * 3 + np.digitize(cosine, [0.5, 0.9])
    counts = np.bincount(bins, minlength=120).astype(np.float64)
    return np.asarray(counts / max(counts.sum(), 1))


def by_chance(maps: Sequence[OccupancyGrid], queries: Sequence[OccupancyGrid]) -> Doubles:
    """Score at random."""
    return np.random.default_rng(0).random((len(queries), len(maps)))


def print_recall(maps: Collection, queries: dict[str, list[tuple[OccupancyGrid, Pose2]]]) -> None:
    """Print recall by signature and kind of query."""
    print(
        "| signature | queries | same place at 5 | at 10 | overlap at 5 | at 10 | few shared at 10 |", end=""
    )
    print(" " + " | ".join(f"{name} at 5 / 10" for name in SETS) + " | first is right |")
    print("|---|---|--:|--:|--:|--:|--:|" + "--:|" * len(SETS) + "--:|")
    ways: dict[str, Scores] = {
        "words": by_words, "distances of a whole map": by_distances, "chance": by_chance,
    }  # fmt: skip
    for way, scores in ways.items():
        for kind, asked in queries.items():
            found = scores(maps.grids, [grid for grid, _ in asked])
            np.fill_diagonal(found, -np.inf)
            order = np.argsort(-found, axis=1, kind="stable")
            rank = np.argsort(order, axis=1)
            few = (maps.overlap > 0) & (maps.overlap < 0.5)
            place, shared = maps.same_place, maps.overlap > 0
            cells = [f"{recall(order, relevant, k):.3f}" for relevant in (place, shared) for k in (5, 10)]
            cells.append(f"{np.mean(rank[few] < 10):.3f}")
            for name in SETS:
                own = np.array([b.startswith(name) for b in maps.building])
                cells.append(" / ".join(f"{recall(order[own], place[own], k):.3f}" for k in (5, 10)))
            cells.append(f"{np.mean(place[np.arange(len(order)), order[:, 0]]):.2f}")
            print(f"| {way} | {kind} | " + " | ".join(cells) + " |", flush=True)
    pairs = few.sum() // 2
    print(
        f"\n{len(maps.paths)} maps, {len(maps.pairs)} pairs that overlap, {pairs} of them by less than half.\n"  # noqa: E501
    )


def recall(order: NDArray[np.intp], relevant: NDArray[np.bool_], k: int) -> float:
    """Average share of what can be found among the first k."""
    there = relevant.sum(axis=1)
    got = np.take_along_axis(relevant, order[:, :k], axis=1).sum(axis=1)
    some = there > 0
    return float(np.mean(got[some] / np.minimum(there[some], k)))


# ---------------------------------------------------------------------- the whole of `find`
def print_found(maps: Collection, queries: dict[str, list[tuple[OccupancyGrid, Pose2]]]) -> None:
    """Print how often `find` names the place rightly, and wrongly."""
    index = indexed(maps)
    number = {path: i for i, path in enumerate(maps.paths)}
    print(
        "| queries | with a right answer | accepted and right | accepted and wrong | not judged | seconds per query |"  # noqa: E501
    )
    print("|---|--:|--:|--:|--:|--:|")
    for kind, asked in queries.items():
        answered = right = wrong = unjudged = 0
        seconds = []
        for q, (grid, T_new_old) in enumerate(asked):
            started = time.perf_counter()
            found = find(grid, index, but=maps.paths[q])
            seconds.append(time.perf_counter() - started)
            good = 0
            for candidate in found:
                if candidate.result is None or candidate.result.verdict is not Verdict.ACCEPTED:
                    continue
                T = candidate.result.T_a_b
                judged = None if T is None else is_right(maps, number[candidate.path], q, T @ T_new_old)
                good += judged is True
                wrong += judged is False
                unjudged += judged is None
            right += good
            answered += good > 0
        cells = [f"{answered} of {len(asked)}", f"{right}", f"{wrong}", f"{unjudged}"]
        print(f"| {kind} | " + " | ".join([*cells, f"{statistics.median(seconds):.2f}"]) + " |", flush=True)
    print()


def indexed(maps: Collection) -> MapIndex:
    """Return an index of the collection in memory."""
    stamp = Stamp(0, 0)
    root = Path(maps.paths[0]).parents[2]
    return MapIndex(
        root,
        tuple(IndexedMap(p.relative_to(root).as_posix(), "", (stamp, stamp)) for p in maps.paths),
        Ranking.of([signature_of(g) for g in maps.grids]),
    )


def is_right(maps: Collection, i: int, j: int, T_i_j: Pose2) -> bool | None:
    """Judge an accepted match of maps i and j as they are; None if the data sets do not say where j lies."""
    if maps.building[i] != maps.building[j]:
        return False
    pair = maps.pairs.get((i, j)) or maps.pairs.get((j, i))
    if pair is None or pair.T_1_2 is None:
        return None
    T = T_i_j if (i, j) in maps.pairs else T_i_j.inverse()
    first, second = (i, j) if (i, j) in maps.pairs else (j, i)
    centroid = pair.centroid or overlap_centroid(maps.grids[first], maps.grids[second], pair.T_1_2)
    if centroid is None:
        return None
    errors = pose_errors(T, pair.T_1_2, centroid)
    metres, degrees = BENT.get(maps.building[i].split()[0], USUAL)
    return errors.translation <= metres and math.degrees(errors.rotation) <= degrees


# ---------------------------------------------------------------------- pairs worth matching
def print_graph(maps: Collection) -> None:
    """Print what matching only likely pairs costs and saves."""
    print(
        "| candidates per map | pairs matched | accepted, same building | accepted, other building | seconds |"  # noqa: E501
    )
    print("|--:|--:|--:|--:|--:|")
    for candidates in (None, 10, 5):
        started = time.perf_counter()
        grids = [load(path) for path in maps.paths]  # anew: what is known of a map is remembered with it
        found = match_all_pairs(grids, candidates=candidates)
        seconds = time.perf_counter() - started
        accepted = [(i, j) for i, j, result in found if result.verdict is Verdict.ACCEPTED]
        same = sum(maps.building[i] == maps.building[j] for i, j in accepted)
        cells = [
            "all" if candidates is None else str(candidates),
            f"{len(found)}",
            f"{same}",
            f"{len(accepted) - same}",
        ]
        print("| " + " | ".join([*cells, f"{seconds:.0f}"]) + " |", flush=True)
    print()


# ---------------------------------------------------------------------- time and size
def print_times(maps: Collection) -> None:
    """Print what an index of these maps takes, from their files."""
    root = maps.paths[0].parents[1]  # one data set, as a user has it
    names = [name for name in map_files(root) if name.count("/") == 1]
    started = time.perf_counter()
    built = build_index(root, names)
    seconds = time.perf_counter() - started
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "index"
        write_index(built.index, file)
        size = file.stat().st_size
    print(f"Building, files and all: {seconds / built.read * 1e3:.0f} ms a map ({built.read} maps); ", end="")
    print(f"{size / built.read:.0f} bytes a map.\n", flush=True)


def print_synthetic(count: int, distinct: int) -> None:
    """Print the time of a query among many simulated maps, two of each plan, and how often it finds the other."""  # noqa: E501
    plans, signatures = [], []
    every = max(1, distinct // QUERIES)
    asked: dict[int, OccupancyGrid] = {}
    seconds = 0.0
    for number, (plan, grid) in enumerate(synthetic_maps(distinct, seed=11)):
        if number % every == 0:  # a copy: what is known of a map is remembered with it
            asked[number] = OccupancyGrid(np.array(grid.cells), grid.resolution, grid.origin)
        started = time.perf_counter()
        signatures.append(signature_of(grid))
        seconds += time.perf_counter() - started
        plans.append(plan)
    once = Ranking.of(signatures)
    found = []
    for number in asked:
        order, _ = once.best(signatures[number])
        others = [plans[m] == plans[number] for m in order if m != number]
        found.append(others.index(True) if True in others else distinct)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "index"
        many = [signatures[n % distinct] for n in range(count)]
        write_index(MapIndex(Path(folder), entries(many, Stamp(0, 0)), Ranking.of(many)), file)
        size = file.stat().st_size
        started = time.perf_counter()
        index = read_index(file)
        reading = time.perf_counter() - started
        processes = [process_seconds(grid, file) for grid in list(asked.values())[:10]]
    ranking = index.ranking
    times = []
    for grid in asked.values():
        started = time.perf_counter()
        ranking.best(signature_of(grid))
        times.append(time.perf_counter() - started)
    usual = statistics.median(times)
    print(
        f"{count} simulated maps ({distinct} drawn): {seconds / distinct * 1e3:.0f} ms a signature; ", end=""
    )
    print(f"{size / 1e6:.1f} MB on disk, read in {reading:.2f} s; ", end="")
    print(f"a query {usual * 1e3:.0f} ms, {max(times) * 1e3:.0f} ms at most (of {len(times)}, ", end="")
    print("its signature included). ", end="")
    print(
        f"The whole process of `mapmeld find --candidates-only`: {statistics.median(processes):.2f} s, ",
        end="",
    )
    print(f"{max(processes):.2f} s at most (of {len(processes)}).")
    print(f"Of {distinct} maps the other one of the same plan is among the first 5: ", end="")
    print(f"{np.mean(np.array(found) < 5):.2f}, 10: {np.mean(np.array(found) < 10):.2f}.")


def process_seconds(grid: OccupancyGrid, index: Path) -> float:
    """Return what a query takes from the start of a new process to its end."""
    query = index.with_name("query.yaml")
    save(grid, query, force=True)
    command = [sys.executable, "-m", "mapmeld", "find", str(query), "--in", str(index), "--candidates-only"]
    started = time.perf_counter()
    subprocess.run(command, check=True, capture_output=True)
    return time.perf_counter() - started


def entries(signatures: Sequence[Signature], stamp: Stamp) -> tuple[IndexedMap, ...]:
    """Name signatures."""
    return tuple(
        IndexedMap(f"map_{n:06}.yaml", f"map_{n:06}.pgm", (stamp, stamp)) for n in range(len(signatures))
    )


if __name__ == "__main__":
    main()
