"""The map index: recall on maps with known truth, what `find` then answers, and time among many maps.

    python benchmarks/map_index.py DATA [--parts recall find graph time] [--synthetic 10000] [--keep FOLDER]

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
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
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
    Candidate,
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
from mapmeld.merging.graph import match_all_pairs, solve
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
        "--keep", type=Path, metavar="FOLDER", help="keep the simulated maps' index there, and use it again"
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
        print_synthetic(options.synthetic, options.keep)


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
    mistakes = []
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
                if judged is False:
                    mistakes.append(mistake(maps, number[candidate.path], q, candidate, T_new_old, kind))
                unjudged += judged is None
            right += good
            answered += good > 0
        cells = [f"{answered} of {len(asked)}", f"{right}", f"{wrong}", f"{unjudged}"]
        print(f"| {kind} | " + " | ".join([*cells, f"{statistics.median(seconds):.2f}"]) + " |", flush=True)
    print("\nAccepted and wrong:\n" + "".join(f"- {line}\n" for line in mistakes), flush=True)


def mistake(maps: Collection, i: int, j: int, candidate: Candidate, T_new_old: Pose2, kind: str) -> str:
    """Say what a wrong accepted match is."""
    names = f"{maps.building[i]} {maps.paths[i].stem}, {maps.building[j]} {maps.paths[j].stem} ({kind})"
    assert candidate.result is not None
    assert candidate.result.T_a_b is not None
    probability = candidate.result.probability
    stated = "" if probability is None else f", probability {probability:.3f}"
    if maps.building[i] != maps.building[j]:
        return f"{names}: another building{stated}"
    first, second = (i, j) if (i, j) in maps.pairs else (j, i)
    pair = maps.pairs[first, second]
    assert pair.T_1_2 is not None
    T = candidate.result.T_a_b @ T_new_old
    middle = pair.centroid or overlap_centroid(maps.grids[first], maps.grids[second], pair.T_1_2)
    assert middle is not None
    errors = pose_errors(T if first == i else T.inverse(), pair.T_1_2, middle)
    off = f"{errors.translation:.2f} m, {math.degrees(errors.rotation):.1f} degrees off"
    return f"{names}: {off}, overlap {pair.overlap or math.nan:.2f}{stated}"


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
    """Print what matching only likely pairs costs and saves, for all maps and for some alone."""
    print(
        "| maps | candidates per map | pairs matched | right | wrong | not judged | another building | seconds | buildings whole | mixed |"  # noqa: E501
    )
    print("|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|")
    shelves = {"all": "", "halmstad E5": "halmstad E5", "paper": "paper", "radish": "radish"}
    for shelf, start in shelves.items():
        chosen = [i for i, building in enumerate(maps.building) if building.startswith(start)]
        for candidates in (None, 10, 5):
            cells = _graph_of(maps, chosen, candidates)
            print(f"| {shelf}, {len(chosen)} | " + " | ".join(cells) + " |", flush=True)
    print()


def _graph_of(maps: Collection, chosen: list[int], candidates: int | None) -> list[str]:
    started = time.perf_counter()
    grids = [load(maps.paths[i]) for i in chosen]  # anew: what is known of a map is remembered with it
    found = match_all_pairs(grids, candidates=candidates)
    seconds = time.perf_counter() - started
    judged: Counter[bool | None] = Counter()
    other = 0
    for a, b, result in found:
        if result.verdict is not Verdict.ACCEPTED or result.T_a_b is None:
            continue
        i, j = chosen[a], chosen[b]
        if maps.building[i] != maps.building[j]:
            other += 1
        else:
            judged[is_right(maps, i, j, result.T_a_b)] += 1
    components = [{maps.building[chosen[k]] for k in c} for c in solve(grids, found).components]
    parts = Counter(name for names in components for name in names)
    whole = sum(count == 1 for count in parts.values())
    counts = [len(found), judged[True], judged[False], judged[None], other]
    return [
        "all" if candidates is None else f"{candidates}",
        *(f"{count}" for count in counts),
        f"{seconds:.1f}",
        f"{whole} of {len(parts)}",
        f"{sum(len(names) > 1 for names in components)}",
    ]


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


def print_synthetic(count: int, keep: Path | None) -> None:
    """Print what a query takes among many simulated maps, two of each plan, and how often it finds the other."""  # noqa: E501
    with tempfile.TemporaryDirectory() as temporary:
        folder = keep or Path(temporary)
        file = folder / f"simulated_{count}.index"
        if not file.exists():
            folder.mkdir(parents=True, exist_ok=True)
            write_simulated(count, file)
        index = read_index(file)
        ranks = []
        for number in range(0, count, max(1, count // QUERIES)):
            order, _ = index.ranking.best(index.ranking.signature(number))
            ranks.append(order[order != number].tolist().index(number ^ 1) if number ^ 1 in order else count)
        print(f"{count} simulated maps, {file.stat().st_size / 1e6:.1f} MB. ", end="")
        print(f"Of {len(ranks)} the other one of the same plan is among the first 5: ", end="")
        print(f"{np.mean(np.array(ranks) < 5):.2f}, 10: {np.mean(np.array(ranks) < 10):.2f}.\n")
        asked = [grid for _, grid in synthetic_maps(2 * QUERIES, seed=12)][::2]  # of plans that are not in it
        asked = [OccupancyGrid(np.array(g.cells), g.resolution, g.origin) for g in asked]
        processes, memory = process_seconds(asked, file, Path(temporary))
        rows = {
            "a process of `mapmeld find --candidates-only`": processes,
            "in a process that runs: its signature": seconds_of(signature_of, asked),
            "reading what the query needs": seconds_of(lambda g: read_index(file, signature_of(g)), asked),
            "ranking": seconds_of(lambda g: index.ranking.best(signature_of(g)), asked),
            "reading all of the index": seconds_of(lambda _: read_index(file), asked[:10]),
        }
        print("| seconds | median | longest | of |\n|---|--:|--:|--:|")
        for what, seconds in rows.items():
            print(f"| {what} | {statistics.median(seconds):.3f} | {max(seconds):.3f} | {len(seconds)} |")
        print(f"\nMemory of such a process: {memory:.0f} MB at most.")


def write_simulated(count: int, file: Path) -> None:
    """Draw maps, describe them, and write their index."""
    signatures = []
    drawing, describing = [], []
    maps = synthetic_maps(count, seed=11)
    for _ in range(count):
        started = time.perf_counter()
        _, grid = next(maps)
        drawn = time.perf_counter()
        signatures.append(signature_of(grid))
        drawing.append(drawn - started)
        describing.append(time.perf_counter() - drawn)
    of_each = [f"{statistics.median(seconds) * 1e3:.0f} ms" for seconds in (drawing, describing)]
    print("To draw a map takes {}, to describe it {}.".format(*of_each))
    write_index(MapIndex(file.parent, entries(signatures, Stamp(0, 0)), Ranking.of(signatures)), file)


def seconds_of(step: Callable[[OccupancyGrid], object], grids: Sequence[OccupancyGrid]) -> list[float]:
    """Time a step for each map."""
    seconds = []
    for grid in grids:
        started = time.perf_counter()
        step(grid)
        seconds.append(time.perf_counter() - started)
    return seconds


def process_seconds(grids: Sequence[OccupancyGrid], index: Path, folder: Path) -> tuple[list[float], float]:
    """Time queries from the start of a new process to its end; return the seconds and most memory [MB].

    As in an installed package, Python has its bytecode: a first query, which makes it, is not counted.
    """
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    environment["PYTHONPYCACHEPREFIX"] = str(folder / "bytecode")
    query = folder / "query.yaml"
    command = [sys.executable, "-m", "mapmeld", "find", str(query), "--in", str(index), "--candidates-only"]

    def ask(grid: OccupancyGrid) -> None:
        subprocess.run(command, check=True, capture_output=True, env=environment)

    seconds = []
    for grid in (grids[0], *grids):
        save(grid, query, force=True)
        seconds += seconds_of(ask, [grid])
    # By way of a small process: to its children the system counts what this one has.
    program = (
        "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, capture_output=True); "
    )
    program += "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
    said = subprocess.run(
        [sys.executable, "-c", program, *command], check=True, capture_output=True, env=environment
    )
    return seconds[1:], int(said.stdout) / 1e3


def entries(signatures: Sequence[Signature], stamp: Stamp) -> tuple[IndexedMap, ...]:
    """Name signatures."""
    return tuple(
        IndexedMap(f"map_{n:06}.yaml", f"map_{n:06}.pgm", (stamp, stamp)) for n in range(len(signatures))
    )


if __name__ == "__main__":
    main()
