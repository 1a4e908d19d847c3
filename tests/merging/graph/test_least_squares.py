import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pose_graphs import apart, synthetic

from mapmeld.merging.graph.edges import Edges, composed, inverted, row_of
from mapmeld.merging.graph.least_squares import fit, optimised, parts, residuals
from mapmeld.se2 import Pose2

SEEDS = st.integers(0, 2**32 - 1)


@settings(max_examples=25)
@given(SEEDS, st.integers(2, 8))
def test_exact_measurements_give_back_the_poses(seed: int, count: int) -> None:
    graph = synthetic(seed, count, noise=(0, 0))
    rng = np.random.default_rng(seed)
    start = graph.poses + rng.normal(size=graph.poses.shape) * [0.5, 0.5, 0.1]
    found = fit(start, graph.edges)
    assert apart(found.poses, graph.poses) < 1e-7
    assert np.abs(residuals(found.poses, graph.edges)).max() < 1e-7


@settings(max_examples=15)
@given(SEEDS, st.from_type(Pose2))
def test_where_the_whole_start_lies_does_not_matter(seed: int, T: Pose2) -> None:
    graph = synthetic(seed, 5)
    moved = composed(np.repeat([row_of(T)], 5, axis=0), graph.poses)
    one, two = fit(graph.poses, graph.edges), fit(moved, graph.edges)
    np.testing.assert_allclose(one.poses, two.poses, atol=1e-7)
    np.testing.assert_allclose(one.covariance, two.covariance, atol=1e-9)


@settings(max_examples=15)
@given(SEEDS)
def test_an_edge_that_is_turned_round_says_the_same(seed: int) -> None:
    graph = synthetic(seed, 5)
    e = graph.edges
    z = inverted(e.z)
    J = np.zeros((len(e), 3, 3))
    c, s = np.cos(e.z[:, 2]), np.sin(e.z[:, 2])
    J[:, 0, 0], J[:, 0, 1], J[:, 0, 2] = -c, -s, z[:, 1]
    J[:, 1, 0], J[:, 1, 1], J[:, 1, 2] = s, -c, -z[:, 0]
    J[:, 2, 2] = -1
    back = Edges(e.j, e.i, z, J @ e.covariance @ J.transpose(0, 2, 1), e.weight)
    # To first order only: the noise is 0.05 m and 0.005 rad, distances up to 60 m.
    np.testing.assert_allclose(fit(graph.poses, back).poses, fit(graph.poses, e).poses, atol=0.02)


def test_the_first_node_of_each_part_is_its_frame() -> None:
    graph = synthetic(0, 6, [(0, 2), (2, 4), (0, 4), (1, 5)])
    found = fit(graph.poses, graph.edges)
    assert found.labels.tolist() == [0, 1, 0, 2, 0, 1]
    assert found.frames.tolist() == [0, 1, 3]
    np.testing.assert_array_equal(found.poses[[0, 1, 3]], 0)
    assert found.covariance[:3, :3].max() == 0
    # Nothing is known between parts.
    assert np.abs(found.covariance[6:9, 15:18]).max() == 0
    assert found.covariance[15, 15] > 0


def test_a_world_is_the_frame_of_its_part() -> None:
    graph = synthetic(0, 4)
    found = fit(graph.poses, graph.edges, world=3)
    assert found.frames.tolist() == [3]
    np.testing.assert_array_equal(found.poses[3], 0)


def test_covariance_of_a_chain_and_of_two_witnesses() -> None:
    C = np.diag([0.04, 0.01, 1e-12])
    chain = Edges.of([(0, 1, Pose2(1, 0, 0), C, 1.0), (1, 2, Pose2(1, 0, 0), C, 1.0)])
    found = fit(np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0.0]]), chain)
    T, spread = found.relative(np.array([0, 0, 1]), np.array([1, 2, 2]))
    np.testing.assert_allclose(T, [[1, 0, 0], [2, 0, 0], [1, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(spread[:, 0, 0], [0.04, 0.08, 0.04], rtol=1e-6)
    twice = Edges.of([(0, 1, Pose2(1, 0, 0), C, 1.0), (0, 1, Pose2(1.2, 0, 0), 3 * C, 1.0)])
    found = fit(np.zeros((2, 3)), twice)
    assert found.poses[1, 0] == pytest.approx(1.05)  # nearer to the surer one
    assert found.covariance[3, 3] == pytest.approx(0.04 * 0.75)


def test_covariance_is_what_repeated_measuring_gives() -> None:
    """Monte Carlo: the spread of the fitted poses is that which a fit states."""
    graph = synthetic(0, 4, noise=(0, 0))
    found, e = fit(graph.poses, graph.edges), graph.edges
    rng = np.random.default_rng(1)
    poses = []
    for _ in range(400):
        noise = rng.normal(size=e.z.shape) * [0.05, 0.05, 0.005]
        noisy = Edges(e.i, e.j, e.z + noise, e.covariance, e.weight)
        poses.append(optimised(found.poses, noisy, np.array([0])))
    spread = np.array(poses)[:, 1:].reshape(400, -1).std(axis=0)
    np.testing.assert_allclose(spread, np.sqrt(np.diag(found.covariance))[3:], rtol=0.15)


@settings(max_examples=15)
@given(SEEDS)
def test_strain_is_what_leaving_an_edge_out_says(seed: int) -> None:
    graph = synthetic(seed, 5)
    used = np.ones(len(graph.edges), np.bool_)
    strain = fit(graph.poses, graph.edges).strain(graph.edges, used)
    for k in range(0, len(used), 3):
        others = used.copy()
        others[k] = False
        without = fit(graph.poses, graph.edges[others])
        # To first order the two are the same.
        assert strain[k] == pytest.approx(without.strain(graph.edges, others)[k], rel=0.1, abs=0.05)


def test_a_bridge_is_not_strained_and_a_cycle_strains_its_edges_alike() -> None:
    C = np.diag([0.01, 0.01, 0.0001])
    rows = [(0, 1, Pose2(1, 0, 0), C, 1.0), (1, 2, Pose2(1, 0, 0), C, 1.0), (0, 2, Pose2(2.5, 0, 0), C, 1.0)]
    edges = Edges.of([*rows, (2, 3, Pose2(4, 4, 1), C, 1.0)])
    found = fit(np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [6, 4, 1.0]]), edges)
    strain = found.strain(edges, np.ones(4, np.bool_))
    assert strain[3] == 0
    # 0.5 m in a cycle of three edges with a variance of 0.01 each.
    np.testing.assert_allclose(strain[:3], 0.25 / 0.03, rtol=1e-6)


def test_an_edge_between_parts_is_not_strained() -> None:
    graph = synthetic(0, 4, [(0, 1), (2, 3), (1, 2)])
    used = np.array([True, True, False])
    assert fit(graph.poses, graph.edges[used]).strain(graph.edges, used)[2] == 0


def test_parts_are_counted_by_their_first_nodes() -> None:
    graph = synthetic(0, 5, [(3, 4), (0, 2)])
    assert parts(5, graph.edges).tolist() == [0, 1, 0, 2, 2]
    assert parts(3, Edges.of([])).tolist() == [0, 1, 2]


def test_nothing_to_fit() -> None:
    found = fit(np.ones((2, 3)), Edges.of([]))
    np.testing.assert_array_equal(found.poses, 0)
    np.testing.assert_array_equal(found.covariance, 0)


def test_a_far_start_leads_home_too() -> None:
    ring = [(i, (i + 1) % 8) for i in range(7)] + [(0, 7)]
    graph = synthetic(3, 8, ring, noise=(0, 0))
    rng = np.random.default_rng(0)
    start = graph.poses + rng.normal(size=(8, 3)) * [5, 5, math.radians(30)]
    assert apart(fit(start, graph.edges).poses, graph.poses) < 1e-6
