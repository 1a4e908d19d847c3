import io
import math

import pytest
from rich.console import Console
from tiny_dataset import elsewhere, row, wrong

from mapmeld.evaluation import Summary, TrialRow, markdown_table, rich_table, summaries
from mapmeld.evaluation.tables import grouped

# Ten trials whose figures can be counted on the fingers.
TRIALS = [
    row("1", translation_error=0.1, rotation_error=math.radians(1), seconds=1.0),
    row("2", translation_error=0.2, rotation_error=math.radians(3), seconds=2.0),
    row("3", translation_error=0.4, rotation_error=math.radians(2), seconds=3.0),
    row("4", verdict="rejected", seconds=4.0, similarity=0.1),
    row("5", verdict="ambiguous", seconds=5.0, similarity=0.4),
    wrong("6", seconds=6.0, similarity=0.2),
    wrong("7", verdict="rejected", seconds=7.0, similarity=0.3),
    wrong("8", verdict="error", seconds=0.001, x=None, y=None, theta=None, similarity=0.0),
    elsewhere("9", verdict="rejected", seconds=9.0, similarity=0.0),
    elsewhere("10", seconds=10.0, similarity=0.1),
]


def only(rows: list[TrialRow]) -> Summary:
    (summary,) = summaries(rows)
    return summary


def test_a_summary_counted_by_hand() -> None:
    s = only(TRIALS)
    assert (s.dataset, s.method, s.same, s.different) == ("set", "m", 8, 2)
    assert (s.accepted_right, s.guess_right, s.ambiguous) == (3 / 8, 5 / 8, 1 / 8)
    assert (s.wrong_accepts_same, s.wrong_accepts_different, s.errors) == (1, 1, 1)
    assert s.translation_error == pytest.approx(0.2)
    assert s.rotation_error == pytest.approx(math.radians(2))
    assert s.seconds == 5.0  # of the nine that did not fail
    assert s.seconds_p95 == pytest.approx(9.6)
    # By similarity: three at 0.5 and one at 0.4 are above the best wrong one, of 0.3.
    assert s.recall_without_wrong == 4 / 8
    assert (s.calibration_error, s.brier, s.time_ratio) == (None, None, None)


def test_probabilities_count_over_all_trials_that_state_one() -> None:
    rows = [row("1", probability=0.9), wrong("2", probability=0.4), elsewhere("3", probability=0.2), row("4")]
    s = only(rows)
    assert s.brier == pytest.approx((0.01 + 0.16 + 0.04) / 3)
    assert s.calibration_error == pytest.approx((0.1 + 0.4 + 0.2) / 3)  # three answers, three bins


def test_the_ratio_is_the_median_of_the_pairs_own_ratios() -> None:
    times = [(1.0, 2.0), (3.0, 1.0), (5.0, 4.0), (9.0, None)]
    rows = [row(str(n), seconds=a, against_seconds=b) for n, (a, b) in enumerate(times)]
    assert only(rows).time_ratio == 1.25


def test_a_method_that_always_fails_has_no_time() -> None:
    s = only([wrong(verdict="error", x=None, seconds=0.001, against_seconds=1.0)])
    assert (s.errors, s.seconds, s.seconds_p95, s.time_ratio) == (1, None, None, None)
    assert "| 1 |" in markdown_table([s])


def test_only_different_places() -> None:
    s = only([elsewhere(verdict="rejected")])
    assert (s.same, s.accepted_right, s.recall_without_wrong, s.translation_error) == (0, None, None, None)


def test_a_line_per_data_set_and_method_in_order() -> None:
    rows = [row(dataset=d, method=m) for d in ("z", "a") for m in ("second", "first")]
    assert [(s.dataset, s.method) for s in summaries(rows)] == [
        ("z", "second"),
        ("z", "first"),
        ("a", "second"),
        ("a", "first"),
    ]


def test_several_settings_of_one_method_are_told_apart() -> None:
    rows = [row("1", parameters="{}"), row("1", parameters='{"corners": 7}'), row("2", parameters="{}")]
    assert {key: len(group) for key, group in grouped(rows).items()} == {("set", "m 1"): 2, ("set", "m 2"): 1}


def test_markdown_by_hand() -> None:
    lines = markdown_table(summaries(TRIALS)).splitlines()
    assert [cell.strip() for cell in lines[2].strip("|").split("|")] == [
        *("set", "m", "8 / 2", "37.5", "62.5", "12.5", "1 / 1", "1", "50.0", "–", "–"),
        *("0.200", "2.000", "5.0000", "9.6000"),
    ]
    assert {line.count("|") for line in lines} == {16}
    assert "time ratio" not in lines[0]


def test_the_ratio_has_a_column_once_something_was_timed() -> None:
    text = markdown_table(summaries([row(seconds=3.0, against_seconds=2.0)]))
    assert text.splitlines()[0].endswith("| time ratio |")
    assert text.splitlines()[2].endswith("| 1.50 |")


def test_names_cannot_break_the_markdown() -> None:
    text = markdown_table(summaries([row(dataset="a|b")]))
    assert r"| a\|b | m |" in text


def printed(width: int | None) -> str:
    out = io.StringIO()
    console = Console(file=out, width=width or 400, color_system=None)
    console.print(rich_table(summaries(TRIALS), width))
    return out.getvalue()


def test_a_wide_terminal_shows_what_the_markdown_shows() -> None:
    cells = [cell.strip() for cell in markdown_table(summaries(TRIALS)).splitlines()[2].strip("|").split("|")]
    assert printed(None).splitlines()[-1].split() == " ".join(cells).split()


@pytest.mark.parametrize("width", [80, 100, 120, 200])
def test_a_narrow_terminal_loses_columns_but_no_digits(width: int) -> None:
    text = printed(width)
    assert all(len(line.rstrip()) <= width for line in text.splitlines())
    assert "37.5" in text
    assert "62.5" in text
    assert "1 / 1" in text
    assert "5.0000" in text
    assert ("left out, the terminal is too narrow: Brier" in text) == (
        "Brier" not in text.split("left out")[0]
    )
    assert "…" not in text


def test_wrong_accepts_and_errors_stand_out() -> None:
    def red(rows: list[TrialRow]) -> list[str]:
        console = Console(width=400, color_system="standard", force_terminal=True)
        segments = console.render(rich_table(summaries(rows)))
        return [s.text.strip() for s in segments if s.style and s.style.color and s.text.strip()]

    assert red(TRIALS) == ["1 / 1", "1"]
    assert red([row()]) == []
