import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tiny_dataset import elsewhere, row, wrong

from mapmeld.evaluation import TrialRow
from mapmeld.evaluation.plots import (
    precision_recall_figure,
    reliability_figure,
    success_figure,
    write_figures,
)
from mapmeld.extras import MissingExtraError
from mapmeld.io import MapFileError


def line_with_marker(axes: object, marker: str) -> tuple[list[float], list[float]]:
    (line,) = [line for line in axes.lines if line.get_marker() == marker]  # type: ignore[attr-defined]
    return list(map(float, line.get_xdata())), list(map(float, line.get_ydata()))


def test_reliability_shows_stated_against_observed() -> None:
    rows = [row("1", probability=0.9), wrong("2", probability=0.3), elsewhere("3", probability=0.1)]
    figure = reliability_figure(rows)
    assert figure is not None
    (axes,) = figure.axes
    assert line_with_marker(axes, "o") == ([0.1, 0.3, 0.9], [0, 0, 1])
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["m: ECE 0.167, n = 3"]


def test_several_data_sets_get_a_panel_each_and_one_together() -> None:
    figure = reliability_figure([row(dataset=name, probability=0.9) for name in ("a", "b")])
    assert figure is not None
    assert [axes.get_title() for axes in figure.axes] == ["a", "b", "all data sets"]


def test_without_probabilities_there_is_no_reliability() -> None:
    assert reliability_figure([row()]) is None


def test_success_versus_overlap_counted_by_hand() -> None:
    rows = [
        row("1", true_overlap=0.31),
        row("2", true_overlap=0.39, verdict="rejected"),
        wrong("3", true_overlap=0.3),
        row("4", true_overlap=1.0),
        elsewhere("5"),
    ]
    figure = success_figure(rows)
    assert figure is not None
    accepted, guessed = figure.axes
    middles, shares = line_with_marker(accepted, "o")
    assert middles == pytest.approx([0.35, 0.95])
    assert shares == pytest.approx([1 / 3, 1])
    assert line_with_marker(guessed, "o")[1] == pytest.approx([2 / 3, 1])
    assert [text.get_text() for text in accepted.texts] == ["3", "1"]
    assert success_figure([elsewhere()]) is None


def test_precision_and_recall_with_the_verdicts() -> None:
    rows = [
        row("1", similarity=0.9),
        row("2", similarity=0.8, verdict="rejected"),
        wrong("3", similarity=0.7),
        elsewhere("4", similarity=0.6, verdict="rejected"),
    ]
    figure = precision_recall_figure(rows)
    assert figure is not None
    (axes,) = figure.axes
    curve, verdicts = axes.lines
    assert np.asarray(curve.get_xdata()) == pytest.approx([1 / 3, 2 / 3, 2 / 3, 2 / 3])
    assert np.asarray(curve.get_ydata()) == pytest.approx([1, 1, 2 / 3, 2 / 4])
    assert (verdicts.get_xdata(), verdicts.get_ydata()) == ([1 / 3], [1 / 2])
    assert precision_recall_figure([elsewhere()]) is None


def test_methods_look_different_even_without_colours() -> None:
    rows = [row(method=f"method {n}") for n in range(10)]
    figure = success_figure(rows)
    assert figure is not None
    lines = figure.axes[0].lines
    assert len({(line.get_marker(), line.get_linestyle()) for line in lines}) == 10
    assert len(figure.legends[0].get_texts()) == 10


@pytest.mark.parametrize("datasets", [1, 4])
def test_files_are_pictures_whatever_the_number_of_panels(tmp_path: Path, datasets: int) -> None:
    rows = [row(dataset=f"costs $5 and $6, {n}", method="a_b^c", probability=0.8) for n in range(datasets)]
    files = write_figures(rows, tmp_path)
    assert [file.name for file in files] == [
        "reliability.png",
        "success_versus_overlap.png",
        "precision_recall.png",
    ]
    assert all(file.read_bytes().startswith(b"\x89PNG") for file in files)
    with pytest.raises(MapFileError, match="exists already"):
        write_figures(rows, tmp_path)
    assert write_figures(rows, tmp_path, force=True) == files


def test_only_what_there_is_something_for_is_written(tmp_path: Path) -> None:
    assert write_figures([elsewhere()], tmp_path) == ()
    assert list(tmp_path.iterdir()) == []


def test_pyplot_is_not_touched(tmp_path: Path) -> None:
    # In a fresh interpreter, as other tests may have loaded it.
    script = (
        "import sys\nsys.path.insert(0, sys.argv[1])\n"
        "from pathlib import Path\nfrom tiny_dataset import row\n"
        "from mapmeld.evaluation.plots import write_figures\n"
        "write_figures([row(probability=0.5)], Path(sys.argv[2]))\n"
        "assert 'matplotlib.figure' in sys.modules\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    tests = Path(__file__).parents[1]
    done = subprocess.run([sys.executable, "-W", "error", "-c", script, tests, tmp_path], capture_output=True)
    assert done.returncode == 0, done.stderr.decode()


def test_without_matplotlib_the_command_that_installs_it_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    rows: list[TrialRow] = [row()]
    with pytest.raises(MissingExtraError, match=r'pip install "mapmeld\[benchmark\]"'):
        success_figure(rows)
