"""Many maps: the graph against merging one after the other, on data sets with known truth.

    python benchmarks/graph_merging.py DATA

DATA is the folder that holds the data sets `paper`, `halmstad`, `radish` and `radish_hard`
(benchmarks/README.md). Prints a Markdown table. Both strategies run in this process, on one thread, one after
the other on the same maps; their seconds are without reading files and without drawing the merged map.
"""

from __future__ import annotations

import argparse
import itertools
import math
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2

from mapmeld.evaluation import Kind, Pair, overlap_centroid, pose_errors, read_dataset
from mapmeld.grid import OccupancyGrid
from mapmeld.io import load
from mapmeld.matching import DEFAULT_METHOD, match
from mapmeld.merging.by_graph import map_graph
from mapmeld.merging.sequential import placed_one_by_one
from mapmeld.se2 import Pose2

SETS = ("paper", "halmstad", "radish", "radish_hard")


@dataclass(frozen=True)
class Building:
    """Maps of one place, and what is known of pairs of them."""

    name: str
    maps: tuple[Path, ...]
    pairs: tuple[Pair, ...]


@dataclass(frozen=True)
class Placed:
    """Which maps belong together, and every map's pose in the frame of some map of its component."""

    components: tuple[tuple[int, ...], ...]
    poses: dict[int, Pose2]


@dataclass(frozen=True)
class Score:
    """How one strategy did on one group of maps."""

    right_components: bool
    joined_wrongly: int
    parted_wrongly: int
    metres: list[float]
    degrees: list[float]
    seconds: float


def main() -> None:
    """Measure and print."""
    arguments = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    arguments.add_argument("data", type=Path)
    data = arguments.parse_args().data
    cv2.setNumThreads(1)
    buildings = [b for name in SETS for b in buildings_of(data / name)]
    named = {b.name: b for b in buildings}
    match(load(buildings[0].maps[0]), load(buildings[0].maps[1]))  # loads all that matching needs

    paper = [b for b in buildings if b.name.startswith("paper")]
    halmstad = [b for b in buildings if b.name.startswith("halmstad")]
    radish = [b for b in buildings if b.name.startswith("radish ")]
    hard = [b for b in buildings if b.name.startswith("radish_hard")]
    office = named["halmstad E5"]
    flats = [b for b in halmstad if b is not office]
    print(
        "| maps | buildings | runs | strategy | components right | joined wrongly | parted wrongly |", end=""
    )
    print(" mean m | mean deg | worst m | seconds per run |")
    print("|---|--:|--:|---|--:|--:|--:|--:|--:|--:|--:|")
    report("halmstad E5", [[office]])
    report("halmstad, each flat", [[b] for b in flats])
    report("paper, each plan", [[b] for b in paper])
    report("radish, each building", [[b] for b in radish])
    report("radish_hard, each building", [[b] for b in hard])
    report("halmstad E5 and a flat", [[office, b] for b in flats])
    report("paper, two plans", [list(two) for two in itertools.combinations(paper, 2)])
    report("radish, two buildings", [list(two) for two in itertools.combinations(radish, 2)])
    report("radish_hard, two buildings", [list(two) for two in itertools.combinations(hard, 2)])
    report("halmstad, all", [halmstad])
    report("paper, all", [paper])
    report("all but radish_hard", [[*paper, *halmstad, *radish]])


def buildings_of(folder: Path) -> list[Building]:
    """Group the maps of a data set by the building that they show."""
    same = [pair for pair in read_dataset(folder).pairs if pair.kind is Kind.SAME]
    found = []
    for env in sorted({pair.env for pair in same}):
        pairs = tuple(pair for pair in same if pair.env == env)
        maps = sorted({path for pair in pairs for path in (pair.map_1, pair.map_2)})
        found.append(Building(f"{folder.name} {env}", tuple(maps), pairs))
    return found


def report(name: str, groups: Sequence[Sequence[Building]]) -> None:
    """Run both strategies on every group of buildings and print a line for each strategy."""
    scores: dict[str, list[Score]] = {"graph": [], "sequential": []}
    for group in groups:
        paths = [path for building in group for path in building.maps]
        for strategy in scores:
            grids = [load(path) for path in paths]  # anew: what is known of a map is remembered with it
            started = time.perf_counter()
            placed = run(strategy, grids)
            seconds = time.perf_counter() - started
            scores[strategy].append(score(group, paths, grids, placed, seconds))
    for strategy, found in scores.items():
        metres = [error for one in found for error in one.metres]
        degrees = [error for one in found for error in one.degrees]
        count = sum(len(b.maps) for b in groups[0])
        cells = [
            name if strategy == "graph" else "",
            f"{len(groups[0])} ({count} maps)" if len(groups) == 1 else f"{len(groups[0])}",
            f"{len(groups)}",
            strategy,
            f"{sum(one.right_components for one in found)} of {len(found)}",
            f"{sum(one.joined_wrongly for one in found)}",
            f"{sum(one.parted_wrongly for one in found)}",
            f"{statistics.fmean(metres):.3f}",
            f"{statistics.fmean(degrees):.2f}",
            f"{max(metres):.2f}",
            f"{statistics.median(one.seconds for one in found):.2f}",
        ]
        print("| " + " | ".join(cells) + " |", flush=True)


def run(strategy: str, grids: Sequence[OccupancyGrid]) -> Placed:
    """Place maps by a strategy, with every setting at its default."""
    if strategy == "graph":
        graph = map_graph(grids, method=DEFAULT_METHOD)
        return Placed(graph.components, dict(enumerate(graph.poses)))
    placed = placed_one_by_one(grids, DEFAULT_METHOD, None)
    poses = {members[0]: Pose2() for members in placed.components}
    for joint in placed.joints:
        if joint.result.T_a_b is not None:
            poses[joint.index] = poses[joint.reference[0]] @ joint.result.T_a_b
    return Placed(placed.components, poses)


def score(
    group: Sequence[Building],
    paths: Sequence[Path],
    grids: Sequence[OccupancyGrid],
    placed: Placed,
    seconds: float,
) -> Score:
    """Compare components with buildings, and the poses of maps in one component with the truth of pairs."""
    building = {path: b.name for b in group for path in b.maps}
    component = {i: c for c, members in enumerate(placed.components) for i in members}
    joined = parted = 0
    for i, j in itertools.combinations(range(len(paths)), 2):
        together, same = component[i] == component[j], building[paths[i]] == building[paths[j]]
        joined += together and not same
        parted += same and not together
    number = {path: i for i, path in enumerate(paths)}
    metres, degrees = [], []
    for pair in (pair for b in group for pair in b.pairs):
        i, j = number[pair.map_1], number[pair.map_2]
        if component[i] != component[j] or pair.T_1_2 is None:
            continue
        centroid = pair.centroid or overlap_centroid(grids[i], grids[j], pair.T_1_2)
        if centroid is None:
            continue
        errors = pose_errors(placed.poses[i].inverse() @ placed.poses[j], pair.T_1_2, centroid)
        metres.append(errors.translation)
        degrees.append(math.degrees(errors.rotation))
    return Score(not (joined or parted), joined, parted, metres, degrees, seconds)


if __name__ == "__main__":
    main()
