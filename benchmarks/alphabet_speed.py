"""Times the alphabet method with 30 corners, the default, and with 300.

    python benchmarks/alphabet_speed.py [--size 1500] [--runs 15]

The maps are random floor plans drawn here; map 2 is map 1 turned by 0.4 rad. On the first plan the
method must find that turn, or the figures are void and the script ends with an error. The second
plan is crowded with small rooms: as many corners as are asked for in both maps, all alike, the most
to compare; there the answer is not checked. One thread; medians of wall time and of processor time.
"""

from __future__ import annotations

import argparse
import math
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from mapmeld import MatchResult, OccupancyGrid, Pose2, Verdict, match
from mapmeld.grid import resample
from mapmeld.matching.alphabet import AlphabetParameters, map_matching

RESOLUTION = 0.05
TURN = 0.4
MANY = AlphabetParameters(corners=300, corner_quality=0.01)


@dataclass(frozen=True)
class Pair:
    """Two maps and the transform between them."""

    a: OccupancyGrid
    b: OccupancyGrid
    T_a_b: Pose2


def random_plan(size: int, rooms: int, sides: tuple[int, int], wall: int, seed: int) -> OccupancyGrid:
    """Return a plan of size x size cells: rooms that overwrite one another; sides and walls in cells."""
    rng = np.random.default_rng(seed)
    cells = np.full((size, size), -1, np.int8)
    for _ in range(rooms):
        height, width = rng.integers(*sides, 2)
        row, col = (int(rng.integers(0, size - n)) for n in (height, width))
        cells[row : row + height, col : col + width] = 100
        cells[row + wall : row + height - wall, col + wall : col + width - wall] = 0
    return OccupancyGrid(cells, RESOLUTION)


def turned(a: OccupancyGrid) -> Pair:
    """Return the plan beside itself, turned about its middle."""
    x, y = a.lattice_to_metres((a.shape[1] / 2, a.shape[0] / 2))
    T_b_a = Pose2(x, y) @ Pose2(0, 0, TURN) @ Pose2(-x, -y)
    return Pair(a, OccupancyGrid(resample(a, T_b_a, a), a.resolution), T_b_a.inverse())


def error(pair: Pair, result: MatchResult) -> tuple[float, float]:
    """Return how far off an answer is at the middle of map 2 [m], and its rotation [degrees]."""
    if result.T_a_b is None:
        return math.inf, math.inf
    middle = pair.b.lattice_to_metres((pair.b.shape[1] / 2, pair.b.shape[0] / 2))
    metres = float(np.hypot(*(result.T_a_b.apply(middle) - pair.T_a_b.apply(middle))))
    return metres, math.degrees(result.T_a_b.distance_to(pair.T_a_b)[1])


def check(pair: Pair, parameters: AlphabetParameters) -> None:
    """End the script if the method does not find how the pair fits together."""
    result = match(pair.a, pair.b, "alphabet", parameters)
    metres, degrees = error(pair, result)
    if result.verdict is not Verdict.ACCEPTED or metres > 0.2 or degrees > 0.5:
        raise SystemExit(
            f"wrong answer with N = {parameters.corners}: {result.verdict}, off by {metres:.2f} m and "
            f"{degrees:.2f} degrees ({result.reason})"
        )


def median_seconds(work: Callable[[], object], runs: int) -> tuple[float, float]:
    """Return the median wall and processor time [s] of `runs` calls after one warm-up."""
    work()
    wall, processor = [], []
    for _ in range(runs):
        wall_start, processor_start = time.perf_counter(), time.process_time()
        work()
        processor.append(time.process_time() - processor_start)
        wall.append(time.perf_counter() - wall_start)
    return statistics.median(wall), statistics.median(processor)


def report(name: str, pair: Pair, parameters: AlphabetParameters, runs: int) -> None:
    """Time one pair and print a line."""
    found = [len(alphabet.corners_px) for alphabet in map_matching(pair.a, pair.b, parameters).alphabets]
    wall, processor = median_seconds(lambda: match(pair.a, pair.b, "alphabet", parameters), runs)
    print(
        f"{name}, N = {parameters.corners} ({found[0]} and {found[1]} corners): "
        f"wall {wall * 1000:.1f} ms, processor {processor * 1000:.1f} ms (medians of {runs})"
    )


def main() -> None:
    """Check and time the pairs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--size", type=int, default=1500, help="cells along each side, at least 600")
    parser.add_argument("--runs", type=int, default=15)
    options = parser.parse_args()
    if options.size < 600 or options.runs < 1:
        parser.error("a size of 600 at least and one run at least are needed")
    cv2.setNumThreads(1)
    size, few_runs = options.size, max(1, options.runs // 3)

    plan = turned(random_plan(size, rooms=25, sides=(size // 10, size * 3 // 10), wall=4, seed=1))
    walls = f"{100 * plan.a.occupied.mean():.1f} % of the cells are wall"
    print(f"plan of 25 rooms, {size} x {size} cells, {walls}; map 2 is found right each time:")
    for parameters, runs in ((AlphabetParameters(), options.runs), (MANY, few_runs)):
        check(plan, parameters)
        report("  alphabet", plan, parameters, runs)

    rooms = size * size // 20_000
    crowded = turned(random_plan(size, rooms, sides=(40, 140), wall=2, seed=1))
    print(f"worst case, plan of {rooms} small rooms; the answer is not checked:")
    report("  alphabet", crowded, MANY, few_runs)


if __name__ == "__main__":
    main()
