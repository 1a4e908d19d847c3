"""False matches put into graphs of maps, and how many of them are found.

    python benchmarks/graph_false_edges.py [DATA] [--runs 100]

Prints Markdown tables: synthetic graphs, and, with DATA (the folder that holds the data set `halmstad`),
the real matches of its office floor. A false edge leads anywhere, with a probability of 0.99 (what the
graph takes any surer match for); in the last table false edges come in pairs that agree with one
another: both lay one map wrongly, in the same way.
"""

from __future__ import annotations

import argparse
import itertools
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from mapmeld.io import load
from mapmeld.matching import Verdict
from mapmeld.merging.graph import match_all_pairs
from mapmeld.merging.graph.consistency import consistent
from mapmeld.merging.graph.edges import Doubles, Edges, Extent, bending, composed, inverted, log_odds, pose_of
from mapmeld.merging.graph.least_squares import parts
from mapmeld.se2 import Pose2

SURE = log_odds(0.99)
HEADING = (
    "| graph | edges | false | runs | found | left in doubt | used, in a cycle | used, in none "
    "| right edges lost | all poses kept % | seconds |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|"
)


@dataclass
class Tally:
    """Sums over the runs of a line."""

    false: int = 0
    found: int = 0
    doubted: int = 0
    used_in_a_cycle: int = 0
    used_in_none: int = 0
    lost: int = 0
    whole: int = 0
    seconds: float = 0.0


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("data", type=Path, nargs="?")
    parser.add_argument("--runs", type=int, default=100)
    arguments = parser.parse_args()
    graphs: list[tuple[str, int, Callable[[np.random.Generator], Edges]]] = [
        (f"{count} maps, {share:.0%} of all pairs", count, partial(drawn, count=count, share=share))
        for count, share in ((4, 1.0), (5, 1.0), (7, 1.0), (10, 1.0), (10, 0.4), (14, 1.0), (30, 0.2))
    ]
    if arguments.data is not None:
        office = halmstad(arguments.data / "halmstad")
        graphs.append(("halmstad E5, real matches", 14, lambda rng: office))
    print(HEADING)
    for name, count, make in graphs:
        for false in (1, 2, 3, 4, 5):
            report(name, count, make, false, arguments.runs, anywhere)
    print("\n" + HEADING)
    for name, count, make in graphs:
        for twos in (1, 2):
            report(name, count, make, twos, arguments.runs, agreeing_twos)


def drawn(rng: np.random.Generator, count: int, share: float) -> Edges:
    """Draw maps of 20 m at random poses and match a share of their pairs, with the noise that is stated.

    Neighbours in the order of the maps always match, so that the graph hangs together.
    """
    poses = np.column_stack([rng.uniform(-20, 20, (count, 2)), rng.uniform(-math.pi, math.pi, count)])
    extent = Extent(0, 0, 20)
    rows = []
    for i, j in itertools.combinations(range(count), 2):
        if j != i + 1 and rng.random() >= share:
            continue
        T = pose_of(composed(inverted(poses[i]), poses[j]))
        covariance = bending(T, extent, extent)
        error = rng.multivariate_normal(np.zeros(3), covariance)
        rows.append((i, j, Pose2(T.x + error[0], T.y + error[1], T.theta + error[2]), covariance, SURE))
    return Edges.of(rows)


def halmstad(folder: Path) -> Edges:
    """Match the maps of the office floor, all pairs of them."""
    maps = [load(path) for path in sorted((folder / "maps").glob("E5_*.yaml"))]
    extents = [Extent.of(grid) for grid in maps]
    rows = []
    for i, j, result in match_all_pairs(maps):
        T = result.T_a_b
        if result.verdict is Verdict.ACCEPTED and T is not None and result.covariance is not None:
            covariance = result.covariance + bending(T, extents[i], extents[j])
            rows.append((i, j, T, covariance, log_odds(result.probability)))
    return Edges.of(rows)


def anywhere(rng: np.random.Generator, edges: Edges, count: int, false: int) -> tuple[Edges, set[int]]:
    """Let so many edges lead anywhere within 20 m."""
    chosen = rng.choice(len(edges), min(false, len(edges)), replace=False)
    z = edges.z.copy()
    for k in chosen:
        z[k] = [*rng.uniform(-20, 20, 2), rng.uniform(-math.pi, math.pi)]
    return falsified(edges, z, chosen)


def agreeing_twos(rng: np.random.Generator, edges: Edges, count: int, false: int) -> tuple[Edges, set[int]]:
    """Lay so many maps wrongly, each by two of its edges that agree with one another."""
    z = edges.z.copy()
    wrong: list[int] = []
    for node in rng.permutation(count):
        its = np.flatnonzero((edges.i == node) | (edges.j == node))
        its = np.setdiff1d(its, wrong)
        if len(its) < 2:
            continue
        shift = np.array([[*rng.uniform(-20, 20, 2), rng.uniform(-math.pi, math.pi)]])
        for k in rng.choice(its, 2, replace=False):
            # The map itself moves by `shift`, whichever end of the edge it is.
            if edges.j[k] == node:
                z[k] = composed(z[[k]], shift)[0]
            else:
                z[k] = composed(inverted(shift), z[[k]])[0]
            wrong.append(int(k))
        if len(wrong) == 2 * false:
            break
    return falsified(edges, z, np.array(wrong, np.intp))


def falsified(edges: Edges, z: Doubles, chosen: np.ndarray) -> tuple[Edges, set[int]]:
    """Return the edges with other measurements, those chosen surer than any match."""
    weight = edges.weight.copy()
    weight[chosen] = SURE
    return Edges(edges.i, edges.j, z, edges.covariance, weight), {int(k) for k in chosen}


def report(
    name: str,
    count: int,
    make: Callable[[np.random.Generator], Edges],
    false: int,
    runs: int,
    spoil: Callable[[np.random.Generator, Edges, int, int], tuple[Edges, set[int]]],
) -> None:
    """Run a line of the table and print it."""
    tally, sizes = Tally(), []
    for seed in range(runs):
        rng = np.random.default_rng([seed, count, false])
        edges, wrong = spoil(rng, make(rng), count, false)
        sizes.append(len(edges))
        started = time.perf_counter()
        found = consistent(count, edges)
        tally.seconds += time.perf_counter() - started
        tally.false += len(wrong)
        for k in wrong:
            if found.doubted[k]:
                tally.doubted += 1
            elif not found.used[k]:
                tally.found += 1
            else:
                rest = found.used.copy()
                rest[k] = False
                labels = parts(count, edges[rest])
                if labels[edges.i[k]] == labels[edges.j[k]]:
                    tally.used_in_a_cycle += 1
                else:
                    tally.used_in_none += 1
        tally.lost += int((~found.used).sum()) - sum(not found.used[k] for k in wrong)
        tally.whole += int(len(found.fit.frames) == 1 and not any(found.used[k] for k in wrong))
    cells = [
        name,
        f"{np.mean(sizes):.0f}",
        f"{tally.false / runs:.1f}".removesuffix(".0"),
        f"{runs}",
        f"{tally.found} of {tally.false}",
        f"{tally.doubted}",
        f"{tally.used_in_a_cycle}",
        f"{tally.used_in_none}",
        f"{tally.lost} of {int(np.sum(sizes)) - tally.false}",
        f"{100 * tally.whole / runs:.0f}",
        f"{tally.seconds / runs:.3f}",
    ]
    print("| " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
