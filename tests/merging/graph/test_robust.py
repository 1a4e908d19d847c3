import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pose_graphs import Synthetic, apart, synthetic

from mapmeld.merging.graph.consistency import FITS, confirmation, consistent, spanning_poses
from mapmeld.merging.graph.edges import Doubles, Edges, squared_distance
from mapmeld.merging.graph.least_squares import fit, frames_of, optimised, parts, residuals
from mapmeld.merging.graph.robust import Robust, graduated

gtsam = pytest.importorskip("gtsam")

from mapmeld.merging.graph.with_gtsam import factors, graduated_by_gtsam, poses_of  # noqa: E402

SEEDS = st.integers(0, 2**32 - 1)
BOTH = pytest.mark.parametrize("robust", [graduated, graduated_by_gtsam], ids=["own", "gtsam"])


def start_of(graph: Synthetic) -> Doubles:
    return spanning_poses(graph.count, graph.edges, confirmation(graph.edges))[0]


@BOTH
@settings(max_examples=10)
@given(seed=SEEDS, false=st.integers(0, 4))
def test_false_edges_are_let_go_of(robust: Robust, seed: int, false: int) -> None:
    graph = synthetic(seed, 9, noise=(0.02, 0.002), false=false)
    poses, kept = robust(start_of(graph), graph.edges, FITS, None)
    assert set(np.flatnonzero(~kept).tolist()) == graph.false
    assert apart(poses, graph.poses) < 0.5


@BOTH
def test_what_is_given_is_kept_whatever_contradicts_it(robust: Robust) -> None:
    graph = synthetic(0, 6, false=1)
    (wrong,) = graph.false
    weight = graph.edges.weight.copy()
    weight[wrong] = math.inf
    e = graph.edges
    kept = robust(start_of(graph), Edges(e.i, e.j, e.z, e.covariance, weight), FITS, None)[1]
    assert kept[wrong]


@settings(max_examples=10)
@given(SEEDS)
def test_our_least_squares_and_gtsams_agree(seed: int) -> None:
    graph = synthetic(seed, 7)
    ours = fit(graph.poses, graph.edges)
    nonlinear, values = factors(gtsam, ours.poses, graph.edges)
    theirs = gtsam.LevenbergMarquardtOptimizer(nonlinear, values).optimize()
    np.testing.assert_allclose(poses_of(theirs, 7), ours.poses, atol=1e-4)
    # GTSAM's errors are logarithms of motions, ours differences: the same to first order.
    shaken = ours.poses + np.random.default_rng(seed).normal(size=ours.poses.shape) * 0.01
    shaken[0] = 0
    cost = squared_distance(residuals(shaken, graph.edges), graph.edges.covariance).sum() / 2
    assert nonlinear.error(factors(gtsam, shaken, graph.edges)[1]) == pytest.approx(cost, rel=1e-3)
    marginals = gtsam.Marginals(nonlinear, theirs)
    for k in range(1, 7):
        c, s = math.cos(ours.poses[k, 2]), math.sin(ours.poses[k, 2])
        R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        found = R @ marginals.marginalCovariance(k) @ R.T
        own = ours.covariance[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
        np.testing.assert_allclose(found, own, rtol=0.05, atol=1e-5)


@settings(max_examples=10)
@given(SEEDS, st.integers(0, 3))
def test_both_solvers_lead_to_the_same_graph(seed: int, false: int) -> None:
    graph = synthetic(seed, 7, noise=(0.02, 0.002), false=false)
    one = consistent(7, graph.edges)
    two = consistent(7, graph.edges, robust=graduated_by_gtsam)
    np.testing.assert_array_equal(one.used, two.used)
    np.testing.assert_array_equal(one.doubted, two.doubted)
    np.testing.assert_allclose(one.fit.poses, two.fit.poses, atol=1e-6)


def test_several_parts_and_a_world() -> None:
    graph = synthetic(0, 7, [(0, 1), (1, 2), (0, 2), (3, 4), (5, 6)], noise=(0.01, 0.001))
    labels = parts(7, graph.edges)
    for world in (None, 2):
        ours, kept = graduated(start_of(graph), graph.edges, FITS, world)
        theirs, kept_too = graduated_by_gtsam(start_of(graph), graph.edges, FITS, world)
        assert kept.all()
        assert kept_too.all()
        # Each holds the frames of its parts where the start had them.
        frames = frames_of(labels, world)
        np.testing.assert_allclose(ours[frames], start_of(graph)[frames], atol=1e-6)
        np.testing.assert_allclose(theirs, ours, atol=1e-4)


def test_a_weight_of_zero_takes_an_edge_out() -> None:
    graph = synthetic(0, 5, noise=(0, 0), false=1)
    weights = np.ones(len(graph.edges))
    weights[list(graph.false)] = 0
    start = start_of(graph)
    found = optimised(start, graph.edges, np.array([0]), weights)
    assert apart(found, graph.poses) < 1e-6
