"""Is the covariance of the default method as wide as its errors? The chi-square test.

    python benchmarks/covariance.py DATASET... [--seeds 1] [--truth NAME=m,deg] [--out figures/covariance.png]

DATASETs are folders or lists of pairs with known truth (docs/datasets.md). Every pair of one place is
matched with map 2 turned by a random angle, once a seed. The squared normalised error e' C^-1 e
of an accepted answer follows a chi-square distribution with three degrees of freedom if C is right: its
mean is 3, and the shares below the quantiles are those of the quantiles. `--truth` adds to C what the set
itself does not know: the standard deviation of its transforms at the middle of the overlap, per axis
and of the angle. Prints a Markdown table and draws the distributions.
"""

from __future__ import annotations

import argparse
import math
import zlib
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from mapmeld.evaluation.pairs import Pair, read_dataset
from mapmeld.evaluation.score import overlap_centroid
from mapmeld.evaluation.turning import turned
from mapmeld.io import load
from mapmeld.matching import Verdict, match
from mapmeld.se2 import Pose2

Doubles = NDArray[np.float64]
LEVELS = (0.5, 0.9, 0.95, 0.99)
MOST_OFF = 1.0  # [m] what is further off is a wrong match, not an inexact one


def normalised_error(pair: Pair, seed: int, truth_spread: tuple[float, float]) -> tuple[float, float] | None:
    """Return e' C^-1 e of one accepted match, without and with the spread [m, deg] of the truth."""
    a, b = load(pair.map_1), load(pair.map_2)
    truth = pair.T_1_2
    assert truth is not None
    centroid = pair.centroid or overlap_centroid(a, b, truth)
    b, T_new_old = turned(b, zlib.crc32(f"{seed} {pair.id}".encode()))
    truth = truth @ T_new_old.inverse()
    result = match(a, b)
    if result.verdict is not Verdict.ACCEPTED or result.T_a_b is None or centroid is None:
        return None
    assert result.covariance is not None
    T = result.T_a_b
    if math.dist(T.apply(truth.inverse().apply(centroid)), centroid) > MOST_OFF:
        return None
    e = np.array([T.x - truth.x, T.y - truth.y, math.remainder(T.theta - truth.theta, math.tau)])
    spread = about(T, np.asarray(centroid), *truth_spread)
    return quadratic(e, result.covariance), quadratic(e, result.covariance + spread)


def quadratic(e: Doubles, covariance: Doubles) -> float:
    """Return e' C^-1 e."""
    return float(e @ np.linalg.solve(covariance, e))


def about(T: Pose2, place: Doubles, metres: float, degrees: float) -> Doubles:
    """Return the covariance (3, 3) of T's numbers that a spread of shift and turn about `place` makes."""
    A = np.array([[1, 0, place[1] - T.y], [0, 1, T.x - place[0]], [0, 0, 1]])
    return np.asarray(A @ np.diag([metres**2, metres**2, math.radians(degrees) ** 2]) @ A.T)


def row(name: str, errors: Doubles) -> str:
    """Return one line of the table."""
    low, high = (chi2.ppf(p, 3 * len(errors)) / (3 * len(errors)) for p in (0.025, 0.975))
    shares = " | ".join(f"{100 * (errors < chi2.ppf(level, 3)).mean():.0f}" for level in LEVELS)
    return (
        f"| {name} | {len(errors)} | {errors.mean() / 3:.2f} | {low:.2f}-{high:.2f} "
        f"| {np.median(errors) / chi2.median(3):.2f} | {shares} |"
    )


def draw(found: dict[str, Doubles], out: Path) -> None:
    """Draw how the shares below every quantile compare with those of the chi-square distribution."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.2, 5), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.plot([0, 1], [0, 1], color="0.6", linewidth=1)
    for name, errors in found.items():
        expected = np.sort(chi2.cdf(errors, 3))
        axes.plot(expected, (np.arange(len(errors)) + 0.5) / len(errors), label=name)
    axes.set(
        xlabel="share expected within (chi-square, 3)",
        ylabel="share of accepted answers within",
        xlim=(0, 1),
        ylim=(0, 1),
        aspect="equal",
    )
    axes.text(0.03, 0.94, "above the line: stated too wide", fontsize=8)
    axes.text(0.5, 0.03, "below the line: stated too narrow", fontsize=8)
    axes.legend(loc="center right", fontsize=8)
    figure.savefig(out, dpi=110)


def main() -> None:
    """Measure, print, draw."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("datasets", nargs="+")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--truth", action="append", default=[], metavar="NAME=m,deg")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "figures" / "covariance.png")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    spreads = {}
    for text in options.truth:
        name, _, values = text.partition("=")
        metres, degrees = (float(v) for v in values.split(","))
        spreads[name] = metres, degrees
    print(
        "| data set | accepted | mean / 3 | 95 % of right ones | median | within 50 % | 90 % | 95 % | 99 % |"
    )
    print("| --- | --: | --: | --: | --: | --: | --: | --: | --: |")
    found: dict[str, Doubles] = {}
    for dataset in map(read_dataset, options.datasets):
        spread = spreads.get(dataset.name, (0.0, 0.0))
        errors = [
            errors
            for pair in dataset.pairs
            if pair.T_1_2 is not None
            for seed in range(options.seeds)
            if (errors := normalised_error(pair, seed, spread)) is not None
        ]
        plain, widened = np.array(errors).T
        found[dataset.name] = plain
        print(row(dataset.name, plain), flush=True)
        if dataset.name in spreads:
            name = f"{dataset.name}, truth known to {spread[0]:g} m, {spread[1]:g} deg"
            found[name] = widened
            print(row(name, widened), flush=True)
    draw(found, options.out)


if __name__ == "__main__":
    main()
