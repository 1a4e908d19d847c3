"""Times the alphabet method: whole on two 1500 x 1500 maps, and the comparison of 300 corners.

    python benchmarks/alphabet_speed.py [--size 1500] [--runs 15]

The maps are random floor plans drawn here; map 2 is map 1 turned by 0.4 rad. Medians.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np

from mapmeld import OccupancyGrid, Pose2, match
from mapmeld.grid import resample
from mapmeld.matching.alphabet import AlphabetParameters, map_matching


def random_plan(size: int, seed: int) -> OccupancyGrid:
    """Return a plan of size x size cells of 0.05 m: rooms of 2-7 m that overwrite one another."""
    rng = np.random.default_rng(seed)
    cells = np.full((size, size), -1, np.int8)
    for _ in range(size * size // 20_000):
        height, width = rng.integers(40, 140, 2)
        row, col = (int(rng.integers(0, size - n)) for n in (height, width))
        cells[row : row + height, col : col + width] = 100
        cells[row + 2 : row + height - 2, col + 2 : col + width - 2] = 0
    return OccupancyGrid(cells, 0.05)


def median_seconds(work: Callable[[], object], runs: int) -> float:
    """Return the median wall time of `runs` calls after one warm-up."""
    work()
    seconds = []
    for _ in range(runs):
        start = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - start)
    return statistics.median(seconds)


def main() -> None:
    """Print the two medians."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--size", type=int, default=1500)
    parser.add_argument("--runs", type=int, default=15)
    options = parser.parse_args()
    a = random_plan(options.size, seed=1)
    middle = options.size * a.resolution / 2
    T_b_a = Pose2(middle, middle) @ Pose2(0, 0, 0.4) @ Pose2(-middle, -middle)
    b = OccupancyGrid(resample(a, T_b_a, a), a.resolution)
    paper = median_seconds(lambda: match(a, b, "alphabet"), options.runs)
    many = AlphabetParameters(corners=300, corner_quality=0.01)
    corners = [len(alphabet.corners_px) for alphabet in map_matching(a, b, many).alphabets]
    whole = median_seconds(lambda: match(a, b, "alphabet", many), max(3, options.runs // 5))
    print(f"{options.size} x {options.size} cells, N = 30: {paper * 1000:.1f} ms")
    print(f"{options.size} x {options.size} cells, N = 300 ({corners} found): {whole:.2f} s")


if __name__ == "__main__":
    main()
