from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.evaluation.calibration import (
    ReliabilityBin,
    brier_score,
    expected_calibration_error,
    precision_recall,
    recall_without_wrong,
    reliability,
)

answers = st.lists(st.tuples(st.floats(0, 1), st.booleans()), min_size=1, max_size=60)


def test_bins_counted_by_hand() -> None:
    probability = [0.9, 0.1, 0.7, 0.3, 0.8]
    right = [True, False, False, True, True]
    # Sorted: 0.1 no, 0.3 yes, 0.7 no | 0.8 yes, 0.9 yes.
    first, second = reliability(probability, right, bins=2)
    assert (first.count, second.count) == (3, 2)
    assert [first.stated, first.observed] == pytest.approx([1.1 / 3, 1 / 3])
    assert [second.stated, second.observed] == pytest.approx([0.85, 1.0])
    by_hand = (3 * (1.1 / 3 - 1 / 3) + 2 * 0.15) / 5
    assert expected_calibration_error(probability, right, bins=2) == pytest.approx(by_hand)


def test_brier_score_by_hand() -> None:
    assert brier_score([1.0, 0.5, 0.2], [True, True, False]) == pytest.approx((0 + 0.25 + 0.04) / 3)


def test_without_answers_there_is_nothing_to_say() -> None:
    assert reliability([], []) == ()
    assert expected_calibration_error([], []) is None
    assert brier_score([], []) is None
    assert precision_recall([], [], 3).recall.size == 0


def test_fewer_answers_than_bins_are_a_bin_each() -> None:
    assert [b.count for b in reliability([0.2, 0.4, 0.9], [0, 0, 1])] == [1, 1, 1]


def test_equal_probabilities_share_their_outcome() -> None:
    # Sorted by outcome within the tie, two bins would look as if 0.5 meant "never" and "always".
    assert expected_calibration_error([0.5] * 4, [False, False, True, True], bins=2) == pytest.approx(0)


@given(answers, st.randoms())
def test_the_order_of_answers_does_not_matter(given_: list[tuple[float, bool]], rng: Random) -> None:
    shuffled = rng.sample(given_, len(given_))
    plain, other = (
        expected_calibration_error([p for p, _ in listed], [y for _, y in listed], bins=4)
        for listed in (given_, shuffled)
    )
    assert plain == pytest.approx(other, abs=1e-12)


@given(answers)
def test_bins_are_of_equal_count_and_keep_the_totals(given_: list[tuple[float, bool]]) -> None:
    p, y = map(list, zip(*given_, strict=True))
    curve = reliability(p, y)
    counts = [b.count for b in curve]
    assert sum(counts) == len(p)
    assert max(counts) - min(counts) <= 1
    assert sum(b.count * b.stated for b in curve) == pytest.approx(sum(p))
    assert sum(b.count * b.observed for b in curve) == pytest.approx(sum(y))


@pytest.mark.parametrize("probability", [[1.1], [-0.1], [float("nan")]])
def test_what_is_no_probability_is_refused(probability: list[float]) -> None:
    with pytest.raises(ValueError, match="from 0 to 1"):
        reliability(probability, [True])


def test_lengths_must_agree() -> None:
    with pytest.raises(ValueError, match="as many outcomes"):
        brier_score([0.5, 0.5], [True])
    with pytest.raises(ValueError, match="as many outcomes"):
        precision_recall([0.5, 0.5], [True])


def test_wilson_interval_from_the_formula() -> None:
    # 9 of 10 at z = 1.96, worked out on paper: (0.9 + 0.19208 -+ 0.25506) / 1.38416.
    low, high = ReliabilityBin(10, 0.5, 0.9).interval()
    assert low == pytest.approx(0.59585, abs=1e-4)
    assert high == pytest.approx(0.98212, abs=1e-4)


def test_precision_and_recall_by_hand() -> None:
    curve = precision_recall([0.9, 0.8, 0.8, 0.4], [True, True, False, True], to_find=4)
    assert curve.threshold.tolist() == [0.9, 0.8, 0.4]
    assert curve.precision == pytest.approx([1, 2 / 3, 3 / 4])
    assert curve.recall == pytest.approx([1 / 4, 2 / 4, 3 / 4])


def test_recall_counts_what_was_found_unless_told() -> None:
    assert precision_recall([0.9, 0.4], [True, False]).recall.tolist() == [1, 1]
    with pytest.raises(ValueError, match="only 0 to find"):
        precision_recall([0.9], [True], to_find=0)


def test_recall_without_a_wrong_accept() -> None:
    scores, right = [0.9, 0.8, 0.7, 0.6], [True, True, False, True]
    assert recall_without_wrong(scores, right) == pytest.approx(2 / 3)
    assert recall_without_wrong(scores, right, to_find=4) == pytest.approx(2 / 4)
    assert recall_without_wrong([0.7, 0.7], [True, False]) == 0  # a threshold cannot part equals
    assert recall_without_wrong([0.7, 0.1], [True, True]) == 1
    assert recall_without_wrong([0.7], [False]) is None


@given(answers)
def test_recall_without_wrong_is_where_the_curve_leaves_full_precision(
    given_: list[tuple[float, bool]],
) -> None:
    s, y = map(list, zip(*given_, strict=True))
    if any(y):
        curve = precision_recall(s, y)
        best = np.max(curve.recall[curve.precision == 1], initial=0.0)
        assert recall_without_wrong(s, y) == pytest.approx(best)
