from itertools import combinations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from pose_graphs import pairs_of

from mapmeld.merging.graph.cuts import min_cut, weakest_cuts

WEIGHTS = st.integers(2, 6).flatmap(
    lambda n: st.tuples(st.just(n), st.lists(st.integers(0, 5), min_size=n * (n - 1) // 2, max_size=15))
)


def graph(count: int, weights: list[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rows = [(i, j, w) for (i, j), w in zip(pairs_of(count), weights, strict=False) if w]
    i, j, w = (np.array([row[k] for row in rows]) for k in range(3))
    return i.astype(np.intp), j.astype(np.intp), w.astype(np.float64)


def least(count: int, i: np.ndarray, j: np.ndarray, w: np.ndarray, s: int, t: int) -> float:
    """By looking at every way to part the nodes."""
    others = [k for k in range(count) if k not in (s, t)]
    values = []
    for size in range(len(others) + 1):
        for chosen in combinations(others, size):
            side = np.isin(np.arange(count), [s, *chosen])
            values.append(float(w[side[i] != side[j]].sum()))
    return min(values)


@settings(max_examples=50)
@given(WEIGHTS)
def test_the_least_cut_of_all(drawn: tuple[int, list[int]]) -> None:
    count, weights = drawn
    i, j, w = graph(count, weights)
    value, side = min_cut(count, i, j, w, np.array([0]), np.array([count - 1]))
    assert value == least(count, i, j, w, 0, count - 1)
    assert side[0]
    assert not side[count - 1]
    assert w[side[i] != side[j]].sum() == value


@settings(max_examples=50)
@given(WEIGHTS)
def test_the_weakest_cuts_hold_a_least_one_for_any_two_nodes(drawn: tuple[int, list[int]]) -> None:
    count, weights = drawn
    i, j, w = graph(count, weights)
    cuts = list(weakest_cuts(count, i, j, w))
    for value, side in cuts:
        assert w[side[i] != side[j]].sum() == value
    for s, t in combinations(range(count), 2):
        expected = least(count, i, j, w, s, t)
        if expected:
            assert min(value for value, side in cuts if side[s] != side[t]) == expected


def test_nodes_tied_together() -> None:
    i, j, w = graph(4, [1, 0, 0, 2, 0, 3])  # a chain 0 - 1 - 2 - 3
    value, side = min_cut(4, i, j, w, np.array([0]), np.array([2, 3]))
    assert (value, side.tolist()) == (1.0, [True, False, False, False])
    value, side = min_cut(4, i, j, w, np.array([0, 1]), np.array([3]))
    assert (value, side.tolist()) == (2.0, [True, True, False, False])


def test_what_is_given_is_never_cut_before_what_is_not() -> None:
    i, j = np.array([0, 1]), np.array([1, 2])
    value, side = min_cut(3, i, j, np.array([np.inf, 4.6]), np.array([0]), np.array([2]))
    assert (round(value, 3), side.tolist()) == (4.6, [True, True, False])


def test_no_edges() -> None:
    none = np.zeros(0, np.intp)
    assert list(weakest_cuts(3, none, none, np.zeros(0))) == []
    assert min_cut(2, none, none, np.zeros(0), np.array([0]), np.array([1]))[0] == 0
