"""The figures of the experiment: Table 1, successes, navigability, times."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from mapmeld.evaluation.calibration import brier_score, expected_calibration_error
from mapmeld.experiment.folder import ELSEWHERE, ENVIRONMENTS, JOINS, MAPPINGS, MATCHINGS, NAVIGABILITY
from mapmeld.experiment.results import Results
from mapmeld.experiment.rows import MatchingRow, NavigabilityRow
from mapmeld.experiment.settings import PAPER_METHOD, strategy_of


@dataclass(frozen=True, slots=True)
class Column:
    """A column of Table 1: accuracies by Equation 3; None where there are too few values."""

    count: int
    mean: float | None
    median: float | None
    deviation: float | None

    @classmethod
    def of(cls, values: Sequence[float]) -> Column:
        """Sum up values; the deviation is that of a sample (n - 1)."""
        return cls(
            len(values),
            statistics.fmean(values) if values else None,
            statistics.median(values) if values else None,
            statistics.stdev(values) if len(values) > 1 else None,
        )


PAPER_SINGLE = Column(50, 0.929006, 0.926777, 0.020205)
PAPER_MATCHED = Column(79, 0.927027, 0.931214, 0.021912)
"""The paper's Table 1, and its 79 successes of 100."""

PAPER_SUCCESSES, PAPER_MATCHINGS = 79, 100


def method_label(method: str) -> str:
    """Return what a method is called in tables and pictures."""
    if method == PAPER_METHOD:
        return "paper's method"
    return "default method" if method == "correlative" else method


def method_description(method: str) -> str:
    """Return a method's name and strategy."""
    algorithm = "Algorithm 1" if strategy_of(method) == "paper" else "evidence over time"
    return f"{method}, {algorithm}"


def table_1(results: Results) -> dict[str, Column]:
    """Return our columns of Table 1: single mappings under "", then the successes of each method."""
    columns = {"": Column.of([row.accuracy for row in results.mappings])}
    for method in results.methods:
        columns[method] = Column.of(
            [m.accuracy for m in results.matchings_of(method) if m.accuracy is not None]
        )
    return columns


@dataclass(frozen=True, slots=True)
class Successes:
    """How matchings came out.

    Attributes
    ----------
    total
        All of them.
    right
        Successes: the final best is right, whatever the method says of it. What the paper counts.
    accepted_right, accepted_wrong
        What the method itself holds for right, and it is, or is not.
    """

    total: int
    right: int
    accepted_right: int
    accepted_wrong: int

    @classmethod
    def of(cls, rows: Iterable[MatchingRow]) -> Successes:
        """Count."""
        listed = list(rows)
        return cls(
            len(listed),
            sum(row.right for row in listed),
            sum(row.right and row.accepted for row in listed),
            sum(row.accepted and not row.right for row in listed),
        )


def kind_of_cause(cause: str) -> str:
    """Return the part of a failure's cause that failures have in common."""
    return cause.partition(":")[0]


def joined(results: Results, method: str) -> dict[int, int]:
    """Return how many of a method's successes could be joined up to (at least) so many mappings, from 2."""
    rows = [row for row in results.joins if row.method == method]
    most = max((len(row.members) for row in rows), default=0)
    return {size: sum(len(row.members) >= size for row in rows) for size in range(2, most + 1)}


@dataclass(frozen=True, slots=True)
class Ways:
    """Navigability of several maps together; shares are of all planned or all pairs."""

    maps: int
    pairs: int
    reachable_map: int
    reachable_truth: int
    false_passages: int
    false_blocks: int
    length_ratio: float | None

    @classmethod
    def of(cls, rows: Sequence[NavigabilityRow]) -> Ways:
        """Add up."""
        ratios = [ratio for row in rows for ratio in row.length_ratios]
        return cls(
            len(rows),
            sum(row.pairs for row in rows),
            sum(row.reachable_map for row in rows),
            sum(row.reachable_truth for row in rows),
            sum(row.false_passages for row in rows),
            sum(row.false_blocks for row in rows),
            statistics.median(ratios) if ratios else None,
        )


def ways_by_kind(results: Results) -> dict[str, Ways]:
    """Return navigability of single mappings, and of each method's merges of two and of more mappings."""
    wanted: dict[str, Callable[[NavigabilityRow], bool]] = {"single mappings": lambda row: not row.method}
    for method in results.methods:
        label = method_label(method)
        wanted[f"{label}, two merged"] = lambda row, m=method: row.method == m and len(row.members) == 2  # type: ignore[misc]
        wanted[f"{label}, three to all merged"] = lambda row, m=method: (
            row.method == m and len(row.members) > 2
        )  # type: ignore[misc]
    found = {name: [row for row in results.ways if test(row)] for name, test in wanted.items()}
    return {name: Ways.of(rows) for name, rows in found.items() if rows}


@dataclass(frozen=True, slots=True)
class Stated:
    """What a method's stated probabilities are worth, over one environment's pairs and different ones'."""

    probability: tuple[float, ...]
    right: tuple[bool, ...]
    elsewhere: tuple[bool, ...]

    @property
    def calibration_error(self) -> float | None:
        """Expected calibration error, in ten bins of equal count."""
        return expected_calibration_error(self.probability, self.right)

    @property
    def brier(self) -> float | None:
        """Score of Brier."""
        return brier_score(self.probability, self.right)


def stated_probabilities(results: Results, method: str) -> Stated:
    """Return what a method stated, and whether it was right; empty if it states none."""
    same = [
        (r.probability, r.right, False) for r in results.matchings_of(method) if r.probability is not None
    ]
    other = [
        (r.probability, False, True)
        for r in results.elsewhere
        if r.method == method and r.probability is not None
    ]
    rows = same + other
    return Stated(tuple(r[0] for r in rows), tuple(r[1] for r in rows), tuple(r[2] for r in rows))


def accepted_elsewhere(results: Results, method: str) -> tuple[int, int]:
    """Return how many pairs of different environments a method accepted (each is wrong), and of how many."""
    rows = [row for row in results.elsewhere if row.method == method]
    return sum(row.accepted for row in rows), len(rows)


def computing_seconds(results: Results) -> Mapping[str, float]:
    """Return the CPU seconds of each stage, starting of processes not counted."""
    return {
        ENVIRONMENTS: sum(row.seconds for row in results.environments),
        MAPPINGS: sum(row.seconds for row in results.mappings),
        MATCHINGS: sum(row.seconds for row in results.matchings),
        JOINS: sum(row.seconds for row in results.joins),
        ELSEWHERE: sum(row.seconds for row in results.elsewhere),
        NAVIGABILITY: sum(row.seconds for row in results.ways),
    }
