import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pose_graphs import SURE, Synthetic, apart, pairs_of, synthetic

from mapmeld.merging.graph.consistency import (
    Consistent,
    Overlooked,
    confirmation,
    consistent,
    spanning_poses,
)
from mapmeld.merging.graph.edges import Edges, composed, inverted, row_of
from mapmeld.merging.graph.least_squares import parts
from mapmeld.se2 import Pose2

SEEDS = st.integers(0, 2**32 - 1)
FAR = Pose2(9, -6, 1.0)


def solved(graph: Synthetic, **more: object) -> Consistent:
    return consistent(graph.count, graph.edges, **more)  # type: ignore[arg-type]


def false_in(found: Consistent) -> set[int]:
    return set(np.flatnonzero(~found.used & ~found.doubted).tolist())


def doubted_in(found: Consistent) -> set[int]:
    return set(np.flatnonzero(found.doubted).tolist())


def numbers(graph: Synthetic, pairs: Iterable[tuple[int, int]]) -> set[int]:
    ends = list(zip(graph.edges.i.tolist(), graph.edges.j.tolist(), strict=True))
    return {ends.index(pair) for pair in pairs}


# ------------------------------------------------------------------ false edges
@settings(max_examples=20)
@given(SEEDS, st.integers(1, 9))
def test_without_false_edges_all_are_used(seed: int, count: int) -> None:
    # Noise of half of what is stated: one in a thousand right edges may exceed the bound by chance.
    graph = synthetic(seed, count, noise=(0.025, 0.0025))
    found = solved(graph)
    assert found.used.all()
    assert apart(found.fit.poses, graph.poses) < 0.5


@settings(max_examples=20)
@given(SEEDS, st.integers(6, 10), st.integers(1, 3))
def test_false_edges_among_many_are_found(seed: int, count: int, false: int) -> None:
    graph = synthetic(seed, count, noise=(0.025, 0.0025), false=false)
    found = solved(graph)
    assert false_in(found) == graph.false
    assert not found.doubted.any()
    assert apart(found.fit.poses, graph.poses) < 0.5


@settings(max_examples=20)
@given(SEEDS, st.integers(3, 7), st.integers(1, 8))
def test_however_many_are_false_none_of_those_is_used_that_a_cycle_checks(
    seed: int, count: int, false: int
) -> None:
    graph = synthetic(seed, count, noise=(0.025, 0.0025), false=false)
    found = solved(graph)
    for k in np.flatnonzero(found.used):
        rest = found.used.copy()
        rest[k] = False
        labels = parts(graph.count, graph.edges[rest])
        checked = labels[graph.edges.i[k]] == labels[graph.edges.j[k]]
        assert k not in graph.false or not checked


def test_a_false_edge_in_a_triangle_cannot_be_told_from_the_right_ones() -> None:
    graph = synthetic(0, 3, replaced={(0, 1): FAR})
    found = solved(graph)
    assert doubted_in(found) == {0, 1, 2}
    assert found.fit.labels.tolist() == [0, 1, 2]


def test_unless_it_is_much_less_probable() -> None:
    graph = synthetic(0, 3, replaced={(0, 1): FAR})
    weight = np.array([math.log(4), SURE, SURE])
    found = solved(replace(graph, edges=replace_weight(graph.edges, weight)))
    assert false_in(found) == {0}
    assert doubted_in(found) == set()
    # The other way round the two right ones would be lost to a surer false one; better neither.
    found = solved(replace(graph, edges=replace_weight(graph.edges, weight[::-1].copy())))
    assert 0 not in np.flatnonzero(found.used) or 2 not in np.flatnonzero(found.used)


def replace_weight(edges: Edges, weight: np.ndarray) -> Edges:
    return Edges(edges.i, edges.j, edges.z, edges.covariance, weight)


def test_a_ring_with_a_false_edge_falls_apart_and_what_hangs_on_it_does_not() -> None:
    ring = [(0, 1), (1, 2), (2, 3), (0, 3)]
    tail = [(3, 4), (4, 5), (3, 5)]
    graph = synthetic(0, 6, [*ring, *tail], replaced={(1, 2): FAR})
    found = solved(graph)
    assert doubted_in(found) == numbers(graph, ring)
    assert found.fit.labels.tolist() == [0, 1, 2, 3, 3, 3]


def test_a_bridge_is_taken_at_its_word() -> None:
    pairs = [(0, 1), (1, 2), (0, 2), (2, 3), (3, 4), (4, 5), (3, 5)]
    graph = synthetic(0, 6, pairs, replaced={(2, 3): FAR})
    found = solved(graph)
    assert found.used.all()  # nothing can tell


def test_two_false_edges_that_agree_lose_against_more_that_are_right() -> None:
    # Map 0 is laid wrongly on 1 and 2, in the same way, and rightly on 3 to 6.
    graph = synthetic(0, 7)
    shift = Pose2(6, 2, 0.4)
    both = {(0, 1): shift, (0, 2): shift}  # both move the maps on the far side alike, seen from map 0
    graph = synthetic(0, 7, replaced=both)
    found = solved(graph)
    assert false_in(found) == numbers(graph, both)
    assert not found.doubted.any()


def test_as_many_false_edges_that_agree_as_right_ones_put_all_of_them_in_doubt() -> None:
    shift = Pose2(6, 2, 0.4)
    both = {(0, 1): shift, (0, 2): shift}
    graph = synthetic(0, 5, replaced=both)
    found = solved(graph)
    assert doubted_in(found) == numbers(graph, [(0, 1), (0, 2), (0, 3), (0, 4)])
    # The others are not touched by that.
    assert found.fit.labels.tolist() == [0, 1, 1, 1, 1]


def test_a_start_on_false_edges_is_left_again() -> None:
    """The false edges are by far the most probable ones: any tree of the surest edges has them in it."""
    graph = synthetic(5, 9, false=3)
    weight = np.full(len(graph.edges), math.log(0.86 / 0.14))
    weight[list(graph.false)] = SURE
    found = solved(replace(graph, edges=replace_weight(graph.edges, weight)))
    assert false_in(found) == graph.false


# ------------------------------------------------------------------ what does not matter
@settings(max_examples=10)
@given(SEEDS, st.permutations(range(7)))
def test_numbers_of_the_nodes_do_not_matter(seed: int, order: list[int]) -> None:
    graph = synthetic(seed, 7, noise=(0.025, 0.0025), false=2)
    e, new = graph.edges, np.array(order)
    renamed = Edges(new[e.i], new[e.j], e.z, e.covariance, e.weight)
    found, other = solved(graph), consistent(7, renamed)
    np.testing.assert_array_equal(found.used, other.used)
    np.testing.assert_array_equal(found.doubted, other.doubted)


@settings(max_examples=10)
@given(SEEDS, st.from_type(Pose2))
def test_a_node_in_another_frame_moves_its_pose_and_no_other(seed: int, T: Pose2) -> None:
    graph = synthetic(seed, 6, noise=(0.01, 0.001), false=1)
    e = graph.edges
    # Node 5 is j in all of its edges; its frame is now reached by T from the old one.
    z = e.z.copy()
    z[e.j == 5] = composed(z[e.j == 5], np.repeat([row_of(T)], int((e.j == 5).sum()), axis=0))
    covariance = e.covariance.copy()
    old = e.z[e.j == 5]
    J = np.repeat(np.eye(3)[None], len(old), axis=0)
    c, s = np.cos(old[:, 2]), np.sin(old[:, 2])
    J[:, 0, 2], J[:, 1, 2] = -s * T.x - c * T.y, c * T.x - s * T.y
    covariance[e.j == 5] = J @ covariance[e.j == 5] @ J.transpose(0, 2, 1)
    found = solved(graph)
    other = consistent(6, Edges(e.i, e.j, z, covariance, e.weight))
    np.testing.assert_array_equal(found.used, other.used)
    np.testing.assert_allclose(other.fit.poses[:5], found.fit.poses[:5], atol=1e-3)
    expected = composed(found.fit.poses[5], np.array(row_of(T)))
    assert np.hypot(*(other.fit.poses[5] - expected)[:2]) < 2e-3


def test_no_nodes_are_linked_without_edges() -> None:
    found = consistent(3, Edges.of([]))
    assert found.fit.labels.tolist() == [0, 1, 2]
    assert found.used.shape == (0,)
    assert consistent(0, Edges.of([])).fit.poses.shape == (0, 3)


def test_maps_that_are_the_same_lie_on_one_another() -> None:
    C = np.diag([0.01, 0.01, 0.0001])
    edges = Edges.of([(i, j, Pose2(), C, SURE) for i, j in pairs_of(4)])
    found = consistent(4, edges)
    assert found.used.all()
    np.testing.assert_allclose(found.fit.poses, 0, atol=1e-12)


# ------------------------------------------------------------------ what is given
def test_what_is_given_is_not_doubted_and_what_contradicts_it_is_false() -> None:
    graph = synthetic(0, 3, [(0, 1), (0, 2), (1, 2)], replaced={(1, 2): FAR})
    weight = np.array([math.inf, math.inf, SURE])
    found = consistent(3, replace_weight(graph.edges, weight), world=0)
    assert found.used.tolist() == [True, True, False]
    assert not found.doubted.any()


@settings(max_examples=10)
@given(SEEDS)
def test_given_poses_turn_the_choice(seed: int) -> None:
    # In a triangle alone all would be in doubt; two given poses tell which edge is false.
    triangle = pairs_of(3)
    graph = synthetic(seed, 4, [*triangle, (0, 3), (1, 3)], noise=(0, 0), replaced={(0, 1): FAR})
    weight = np.array([SURE, SURE, SURE, math.inf, math.inf])
    found = consistent(4, replace_weight(graph.edges, weight), world=3)
    assert false_in(found) == {0}
    assert not found.doubted.any()


# ------------------------------------------------------------------ what should have matched
def saying(*missed: tuple[int, int]) -> Overlooked:
    def overlooked(i: np.ndarray, j: np.ndarray, T: np.ndarray) -> np.ndarray:
        assert T.shape == (len(i), 3)
        return np.array([pair in missed for pair in zip(i.tolist(), j.tolist(), strict=True)], np.bool_)

    return overlooked


TWO_HOUSES = [(0, 1), (0, 2), (1, 2), (3, 4), (3, 5), (4, 5)]


def test_a_bridge_between_two_groups_that_should_match_elsewhere_is_doubted() -> None:
    graph = synthetic(0, 6, [*TWO_HOUSES, (2, 3)])
    assert solved(graph, overlooked=saying()).used.all()
    # One pair that did not match may be a miss.
    assert solved(graph, overlooked=saying((1, 4))).used.all()
    found = solved(graph, overlooked=saying((1, 4), (0, 3), (2, 4)))
    assert doubted_in(found) == numbers(graph, [(2, 3)])
    assert found.absent.tolist() == found.doubted.tolist()
    assert found.fit.labels.tolist() == [0, 0, 0, 1, 1, 1]


def test_the_map_between_stays_where_it_is_held_best() -> None:
    # Map 2 hangs on 0 and 1 by two edges and, wrongly, on the other house by one.
    graph = synthetic(0, 6, [*TWO_HOUSES, (2, 3)])
    missed = [(i, j) for i in (0, 1, 2) for j in (3, 4, 5)]
    found = solved(graph, overlooked=saying(*missed))
    assert doubted_in(found) == numbers(graph, [(2, 3)])


def test_many_matches_outweigh_a_few_misses() -> None:
    pairs = [pair for pair in pairs_of(6) if pair not in ((0, 5), (1, 5))]
    graph = synthetic(0, 6, pairs)
    assert solved(graph, overlooked=saying((0, 5), (1, 5))).used.all()


def test_misses_do_not_part_what_is_given() -> None:
    graph = synthetic(0, 5, [(0, 4), (3, 4), (0, 1), (2, 3)])
    weight = np.array([math.inf, math.inf, SURE, SURE])
    missed = [(0, 3), (0, 2), (1, 3), (1, 2)]
    found = consistent(5, replace_weight(graph.edges, weight), 4, saying(*missed))
    assert found.used.all()


# ------------------------------------------------------------------ the start
def test_triangles_confirm_right_edges_and_tell_on_false_ones() -> None:
    graph = synthetic(0, 5, noise=(0.01, 0.001), replaced={(0, 1): FAR})
    counted = confirmation(graph.edges) / SURE
    # Each edge counts 1 itself and lies in three triangles; none closes that has the false edge in it.
    assert counted[0] == pytest.approx(1 - 3)
    assert counted[numbers(graph, [(0, 2)]).pop()] == pytest.approx(1 + 2 - 1)
    assert counted[numbers(graph, [(2, 3)]).pop()] == pytest.approx(1 + 3)


def test_spanning_poses_follow_the_best_edges() -> None:
    graph = synthetic(0, 5, noise=(0, 0), replaced={(0, 1): FAR})
    poses, tree = spanning_poses(5, graph.edges, confirmation(graph.edges))
    assert tree.sum() == 4
    assert not tree[0]
    assert apart(poses, graph.poses) < 1e-9


def test_spanning_poses_of_several_parts() -> None:
    graph = synthetic(0, 5, [(0, 3), (1, 4)], noise=(0, 0))
    poses, tree = spanning_poses(5, graph.edges, np.zeros(2))
    assert tree.all()
    measured = composed(inverted(poses[[0, 1]]), poses[[3, 4]])
    np.testing.assert_allclose(measured, graph.edges.z, atol=1e-12)
