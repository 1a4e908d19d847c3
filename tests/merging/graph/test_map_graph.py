import math
from collections.abc import Mapping

import numpy as np
import pytest
from drawing import cut, office, seen_from

from mapmeld.grid import OccupancyGrid
from mapmeld.matching import Alternative, MatchResult, Verdict
from mapmeld.merging.graph import KnownPose, MapGraph, PairMatch, PairState, as_g2o, solve
from mapmeld.merging.graph.edges import Extent
from mapmeld.se2 import Pose2

# Poses of five maps in the frame of the first; all show the same 16 x 12 m.
TRUTH = [Pose2(), Pose2(3, -2, 0.6), Pose2(-8, 5, -2.0), Pose2(1, 1, 3.0), Pose2(0, -9, 1.5)]
OFFICE = office(0.2)
MAPS = [seen_from(OFFICE, T.inverse()) for T in TRUTH]
FAR = Pose2(6, -4, 1.0)


def true(i: int, j: int) -> Pose2:
    return TRUTH[i].inverse() @ TRUTH[j]


def accepted(T: Pose2, probability: float | None = 0.999) -> MatchResult:
    return MatchResult(T, Verdict.ACCEPTED, "fits", probability, 0.5, 0.9, np.diag([0.01, 0.01, 1e-4]))


def rejected(T: Pose2 | None = None, probability: float | None = 0.01) -> MatchResult:
    return MatchResult(T, Verdict.REJECTED, "does not fit", probability)


def ambiguous(*modes: tuple[Pose2, float]) -> MatchResult:
    (best, p), *others = modes
    alternatives = tuple(Alternative(T, 0.3, q) for T, q in others)
    return MatchResult(best, Verdict.AMBIGUOUS, "two ways", p, alternatives=alternatives)


def graph_of(
    count: int,
    others: Mapping[tuple[int, int], MatchResult] | None = None,
    known: Mapping[int, KnownPose] | None = None,
    maps: list[OccupancyGrid] | None = None,
) -> MapGraph:
    """Solve a graph in which all pairs match rightly but for `others`."""
    results = {(i, j): accepted(true(i, j)) for i in range(count) for j in range(i + 1, count)}
    results |= others or {}
    return solve((maps or MAPS)[:count], [(i, j, r) for (i, j), r in results.items()], known)


def pair(graph: MapGraph, i: int, j: int) -> PairMatch:
    return next(p for p in graph.pairs if (p.i, p.j) == (i, j))


def close(found: Pose2 | None, expected: Pose2, metres: float = 0.02) -> bool:
    assert found is not None
    off, turned = found.distance_to(expected)
    return off < metres and turned < 0.01


# ------------------------------------------------------------------ states
def test_right_matches_give_all_poses() -> None:
    graph = graph_of(5)
    assert graph.components == ((0, 1, 2, 3, 4),)
    assert all(close(found, T) for found, T in zip(graph.poses, TRUTH, strict=True))
    assert {p.state for p in graph.pairs} == {PairState.USED}
    assert not any(p.bridge for p in graph.pairs)
    assert graph.T_w_i == (None,) * 5
    np.testing.assert_array_equal(graph.covariances[0], 0)
    for p in graph.pairs:
        assert p.T_i_j == p.result.T_a_b
        assert p.off is not None
        assert max(p.off) < 0.01


def test_a_false_match_is_named_with_how_far_it_is_off() -> None:
    graph = graph_of(5, {(1, 3): accepted(true(1, 3) @ FAR)})
    wrong = pair(graph, 1, 3)
    assert wrong.state is PairState.FALSE
    assert wrong.T_i_j is None
    assert "contradicted" in wrong.why
    assert wrong.off is not None
    middle = Extent.of(MAPS[3])
    moved = FAR.apply((middle.x, middle.y)) - (middle.x, middle.y)
    assert wrong.off[0] == pytest.approx(float(np.hypot(*moved)), abs=0.1)
    assert wrong.off[1] == pytest.approx(1.0, abs=0.02)
    assert all(close(found, T) for found, T in zip(graph.poses, TRUTH, strict=True))


def test_a_contradiction_of_three_is_left_open() -> None:
    graph = graph_of(3, {(0, 1): accepted(true(0, 1) @ FAR)})
    assert {p.state for p in graph.pairs} == {PairState.DOUBTED}
    assert graph.components == ((0,), (1,), (2,))
    assert all(p.T_i_j is None and "about as probable" in p.why for p in graph.pairs)


def test_what_known_poses_contradict_names_them() -> None:
    known = {0: KnownPose(TRUTH[0]), 1: KnownPose(TRUTH[1] @ FAR)}
    graph = graph_of(3, known=known)
    direct = pair(graph, 0, 1)
    assert (direct.state, direct.why) == (PairState.FALSE, "contradicted by the known poses")
    assert direct.against_known
    for j in (0, 1):  # which of the two is wrong cannot be told
        through = pair(graph, j, 2)
        assert through.state is PairState.DOUBTED
        assert through.against_known
        assert "with the known poses as they are" in through.why


def test_what_other_matches_contradict_is_not_laid_to_known_poses() -> None:
    graph = graph_of(
        5, {(1, 3): accepted(true(1, 3) @ FAR)}, {0: KnownPose(TRUTH[0]), 1: KnownPose(TRUTH[1])}
    )
    wrong = pair(graph, 1, 3)
    assert (wrong.state, wrong.why) == (PairState.FALSE, "contradicted by the other matches")
    assert not any(p.against_known for p in graph.pairs)


def test_one_pair_is_used_as_it_is_and_rests_on_itself() -> None:
    T = Pose2(1.25, -0.5, 0.75)
    graph = solve(MAPS[:2], [(0, 1, accepted(T))])
    assert graph.poses == (Pose2(), T)
    assert pair(graph, 0, 1).bridge
    assert "rests on this match alone, probability 0.999" in pair(graph, 0, 1).why


@pytest.mark.parametrize(
    "result", [rejected(), rejected(Pose2(), 0.8), ambiguous((Pose2(), 0.5), (FAR, 0.4))]
)
def test_what_is_not_accepted_never_joins_maps(result: MatchResult) -> None:
    graph = solve(MAPS[:2], [(0, 1, result)])
    assert graph.components == ((0,), (1,))
    assert pair(graph, 0, 1).state is PairState.UNUSED
    assert pair(graph, 0, 1).off is None


def test_no_matches_and_no_maps() -> None:
    assert solve(MAPS[:3], []).components == ((0,), (1,), (2,))
    assert solve([], []).components == ()


def test_methods_without_probability_and_covariance() -> None:
    plain = {(i, j): MatchResult(true(i, j), Verdict.ACCEPTED, "") for i in range(4) for j in range(i + 1, 4)}
    plain[0, 2] = MatchResult(true(0, 2) @ FAR, Verdict.ACCEPTED, "")
    graph = graph_of(4, plain)
    assert pair(graph, 0, 2).state is PairState.FALSE
    assert all(close(found, T) for found, T in zip(graph.poses, TRUTH[:4], strict=True))


# ------------------------------------------------------------------ ambiguous matches
@pytest.mark.parametrize("order", [1, -1])
def test_an_ambiguous_match_is_settled_by_the_others(order: int) -> None:
    modes = [(true(0, 1), 0.5), (true(0, 1) @ FAR, 0.45)][::order]
    graph = graph_of(4, {(0, 1): ambiguous(*modes)})
    settled = pair(graph, 0, 1)
    assert settled.state is PairState.SETTLED
    assert settled.T_i_j == true(0, 1)
    assert ("its best mode" if order == 1 else "its mode 2") in settled.why
    assert not settled.bridge
    # It adds to what is known of map 1.
    without = graph_of(4, {(0, 1): rejected(true(0, 1), 0.6)})
    assert graph.covariances[1][0, 0] < without.covariances[1][0, 0]


def test_it_is_not_settled_on_a_mode_that_does_not_fit_or_is_next_to_impossible() -> None:
    for modes in (
        [(true(0, 1) @ FAR, 0.5), (true(0, 1) @ FAR.inverse(), 0.4)],
        [(true(0, 1) @ FAR, 0.9), (true(0, 1), 0.01)],
    ):
        graph = graph_of(4, {(0, 1): ambiguous(*modes)})
        assert pair(graph, 0, 1).state is PairState.UNUSED
        assert pair(graph, 0, 1).T_i_j is None


def test_it_is_not_settled_where_two_modes_fit() -> None:
    near = Pose2(0.1, 0, 0)
    graph = graph_of(4, {(0, 1): ambiguous((true(0, 1), 0.5), (true(0, 1) @ near, 0.4))})
    assert pair(graph, 0, 1).state is PairState.UNUSED


def test_ambiguous_matches_alone_join_nothing_even_if_they_agree() -> None:
    others = {(i, 3): ambiguous((true(i, 3), 0.6), (true(i, 3) @ FAR, 0.3)) for i in range(3)}
    graph = graph_of(4, others)
    assert graph.components == ((0, 1, 2), (3,))


# ------------------------------------------------------------------ what should have matched
def test_a_lone_match_is_doubted_where_the_others_of_that_place_do_not_match() -> None:
    others: dict[tuple[int, int], MatchResult] = {(0, 3): rejected(true(0, 3) @ FAR)}
    others |= {(1, 3): rejected(true(1, 3) @ FAR), (2, 3): accepted(true(2, 3), 0.9)}
    graph = graph_of(4, others)
    assert graph.components == ((0, 1, 2), (3,))
    assert pair(graph, 2, 3).state is PairState.DOUBTED
    assert "did not match" in pair(graph, 2, 3).why


@pytest.mark.parametrize(
    "miss",
    [
        lambda i: rejected(true(i, 3), 0.7),  # it sees the same, and was only not sure enough
        lambda i: rejected(None, 0.0),  # there was nothing to match on
        lambda i: rejected(true(i, 3) @ FAR, None),  # of a method that may miss much
        lambda i: ambiguous((true(i, 3) @ FAR, 0.4), (true(i, 3), 0.4)),
    ],
)
def test_misses_that_say_nothing(miss: object) -> None:
    others = {(i, 3): miss(i) for i in (0, 1)} | {(2, 3): accepted(true(2, 3), 0.9)}  # type: ignore[operator]
    assert graph_of(4, others).components == ((0, 1, 2, 3),)


def test_maps_that_hardly_overlap_need_not_match() -> None:
    # Map 3 shows the right half, maps 0 and 1 the left one, map 2 all.
    left, right = cut(OFFICE, 0, 0, 7, 12), cut(OFFICE, 6, 0, 16, 12)
    maps = [left, seen_from(left, TRUTH[1].inverse()), MAPS[2], seen_from(right, TRUTH[3].inverse())]
    others = {(i, 3): rejected(true(i, 3) @ FAR) for i in (0, 1)} | {(2, 3): accepted(true(2, 3), 0.9)}
    assert graph_of(4, others, maps=maps).components == ((0, 1, 2, 3),)


# ------------------------------------------------------------------ known poses
W = Pose2(100, -50, 2.0)  # of map 0's frame in the common frame


def test_exact_poses_are_kept_and_the_others_found_from_them() -> None:
    known = {1: KnownPose(W @ TRUTH[1]), 3: KnownPose(W @ TRUTH[3])}
    graph = graph_of(5, known=known)
    for i, T in enumerate(TRUTH):
        assert close(graph.T_w_i[i], W @ T)
        assert close(graph.poses[i], T)
    assert close(graph.T_w_i[1], known[1].T_w_i, 1e-4)
    assert graph.known == known


def test_a_match_that_contradicts_exact_poses_is_false() -> None:
    known = {i: KnownPose(W @ TRUTH[i]) for i in (0, 1)}
    graph = graph_of(2, {(0, 1): accepted(true(0, 1) @ FAR)}, known)
    assert pair(graph, 0, 1).state is PairState.FALSE
    assert close(graph.poses[1], TRUTH[1], 1e-4)


def test_uncertain_poses_give_way_to_matches_by_their_weight() -> None:
    off = Pose2(0.5, 0, 0)
    known = {0: KnownPose(W), 1: KnownPose(W @ TRUTH[1] @ off, 1.0, 0.5)}
    graph = graph_of(2, known=known)
    assert pair(graph, 0, 1).state is PairState.USED
    assert not pair(graph, 0, 1).bridge
    metres = graph.poses[1].distance_to(TRUTH[1])[0]
    assert 0 < metres < 0.25


def test_known_poses_settle_what_is_ambiguous() -> None:
    known = {0: KnownPose(W), 1: KnownPose(W @ TRUTH[1], 0.5, 0.1)}
    modes = ambiguous((true(0, 1) @ FAR, 0.5), (true(0, 1), 0.45))
    graph = graph_of(2, {(0, 1): modes}, known)
    assert pair(graph, 0, 1).T_i_j == true(0, 1)


@pytest.mark.parametrize("far", [0.0, 5e6])
def test_a_wrong_exact_pose_takes_its_own_matches_with_it_and_no_others(far: float) -> None:
    world = Pose2(far, far, 0.7)
    known = {i: KnownPose(world @ TRUTH[i]) for i in range(3)}
    known[1] = KnownPose(world @ TRUTH[1] @ Pose2(3, 0, 0))
    graph = graph_of(4, known=known)
    states = {(p.i, p.j): p.state for p in graph.pairs}
    assert {ends for ends, state in states.items() if state is PairState.USED} == {(0, 2), (0, 3), (2, 3)}
    assert graph.components == ((0, 1, 2, 3),)
    assert close(graph.poses[3], TRUTH[3])


def test_loose_poses_do_not_make_matches_more_exact() -> None:
    known = {i: KnownPose(TRUTH[i], 2.0, 0.5) for i in range(5)}
    chain = {(i, j): rejected() for i in range(5) for j in range(i + 2, 5)}
    with_poses, without = (graph_of(5, chain, known=poses) for poses in (known, None))
    for one, two in zip(with_poses.pairs, without.pairs, strict=True):
        if one.covariance is not None and two.covariance is not None:
            assert np.trace(one.covariance) > 0.9 * np.trace(two.covariance)
    assert np.trace(with_poses.covariances[1]) > 0.5 * np.trace(without.covariances[1])


def test_ambiguous_matches_that_contradict_one_another_settle_nothing() -> None:
    n = 8
    maps = [MAPS[0]] * n
    truth = [Pose2(6.0 * k, 0, 0) for k in range(n)]

    def at(i: int, j: int, y: float) -> Pose2:
        T = truth[i].inverse() @ truth[j]
        return Pose2(T.x, y, 0)

    def solved(second: float) -> MapGraph:
        results = {(k, k + 1): accepted(at(k, k + 1, 0.0)) for k in range(n - 1)}
        results |= {(0, 7): ambiguous((at(0, 7, 2.0), 0.6)), (0, 6): ambiguous((at(0, 6, second), 0.6))}
        return solve(maps, [(i, j, r) for (i, j), r in results.items()])

    graph = solved(-2.0)
    assert {pair(graph, 0, j).state for j in (6, 7)} == {PairState.UNUSED}
    assert "contradicts that of other ambiguous matches" in pair(graph, 0, 6).why
    assert close(graph.poses[7], truth[7])
    assert {pair(solved(1.8), 0, j).state for j in (6, 7)} == {PairState.SETTLED}


def test_known_poses_alone() -> None:
    known = {0: KnownPose(W), 2: KnownPose(W @ TRUTH[2], 0.5, 0.1)}
    graph = solve(MAPS[:3], [], known)
    assert graph.components == ((0, 2), (1,))
    assert close(graph.poses[2], TRUTH[2], 1e-9)
    assert graph.T_w_i[1] is None
    sigma = np.sqrt(np.diag(graph.covariances[2]))
    np.testing.assert_allclose(sigma, [0.5, 0.5, 0.1], rtol=1e-3)


# ------------------------------------------------------------------ covariances
def test_more_matches_more_exact_and_cycles_that_close_too() -> None:
    few = graph_of(3, {(0, 2): rejected(true(0, 2), 0.6)})
    many = graph_of(5)
    assert many.covariances[2][0, 0] < few.covariances[2][0, 0]


def test_maps_that_bend_are_less_exact() -> None:
    bent = Pose2(0.4, -0.3, math.radians(1.5))
    results = {
        (i, j): accepted(true(i, j) @ (bent if (i + j) % 2 else bent.inverse()))
        for i in range(5)
        for j in range(i + 1, 5)
    }
    bending, straight = graph_of(5, results), graph_of(5)
    assert {p.state for p in bending.pairs} == {PairState.USED}
    assert bending.covariances[3][0, 0] > 2 * straight.covariances[3][0, 0]


# ------------------------------------------------------------------ g2o
@pytest.mark.parametrize("known", [None, {1: KnownPose(W @ TRUTH[1], 0.2, 0.1), 4: KnownPose(W @ TRUTH[4])}])
def test_gtsam_reads_the_g2o_file_and_finds_nothing_to_improve(
    tmp_path_factory: pytest.TempPathFactory, known: dict[int, KnownPose] | None
) -> None:
    gtsam = pytest.importorskip("gtsam")
    others = {
        (1, 3): accepted(true(1, 3) @ FAR),
        (0, 1): ambiguous((true(0, 1), 0.5), (true(0, 1) @ FAR, 0.4)),
        (0, 2): accepted(true(0, 2) @ Pose2(0.2, 0.1, 0.01)),
    }
    graph = graph_of(5, others, known)
    file = tmp_path_factory.mktemp("g2o") / "graph.g2o"
    file.write_text(as_g2o(graph, [f"map {i}\n.yaml" for i in range(5)]))
    factors, values = gtsam.readG2o(str(file), False)
    used = sum(p.T_i_j is not None for p in graph.pairs)
    assert used == 9
    assert factors.size() == used + len(known or {})
    assert values.size() == 5 + bool(known)
    anchor, pose = (5, gtsam.Pose2()) if known else (0, values.atPose2(0))
    factors.add(gtsam.PriorFactorPose2(anchor, pose, gtsam.noiseModel.Isotropic.Sigma(3, 1e-6)))
    params = gtsam.LevenbergMarquardtParams()
    params.setRelativeErrorTol(1e-12)
    better = gtsam.LevenbergMarquardtOptimizer(factors, values, params).optimize()
    for i in range(5):
        moved = better.atPose2(i).localCoordinates(values.atPose2(i))
        assert np.abs(moved).max() < 2e-3
    assert factors.error(better) == pytest.approx(factors.error(values), rel=1e-3)


def test_each_component_has_a_fixed_vertex() -> None:
    graph = graph_of(4, {(i, 3): rejected() for i in range(3)})
    lines = as_g2o(graph, ["a", "b", "c", "d"]).splitlines()
    assert [line for line in lines if line.startswith("FIX")] == ["FIX 0", "FIX 3"]
    assert sum(line.startswith("VERTEX_SE2") for line in lines) == 4
    assert sum(line.startswith("EDGE_SE2") for line in lines) == 3
    assert "# 3: d" in lines


def test_a_graph_without_edges_has_vertices_only() -> None:
    text = as_g2o(solve(MAPS[:2], []), ["a", "b"])
    assert "EDGE" not in text
    assert text.count("VERTEX_SE2") == 2
