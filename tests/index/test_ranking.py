import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.index.ranking import Ranking, likely_pairs
from mapmeld.index.signature import Signature, word_count


def signature(counts: dict[int, int]) -> Signature:
    weights = np.zeros(word_count(), np.uint8)
    for word, count in counts.items():
        weights[word] = count
    return Signature(weights)


signatures = st.lists(
    st.dictionaries(st.integers(0, 20), st.integers(1, 50), max_size=8).map(signature), min_size=1, max_size=6
)


@given(signatures)
def test_scores_are_cosines(found: list[Signature]) -> None:
    ranking = Ranking.of(found)
    for n, one in enumerate(found):
        scores = ranking.scores(one)
        assert scores.shape == (len(found),)
        assert ((scores >= 0) & (scores <= 1 + 1e-6)).all()
        if one.weights.any():
            assert abs(scores[n] - 1) < 1e-6
            order, best = ranking.best(one)
            assert (np.diff(best) <= 0).all()
            assert n in order


def test_a_rare_word_tells_more_than_a_common_one() -> None:
    common = [signature({0: 5, 10 + n: 1}) for n in range(8)]
    rare = signature({1: 5, 30: 1})
    scores = Ranking.of([*common, rare]).scores(signature({0: 5, 1: 5}))
    assert scores[8] > scores[:8].max()


def test_likely_pairs_are_those_of_the_nearest_from_either_side() -> None:
    near = [
        signature({0: 3, 1: 3}),
        signature({0: 3, 2: 3}),
        signature({5: 1, 6: 1}),
        signature({5: 1, 7: 1}),
    ]
    assert likely_pairs(near, 1) == [(0, 1), (2, 3)]
    assert likely_pairs(near, 3) == [(0, 1), (2, 3)]  # maps with no word in common are no candidates
    assert likely_pairs([], 2) == []
