"""Fits the coefficients of the correlative method's probability, and validates them building by building.

    python benchmarks/fit_probability.py DATASET... [--turns 2] [--parts 3] [--seed 0] [--workers 2] [--write]

DATASETs are folders or lists of pairs with known truth (docs/datasets.md). Every pair is tried as it is
and with map 2 turned by `--turns` random angles; every pair of one place also `--parts` times cut
into parts that share less of it, or nothing at all (`mapmeld.evaluation.parting`), and turned: two
robots in one building that have not met are the hardest to tell from two that have. The model is a
conditional logit over the modes of a pair and "none of them"
(`mapmeld.matching.correlative.probability`); weights are kept >= 0, so that more evidence never
makes a match less likely. Prints the coefficients fitted on
all pairs and, with every building left out in turn, what those fitted on the others reach on
it. `--write` puts the coefficients into the package.
"""

from __future__ import annotations

import argparse
import json
import zlib
from collections import Counter
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

import mapmeld
from mapmeld.evaluation.calibration import expected_calibration_error
from mapmeld.evaluation.pairs import Kind, Pair, read_dataset
from mapmeld.evaluation.parting import parted
from mapmeld.evaluation.score import Tolerance, overlap_centroid, pose_errors
from mapmeld.evaluation.turning import turned
from mapmeld.matching.correlative import CorrelativeParameters
from mapmeld.matching.correlative.alignment import to_metric
from mapmeld.matching.correlative.matcher import LOOKED_AT, ranked_modes
from mapmeld.matching.correlative.prepared_map import prepare
from mapmeld.matching.correlative.probability import surplus_of_others

FIGURES = ("surplus", "clean", "clean_bent", "log_overlap")
NAMES = ("bias", *FIGURES, "chance")
RIDGE = 1.0
COEFFICIENTS = Path(mapmeld.__file__).parent / "matching" / "correlative" / "probability.json"

Doubles = NDArray[np.float64]


@dataclass(frozen=True)
class Trial:
    """The modes that the matcher found for one pair.

    `figures` is (modes, figures), the last column what the others reach, negative; `right` (modes,);
    `buildings` are those of both maps.
    """

    name: str
    dataset: str
    kind: Kind
    buildings: frozenset[str]
    figures: Doubles
    right: NDArray[np.bool_]


def tried(dataset: str, pair: Pair, tolerance: Tolerance, turn: int, part: int, seed: int) -> Trial:
    """Match one pair and judge every mode by the truth.

    Map 2 is turned if `turn` is not 0; both are cut if `part` is not 0.
    """
    a, b = mapmeld.load(pair.map_1), mapmeld.load(pair.map_2)
    truth = pair.T_1_2
    centroid = pair.centroid
    if truth is not None and centroid is None:
        centroid = overlap_centroid(a, b, truth)
    name, kind = f"{pair.id} turn {turn}", pair.kind
    if part:
        assert truth is not None
        dataset, name = f"{dataset} parts", f"{pair.id} part {part}"
        a, b, width = parted(a, b, truth, zlib.crc32(f"{seed} {part} {dataset} {pair.id}".encode()))
        centroid = overlap_centroid(a, b, truth)
        if width <= 0 or centroid is None:
            truth, centroid, kind = None, None, Kind.DIFFERENT
    if turn:
        b, T_new_old = turned(b, zlib.crc32(f"{seed} {turn} {dataset} {pair.id}".encode()))
        truth = None if truth is None else truth @ T_new_old.inverse()
    first, second = prepare(a), prepare(b)
    modes = ranked_modes(first, second, CorrelativeParameters()) if first and second else []
    right = []
    for mode in modes:
        assert first is not None
        assert second is not None
        if truth is None or centroid is None:
            right.append(False)
            continue
        errors = pose_errors(to_metric(first.walls, second.walls, mode.local), truth, centroid)
        right.append(errors.within(tolerance))
    figures = np.array([[float(getattr(m.evidence, figure)) for figure in FIGURES] for m in modes])
    others = surplus_of_others([m.evidence for m in modes], LOOKED_AT)
    buildings = frozenset(f"{dataset.split(':')[0].split('_')[0]} {env}" for env in pair.env.split("/"))
    return Trial(
        name,
        dataset,
        kind,
        buildings,
        np.column_stack([figures.reshape(-1, len(FIGURES)), -others]),
        np.array(right, bool),
    )


@dataclass(frozen=True)
class Table:
    """Trials side by side: `X` (trials, modes, 1 + figures), `there` and `right` (trials, modes)."""

    X: Doubles
    there: NDArray[np.bool_]
    right: NDArray[np.bool_]

    @classmethod
    def of(cls, trials: Sequence[Trial]) -> Table:
        """Put trials side by side, each filled up with modes that are not there."""
        shape = len(trials), max(len(t.right) for t in trials)
        table = cls(np.zeros((*shape, len(NAMES))), np.zeros(shape, np.bool_), np.zeros(shape, np.bool_))
        for k, trial in enumerate(trials):
            n = len(trial.right)
            table.X[k, :n, 0], table.X[k, :n, 1:] = 1, trial.figures
            table.there[k, :n], table.right[k, :n] = True, trial.right
        return table

    def likelihood(self, theta: Doubles) -> tuple[float, Doubles]:
        """Return the negative log likelihood with its ridge, and its gradient, of (bias, weights)."""
        s = np.where(self.there, self.X @ theta, -np.inf)
        s = np.column_stack([s, np.zeros(len(s))])  # none of them
        wanted = np.column_stack([self.right, ~self.right.any(axis=1)])
        p = np.exp(s - s.max(axis=1, keepdims=True))
        p /= p.sum(axis=1, keepdims=True)
        share = np.where(wanted, p, 0.0)
        inside = np.maximum(share.sum(axis=1, keepdims=True), 1e-300)
        slope = (p - share / inside)[:, :-1]
        total = 0.5 * RIDGE * float(theta[1:] @ theta[1:]) - float(np.log(inside).sum())
        return total, RIDGE * np.append(0.0, theta[1:]) + np.einsum("tm,tmf->f", slope, self.X)


def fitted(trials: Sequence[Trial]) -> Doubles:
    """Return (bias, weights) of the greatest likelihood."""
    start = np.append(-10.0, np.ones(len(NAMES) - 1))
    bounds = [(None, None)] + [(0.0, None)] * (len(NAMES) - 1)
    return np.asarray(
        minimize(Table.of(trials).likelihood, start, method="L-BFGS-B", jac=True, bounds=bounds).x
    )


def best_of(theta: Doubles, trial: Trial) -> tuple[float, bool]:
    """Return the probability of a trial's best mode and whether it is right."""
    if not len(trial.figures):
        return 0.0, False
    s = np.append(theta[0] + trial.figures @ theta[1:], 0.0)
    p = np.exp(s - s.max())
    k = int(p[:-1].argmax())
    return float(p[k] / p.sum()), bool(trial.right[k])


def summary(outcomes: Iterable[tuple[Trial, float, bool]]) -> list[str]:
    """Return lines: calibration and the greatest wrong probability, then accepted and right per set."""
    rows = list(outcomes)
    p, y = np.array([r[1] for r in rows]), np.array([r[2] for r in rows])
    lines = [
        f"ECE {expected_calibration_error(p, y):.4f}, highest probability of a wrong one {p[~y].max():.3f}"
    ]
    for accept in (0.65, 0.7, 0.75, 0.8, 0.85, 0.9):
        same = Counter(t.dataset for t, _, _ in rows if t.kind is Kind.SAME)
        good = Counter(t.dataset for t, q, right in rows if right and q >= accept)
        wrong = sum(q >= accept and not right for _, q, right in rows)
        shares = ", ".join(f"{name} {good[name] / n:.3f}" for name, n in same.items())
        lines.append(f"  accepted from {accept}: wrong {wrong}; right {shares}")
    return lines


def main() -> None:
    """Collect, fit, validate, print; write if asked to."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("datasets", nargs="+")
    parser.add_argument("--turns", type=int, default=2)
    parser.add_argument("--parts", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--tolerance", action="append", default=[], metavar="NAME=m,deg")
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    special = {}
    for text in options.tolerance:
        name, _, values = text.partition("=")
        metres, degrees = (float(v) for v in values.split(","))
        special[name] = Tolerance.of(metres, degrees)
    jobs = []
    for d in map(read_dataset, options.datasets):
        for pair in d.pairs:
            job = d.name, pair, pair.tolerance or special.get(d.name, d.tolerance)
            jobs += [(*job, turn, 0, options.seed) for turn in range(options.turns + 1)]
            if pair.T_1_2 is not None:
                jobs += [(*job, part, part, options.seed) for part in range(1, options.parts + 1)]
    with ProcessPoolExecutor(options.workers) as pool:
        trials = list(pool.map(tried, *zip(*jobs, strict=True), chunksize=16))
    theta = fitted(trials)
    print(f"{len(trials)} trials;", *(f"{n} {v:.4f}" for n, v in zip(NAMES, theta, strict=True)))
    print("fitted on all:", *summary((t, *best_of(theta, t)) for t in trials), sep="\n")
    outcomes: dict[str, tuple[Trial, float, bool]] = {}
    for building in sorted(set().union(*(t.buildings for t in trials))):
        left_out = fitted([t for t in trials if building not in t.buildings])
        for t in trials:
            if building in t.buildings:
                # A pair of two buildings is left out with either; the more doubtful outcome counts.
                p, right = best_of(left_out, t)
                if t.name + t.dataset not in outcomes or p > outcomes[t.name + t.dataset][1]:
                    outcomes[t.name + t.dataset] = (t, p, right)
    print("each building judged by coefficients that never saw it:", *summary(outcomes.values()), sep="\n")
    if options.write:
        bias, *of_figures, chance = (round(float(value), 4) for value in theta)
        weights = dict(zip(FIGURES, of_figures, strict=True))
        text = json.dumps({"bias": bias, "weights": weights, "chance": chance}, indent=2)
        COEFFICIENTS.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
