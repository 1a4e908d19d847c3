"""Charts of an experiment: matplotlib figures with a canvas of their own."""

from __future__ import annotations

import io
from bisect import bisect_right
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mapmeld.evaluation.calibration import reliability
from mapmeld.experiment.results import Results
from mapmeld.experiment.settings import PAPER_METHOD, SAMPLE_SECONDS
from mapmeld.experiment.statistics import (
    PAPER_MATCHED,
    PAPER_SINGLE,
    method_label,
    stated_probabilities,
)
from mapmeld.extras import required

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's palette, made to be told apart by everyone; the paper's method is always the same one.
_PAPERS, _SINGLE = "#D55E00", "#6b7280"
_OTHERS = ("#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
_INK = "#1f2937"


def success_chart(results: Results) -> Figure:
    """Draw how many matchings of each environment are successes, by method."""
    numbers = [row.environment for row in results.environments]
    figure, (axes,) = _figure(1, (8.2, 3.4))
    width = 0.8 / len(results.methods)
    for i, method in enumerate(results.methods):
        rows = results.matchings_of(method)
        right = [sum(r.right for r in rows if r.environment == e) for e in numbers]
        at = np.arange(len(numbers)) + (i - (len(results.methods) - 1) / 2) * width
        label = f"{method_label(method)}: {sum(right)} of {len(rows)}"
        bars = axes.bar(at, right, width * 0.92, color=_colour(results, method), label=label)
        axes.bar_label(bars, fontsize=8, color=_INK, padding=1)
    pairs = len(results.matchings) // max(1, len(results.methods) * len(numbers))
    axes.axhline(pairs, color="0.75", linewidth=0.8, linestyle=":")
    axes.set_xticks(range(len(numbers)), [str(n) for n in numbers])
    axes.set_ylim(0, pairs * 1.12)
    axes.yaxis.set_major_locator(required("matplotlib.ticker", "reproduce").MaxNLocator(integer=True))
    axes.set_xlabel("environment")
    axes.set_ylabel(f"successes of {pairs}")
    _legend(figure)
    return figure


def accuracy_chart(results: Results) -> Figure:
    """Draw every accuracy of Table 1 as a point, its means as bars, the paper's means beside them."""
    groups: list[tuple[str, list[float], str, float | None]] = [
        ("single mappings", [r.accuracy for r in results.mappings], _SINGLE, PAPER_SINGLE.mean)
    ]
    for method in results.methods:
        values = [r.accuracy for r in results.matchings_of(method) if r.accuracy is not None]
        paper = PAPER_MATCHED.mean if method == PAPER_METHOD else None
        groups.append((f"two merged,\n{method_label(method)}", values, _colour(results, method), paper))
    figure, (axes,) = _figure(1, (8.2, 3.6))
    for at, (_, values, colour, paper) in enumerate(groups):
        # Spread as seeds of a sunflower are, so that points of the same height stay apart.
        x = at + 0.28 * (2 * ((np.arange(len(values)) * 0.6180339887) % 1) - 1)
        axes.scatter(x, values, s=13, color=colour, alpha=0.5, linewidths=0)
        if values:
            axes.hlines(np.mean(values), at - 0.36, at + 0.36, color=colour, linewidth=2.2)
        if paper is not None:
            axes.hlines(paper, at - 0.36, at + 0.36, color=_INK, linewidth=1.2, linestyle="--")
    axes.hlines([], 0, 0, color=_INK, linewidth=2.2, label="our mean")
    axes.hlines([], 0, 0, color=_INK, linewidth=1.2, linestyle="--", label="the paper's mean")
    axes.set_xticks(range(len(groups)), [name for name, *_ in groups])
    axes.set_xlim(-0.6, len(groups) - 0.4)
    axes.margins(y=0.08)
    axes.set_ylabel("accuracy (Equation 3)")
    _legend(figure)
    return figure


def over_time_chart(results: Results) -> Figure:
    """Draw, while the maps grow, how many matchings are right, and how accurate the maps are."""
    end = max((row.duration for row in results.mappings), default=0.0)
    times = np.arange(0.0, end + SAMPLE_SECONDS, SAMPLE_SECONDS)
    figure, (left, right) = _figure(2, (8.2, 3.6))
    for method in results.methods:
        colour = _colour(results, method)
        rows = results.matchings_of(method)
        at = [[(t, ok, a) for t, ok, a in row.over_time] for row in rows]
        share = [np.mean([_at(line, t, 1) is True for line in at]) for t in times] if rows else []
        left.plot(times[: len(share)], share, color=colour, linewidth=1.8, label=method_label(method))
        merged = [[_at(line, t, 2) for line in at if _at(line, t, 1) is True] for t in times]
        _band(right, times, merged, colour, f"merged, {method_label(method)}")
    single = [[_at(row.accuracy_over_time, t, 1) for row in results.mappings] for t in times]
    _band(right, times, single, _SINGLE, "single mappings")
    left.set_ylim(-0.02, 1.02)
    left.set_ylabel("share of matchings that are right")
    right.set_ylabel("accuracy (median and middle half)")
    for axes in (left, right):
        axes.set_xlabel("time since the robots set out [s]")
        axes.set_xlim(0, end)
    handles, labels = right.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=9, frameon=False)
    return figure


def reliability_chart(results: Results, method: str) -> Figure | None:
    """Draw a method's stated probabilities against the share that is right; None if it states none."""
    stated = stated_probabilities(results, method)
    if not stated.probability:
        return None
    figure, (left, right) = _figure(2, (8.2, 3.8))
    left.plot([0, 1], [0, 1], color="0.6", linewidth=1)
    curve = reliability(stated.probability, stated.right)
    x, y = np.array([b.stated for b in curve]), np.array([b.observed for b in curve])
    spread = np.abs(np.array([b.interval() for b in curve]).T - y)
    left.errorbar(
        x, y, spread, fmt="o", markersize=5, capsize=2, elinewidth=0.8, color=_colour(results, method),
        label="bins of equal count, 95 % intervals",
    )  # fmt: skip
    answers = list(zip(stated.probability, stated.right, stated.elsewhere, strict=True))
    kinds = (
        ("one environment, right", "#009E73", [p for p, ok, other in answers if ok]),
        ("one environment, wrong", "#D55E00", [p for p, ok, other in answers if not (ok or other)]),
        ("different environments", "#9ca3af", [p for p, _, other in answers if other]),
    )
    edges = np.linspace(0, 1, 21)
    below = np.zeros(20)
    for name, colour, values in kinds:
        count, _ = np.histogram(values, edges)
        right.bar(edges[:-1], count, 0.046, below, align="edge", color=colour, label=name)
        below += count
    for axes in (left, right):
        axes.set_xlim(-0.03, 1.03)
        axes.set_xlabel("stated probability")
    left.set_ylim(-0.03, 1.03)
    left.set_ylabel("share that is right")
    right.set_ylabel("answers")
    right.yaxis.set_major_locator(required("matplotlib.ticker", "reproduce").MaxNLocator(integer=True))
    _legend(figure, 2)
    return figure


def as_png(figure: Figure) -> bytes:
    """Return a figure as the content of a PNG file."""
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=160, metadata={"Software": None})
    return picture.getvalue()


# ---------------------------------------------------------------------- parts
def _colour(results: Results, method: str) -> str:
    if method == PAPER_METHOD:
        return _PAPERS
    others = [name for name in results.methods if name != PAPER_METHOD]
    return _OTHERS[others.index(method) % len(_OTHERS)]


def _at(line: Sequence[tuple[Any, ...]], time: float, part: int) -> Any:
    """Return what held at a time: a part of the last entry until then; None before the first."""
    index = bisect_right([entry[0] for entry in line], time) - 1
    return None if index < 0 else line[index][part]


def _band(
    axes: Axes, times: NDArray[np.float64], values: Sequence[Sequence[float | None]], colour: str, label: str
) -> None:
    """Draw the median over time, and where the middle half of the values lies; from three values on."""
    known = [[v for v in some if v is not None] for some in values]
    enough = [i for i, some in enumerate(known) if len(some) >= 3] or [
        i for i, some in enumerate(known) if some
    ]
    low, middle, high = (
        [float(np.percentile(known[i], percent)) for i in enough] for percent in (25, 50, 75)
    )
    axes.fill_between(times[enough], low, high, color=colour, alpha=0.15, linewidth=0)
    axes.plot(times[enough], middle, color=colour, linewidth=1.8, label=label)


def _figure(panels: int, size: tuple[float, float]) -> tuple[Figure, list[Axes]]:
    figure: Figure = required("matplotlib.figure", "reproduce").Figure(size, layout="constrained")
    required("matplotlib.backends.backend_agg", "reproduce").FigureCanvasAgg(figure)
    found = list(figure.subplots(1, panels, squeeze=False)[0])
    for axes in found:
        axes.tick_params(labelsize=9, colors=_INK)
        axes.grid(axis="y", color="0.92", linewidth=0.8)
        axes.set_axisbelow(True)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    return figure, found


def _legend(figure: Figure, columns: int = 4) -> None:
    pairs: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            pairs.setdefault(label, handle)
    figure.legend(
        handles=list(pairs.values()),
        labels=list(pairs),
        loc="outside lower center",
        ncols=columns,
        fontsize=9,
        frameon=False,
    )
