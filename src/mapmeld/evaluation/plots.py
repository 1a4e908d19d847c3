"""The outcome of a benchmark in pictures: reliability, success versus overlap, precision and recall.

Figures are matplotlib objects with a canvas of their own; pyplot and its global state are not used.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mapmeld.evaluation.calibration import expected_calibration_error, precision_recall, reliability
from mapmeld.evaluation.pairs import Kind
from mapmeld.evaluation.rows import TrialRow
from mapmeld.evaluation.tables import grouped
from mapmeld.extras import required
from mapmeld.io.atomic import write_files
from mapmeld.matching import Verdict

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's palette, made to be told apart by everyone (without its yellow, too pale for lines).
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000", "#56B4E9", "#E69F00")
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*", "<", ">")
_LINES = ("-", "--", "-.", ":")
_GREY = "0.55"

_OVERLAP_STEP = 0.1
_PANEL = (4.3, 3.7)  # inches

Rows = Sequence[TrialRow]
Style = dict[str, Any]
Panel = tuple[str, Mapping[str, Rows], Callable[["Axes", Mapping[str, Rows]], None]]
"""Title, rows by method, and what draws them."""


def reliability_figure(rows: Iterable[TrialRow]) -> Figure | None:
    """Draw stated probability against the share that is right, in ten bins of equal count.

    One panel per data set, and one for all together if there are several; bars are 95 percent intervals.
    None if no method states probabilities.
    """
    stated = [row for row in rows if row.probability is not None]
    if not stated:
        return None
    parts = _per_dataset(stated)
    if len(parts) > 1:
        parts["all data sets"] = _by_method(stated, None)
    styles = _styles(stated)

    def draw(axes: Axes, methods: Mapping[str, Rows]) -> None:
        axes.plot([0, 1], [0, 1], color=_GREY, linewidth=1, zorder=1)
        for method, group in methods.items():
            p = [row.probability for row in group if row.probability is not None]
            right = [row.right for row in group]
            curve = reliability(p, right)
            x, y = np.array([b.stated for b in curve]), np.array([b.observed for b in curve])
            intervals = np.array([b.interval() for b in curve])
            spread = np.abs(intervals.T - y)
            error = expected_calibration_error(p, right)
            label = f"{method}: ECE {error:.3f}, n = {len(p)}"
            axes.errorbar(x, y, spread, label=label, capsize=2, elinewidth=0.8, **styles[method])
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), fontsize=8, frameon=False)
        _unit_axes(axes, "stated probability", "share that is right")
        axes.set_aspect("equal")

    panels = [(name, methods, draw) for name, methods in parts.items()]
    return _figure("Reliability: what a stated probability is worth", panels, _columns(len(panels)))


def success_figure(rows: Iterable[TrialRow]) -> Figure | None:
    """Draw the share of pairs of the same place that succeed against their true overlap, in steps of 0.1.

    Two panels per data set: accepted and right above, best guess right (whatever the verdict) below; the
    small figures count the pairs. None if there are no pairs of the same place.
    """
    same = [row for row in rows if row.kind == Kind.SAME and row.true_overlap is not None]
    if not same:
        return None
    styles = _styles(same)
    datasets = list(_per_dataset(same).items())
    columns = len(datasets) if len(datasets) <= 4 else 3

    def drawing(
        success: Callable[[TrialRow], bool], label: str
    ) -> Callable[[Axes, Mapping[str, Rows]], None]:
        def draw(axes: Axes, methods: Mapping[str, Rows]) -> None:
            counts: dict[float, int] = {}
            for method, group in methods.items():
                bins = _overlap_bins(group)
                middles = [(step + 0.5) * _OVERLAP_STEP for step in bins]
                shares = [np.mean([success(row) for row in part]) for part in bins.values()]
                axes.plot(middles, shares, **styles[method])
                counts |= dict(zip(middles, (len(part) for part in bins.values()), strict=True))
            for x, count in counts.items():
                axes.text(x, 1.09, str(count), ha="center", va="center", fontsize=7, color="0.3")
            _unit_axes(axes, "true overlap", label)
            axes.set_ylim(-0.03, 1.14)

        return draw

    accepted = drawing(lambda row: row.right and row.verdict == Verdict.ACCEPTED, "accepted and right")
    guessed = drawing(lambda row: row.right, "best guess right")
    panels: list[Panel | None] = []
    for start in range(0, len(datasets), columns):
        line = datasets[start : start + columns]
        gaps = [None] * (columns - len(line))
        for draw in (accepted, guessed):
            panels += [*((name, methods, draw) for name, methods in line), *gaps]
    return _figure("Success versus overlap", panels, columns, styles)


def precision_recall_figure(rows: Iterable[TrialRow]) -> Figure | None:
    """Draw precision against recall of accepting by probability, or by similarity where none is stated.

    Recall counts all pairs of the same place. Large open signs are what the methods' own verdicts gave.
    None if there are no pairs of the same place.
    """
    listed = list(rows)
    found = {row.dataset for row in listed if row.kind == Kind.SAME}
    listed = [row for row in listed if row.dataset in found]
    if not listed:
        return None
    styles = _styles(listed)

    def draw(axes: Axes, methods: Mapping[str, Rows]) -> None:
        for method, group in methods.items():
            same = sum(row.kind == Kind.SAME for row in group)
            guessed = [row for row in group if row.x is not None]
            curve = precision_recall([row.score for row in guessed], [row.right for row in guessed], same)
            style = styles[method] | {"marker": ""}
            axes.plot(curve.recall, curve.precision, drawstyle="steps-pre", **style)
            accepted = [row for row in group if row.verdict == Verdict.ACCEPTED]
            if accepted:
                good = sum(row.right for row in accepted)
                ring = styles[method] | {"linestyle": "", "markersize": 10, "markerfacecolor": "none"}
                axes.plot(
                    [good / same],
                    [good / len(accepted)],
                    **ring,
                    markeredgewidth=1.6,
                    clip_on=False,
                    zorder=5,
                )
        _unit_axes(axes, "recall: accepted and right / same place", "precision: right / accepted")

    title = "Precision and recall (by probability, else by similarity; large open sign: the verdicts)"
    panels = [(name, methods, draw) for name, methods in _per_dataset(listed).items()]
    return _figure(title, panels, _columns(len(panels)), styles)


FIGURES: Mapping[str, Callable[[Iterable[TrialRow]], Figure | None]] = {
    "reliability.png": reliability_figure,
    "success_versus_overlap.png": success_figure,
    "precision_recall.png": precision_recall_figure,
}


def write_figures(rows: Sequence[TrialRow], folder: Path, *, force: bool = False) -> tuple[Path, ...]:
    """Write all figures that the rows have something for, as PNG, and return their paths.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    MapFileError
        A file exists and `force` is not set, or the disk refuses.
    """
    written = []
    for name, draw in FIGURES.items():
        figure = draw(rows)
        if figure is not None:
            picture = io.BytesIO()
            figure.savefig(picture, format="png", dpi=150)
            write_files([(folder / name, [picture.getbuffer()])], force=force)
            written.append(folder / name)
    return tuple(written)


# ---------------------------------------------------------------------- parts of figures
def _by_method(rows: Iterable[TrialRow], dataset: str | None) -> dict[str, Rows]:
    """Return the rows of one data set, or of all, by the method's name as in the tables."""
    found: dict[str, Rows] = {}
    for (name, method), group in grouped(rows).items():
        if dataset in (None, name):
            found[method] = [*found.get(method, ()), *group]
    return found


def _per_dataset(rows: Rows) -> dict[str, Mapping[str, Rows]]:
    return {name: _by_method(rows, name) for name in dict.fromkeys(row.dataset for row in rows)}


def _styles(rows: Iterable[TrialRow]) -> dict[str, Style]:
    """Return how each method is drawn: colour, sign and dashes differ, so that any one is enough."""
    names = list(dict.fromkeys(method for _, method in grouped(rows)))
    return {
        name: {
            "color": _COLOURS[i % len(_COLOURS)],
            "marker": _MARKERS[i % len(_MARKERS)],
            "linestyle": _LINES[i % len(_LINES)],
            "markersize": 5,
            "linewidth": 1.6,
        }
        for i, name in enumerate(names)
    }


def _overlap_bins(rows: Rows) -> dict[int, Rows]:
    bins: dict[int, list[TrialRow]] = {}
    last = round(1 / _OVERLAP_STEP) - 1
    for row in rows:
        if row.true_overlap is not None:
            # The hair's breadth keeps 0.3 / 0.1, a little under 3 in floating point, out of bin 2.
            bins.setdefault(min(last, int(row.true_overlap / _OVERLAP_STEP + 1e-9)), []).append(row)
    return dict(sorted(bins.items()))


def _unit_axes(axes: Axes, x: str, y: str) -> None:
    axes.set_xlim(-0.03, 1.03)
    axes.set_ylim(-0.03, 1.03)
    axes.set_xlabel(x, fontsize=9)
    axes.set_ylabel(y, fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(color="0.9", linewidth=0.7)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _columns(panels: int) -> int:
    """Return how many panels stand side by side: up to three, and four in a square."""
    return 2 if panels == 4 else min(3, panels)


def _figure(
    title: str, panels: Sequence[Panel | None], columns: int, styles: Mapping[str, Style] | None = None
) -> Figure:
    """Lay panels out, None for a gap; with `styles`, one legend for all of them stands below."""
    figure_module = required("matplotlib.figure", "benchmark")
    agg = required("matplotlib.backends.backend_agg", "benchmark")
    lines = -(-len(panels) // columns)
    width, height = _PANEL
    figure: Figure = figure_module.Figure(
        (max(6.4, width * columns), height * lines + 1.0), layout="constrained"
    )
    agg.FigureCanvasAgg(figure)
    grid = figure.subplots(lines, columns, squeeze=False)
    for axes, panel in zip_longest(grid.flat, panels):
        if panel is None:
            axes.set_axis_off()
            continue
        name, methods, draw = panel
        draw(axes, methods)
        axes.set_title(_literal(name), fontsize=10, pad=8)
    figure.suptitle(title, fontsize=11)
    if styles:
        line = required("matplotlib.lines", "benchmark").Line2D
        signs = [line([], [], **style) for style in styles.values()]
        names = [_literal(name) for name in styles]
        figure.legend(
            signs, names, loc="outside lower center", ncols=4, fontsize=9, frameon=False, handlelength=3
        )
    return figure


def _literal(name: str) -> str:
    """Keep matplotlib from reading dollar signs in a name as a formula."""
    return name.replace("$", r"\$")
