"""Merging by the graph, the default; its own properties are tested in tests/merging/graph."""

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import yaml
from drawing import office, seen_from
from hypothesis import given, settings
from hypothesis import strategies as st

import mapmeld
from mapmeld.grid import OccupancyGrid
from mapmeld.matching import Alternative, MatchResult, Verdict
from mapmeld.merging import KnownPose, MergeError, PairState, merge, merge_aligned
from mapmeld.merging.by_graph import seen_from_b
from mapmeld.se2 import Pose2

EXAMPLES = Path(__file__).parents[2] / "examples" / "maps"
QUARTER = math.pi / 2


def spot(number: int) -> OccupancyGrid:
    """A map of one free cell; its percentage tells which map it is."""
    return OccupancyGrid(np.array([[number]], np.int8), 1.0)


def spots(number: int) -> list[OccupancyGrid]:
    return [spot(i) for i in range(number)]


def answering(monkeypatch: pytest.MonkeyPatch, fits: Mapping[tuple[int, int], MatchResult | Pose2]) -> None:
    """Let the matcher accept what is in `fits` as it stands there, and reject all else."""

    def matcher(a: OccupancyGrid, b: OccupancyGrid, *_: object) -> MatchResult:
        asked = int(a.cells[0, 0]), int(b.cells[0, 0])
        found = fits.get(asked)
        if isinstance(found, Pose2):
            return MatchResult(found, Verdict.ACCEPTED, f"fits {asked}", 0.99, 0.5)
        if found is not None:
            return found
        return MatchResult(Pose2(50), Verdict.REJECTED, f"does not fit {asked}", 0.1 + asked[0] / 100)

    monkeypatch.setattr("mapmeld.merging.graph.all_pairs.match", matcher)


def test_two_maps_are_merged_as_they_match(monkeypatch: pytest.MonkeyPatch) -> None:
    T = Pose2(4, 1, QUARTER)
    answering(monkeypatch, {(0, 1): T})
    result = merge(spots(2))
    assert result.poses == result.starts == (Pose2(), T)
    assert result.grid == merge_aligned(spots(2), [Pose2(), T])
    assert [(j.reference, j.index, j.result.T_a_b) for j in result.joints] == [((0,), 1, T)]
    assert result.complete
    assert result.refused == {}
    assert [pair.state for pair in result.pairs] == [PairState.USED]


def test_both_strategies_give_the_same_for_two_maps() -> None:
    maps = [EXAMPLES / "robot_1.yaml", EXAMPLES / "robot_2.yaml"]
    by_graph, one_by_one = merge(maps), merge(maps, strategy="sequential")
    assert by_graph.poses == one_by_one.poses
    assert by_graph.grid == one_by_one.grid
    assert by_graph.components == one_by_one.components
    assert one_by_one.pairs == ()
    assert one_by_one.covariances == (None, None)


def test_components_are_counted_by_their_first_maps(monkeypatch: pytest.MonkeyPatch) -> None:
    answering(monkeypatch, {(0, 3): Pose2(2), (1, 4): Pose2(3), (2, 4): Pose2(4)})
    result = merge(spots(6))
    assert result.components == ((0, 3), (1, 2, 4), (5,))
    assert result.poses == (Pose2(), None, None, Pose2(2), None, None)
    assert [c is None for c in result.covariances] == [False, True, True, False, True, True]
    # From the first map of each component outwards, as seen from the map that was there before.
    assert [(j.reference, j.index, j.result.T_a_b) for j in result.joints] == [
        ((0,), 3, Pose2(2)),
        ((1,), 4, Pose2(3)),
        ((4,), 2, Pose2(4).inverse()),
    ]
    assert set(result.refused) == {1, 2, 4, 5}
    # The most probable match of all with the maps around map 0.
    assert result.refused[5].reason == "does not fit (3, 5)"
    with pytest.raises(MergeError, match=r"4 of 6 maps .*indices 1, 2, 4, 5\)"):
        result.save("nowhere.yaml")


def test_why_a_doubted_match_joined_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    answering(monkeypatch, {(0, 1): Pose2(5), (1, 2): Pose2(5), (0, 2): Pose2(30)})
    result = merge(spots(3))
    assert result.components == ((0,), (1,), (2,))
    assert result.refused[1].verdict is Verdict.AMBIGUOUS
    assert result.refused[1].reason == (
        "fits (0, 1); but contradicted by matches that are about as probable together; none of them is used"
    )
    assert result.joints == ()


def test_a_single_map_and_no_map() -> None:
    alone = merge([office(0.2)])
    assert alone.complete
    assert alone.grid == office(0.2)
    assert (alone.poses, alone.pairs, alone.refused) == ((Pose2(),), (), {})
    with pytest.raises(MergeError, match="no map"):
        merge([])


def test_the_same_map_again_and_again() -> None:
    result = merge([office(0.2)] * 3)
    assert result.complete
    for pose in result.poses:
        assert pose is not None
        assert pose.distance_to(Pose2()) == pytest.approx((0, 0), abs=0.02)


# ------------------------------------------------------------------ known poses
W = Pose2(7, 8, 0.5)


def test_known_poses_without_matching(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mapmeld.merging.graph.all_pairs.match", lambda *_: pytest.fail("matched"))
    T = Pose2(3, 1, QUARTER)
    known = {0: KnownPose(W), 1: KnownPose(W @ T)}
    result = merge(spots(3), known_poses=known, matching=False)
    assert result.components == ((0, 1), (2,))
    assert result.poses[1] is not None
    assert result.poses[1].distance_to(T) == pytest.approx((0, 0), abs=1e-9)
    assert result.refused[2].reason == "not matched, and its pose is not known"
    assert result.refused[2].T_a_b is None


def test_known_poses_and_matches_together(monkeypatch: pytest.MonkeyPatch) -> None:
    answering(monkeypatch, {(1, 2): Pose2(0, 4)})
    known = {0: KnownPose(W), 1: KnownPose(W @ Pose2(3))}
    result = merge(spots(3), known_poses=known)
    assert result.complete
    assert result.poses[2] is not None
    assert result.poses[2].distance_to(Pose2(3, 4)) == pytest.approx((0, 0), abs=1e-5)


# ------------------------------------------------------------------ what contradicts itself
@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"strategy": "both"}, "unknown strategy 'both': choose from graph, sequential"),
        ({"strategy": "sequential", "known_poses": {0: KnownPose(W)}}, "are for strategy 'graph'"),
        ({"strategy": "sequential", "matching": False}, "are for strategy 'graph'"),
        ({"strategy": "sequential", "workers": 2}, "are for strategy 'graph'"),
        ({"solver": "ours"}, "unknown solver 'ours': choose from own, gtsam"),
        ({"matching": False}, "poses must be known"),
        ({"known_poses": {2: KnownPose(W)}}, "not there: 2"),
    ],
)
def test_settings_that_cannot_be(
    options: dict[str, object], complaint: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for place in ("graph.all_pairs", "sequential"):
        monkeypatch.setattr(f"mapmeld.merging.{place}.match", lambda *_: pytest.fail("matched"))
    with pytest.raises(MergeError, match=complaint):
        merge(spots(2), **options)  # type: ignore[arg-type]


# ------------------------------------------------------------------ real maps
TRUTH = yaml.safe_load((EXAMPLES / "truth.yaml").read_text())["transforms"]
T_1 = {1: Pose2(), 2: Pose2(*TRUTH["T_1_2"]), 3: Pose2(*TRUTH["T_1_3"])}


@pytest.mark.parametrize("order", [(1, 2, 3), (2, 3, 1), (3, 1, 2)])
@pytest.mark.parametrize("solver", ["own", "gtsam"])
def test_the_example_maps_with_another_building_among_them(order: tuple[int, int, int], solver: str) -> None:
    if solver == "gtsam":
        pytest.importorskip("gtsam")
    first, *others = (EXAMPLES / f"robot_{i}.yaml" for i in order)
    result = merge([first, EXAMPLES / "other_building.yaml", *others], solver=solver)  # type: ignore[arg-type]
    assert result.components == ((0, 2, 3), (1,))
    for i, T in zip(order, (result.poses[0], result.poses[2], result.poses[3]), strict=True):
        assert T is not None
        metres, radians = T.distance_to(T_1[order[0]].inverse() @ T_1[i])
        assert metres < 0.25  # as far as SLAM bent the maps
        assert radians < math.radians(1.0)


def test_where_the_maps_frames_lie_does_not_matter() -> None:
    """A map in another frame has another pose, and lies where it lay."""
    maps = [mapmeld.load(EXAMPLES / f"robot_{i}.yaml") for i in (1, 2, 3)]
    T = Pose2(-4, 11, 2.5)
    before, after = merge(maps), merge([maps[0], maps[1].moved(T), maps[2]])
    assert before.poses[1] is not None
    assert after.poses[1] is not None
    found = (after.poses[1] @ T).distance_to(before.poses[1])
    assert found == pytest.approx((0, 0), abs=0.01)
    assert after.poses[2] is not None
    assert before.poses[2] is not None
    assert after.poses[2].distance_to(before.poses[2]) == pytest.approx((0, 0), abs=0.01)


def test_the_maps_may_be_stored_and_matched_by_workers(tmp_path: Path) -> None:
    a = office(0.2)
    maps = [a, seen_from(a, Pose2(2, -7, 0.7)), seen_from(a, Pose2(-3, 1, -2))]
    ticks: list[int] = []
    one = merge(maps, workers=2, store=tmp_path / "pairs")
    two = merge(maps, store=tmp_path / "pairs", on_pair=lambda: ticks.append(1))
    assert one.poses == two.poses
    assert len(ticks) == 3
    assert merge(maps).poses == one.poses


# ------------------------------------------------------------------ answers the other way round
@settings(max_examples=30)
@given(st.from_type(Pose2), st.from_type(Pose2))
def test_an_answer_seen_from_the_other_map(T: Pose2, other: Pose2) -> None:
    covariance = np.diag([0.01, 0.02, 0.001])
    result = MatchResult(T, Verdict.ACCEPTED, "", 0.9, 0.5, 0.6, covariance, (Alternative(other, 0.1, 0.05),))
    back = seen_from_b(result)
    assert back.T_a_b == T.inverse()
    assert back.alternatives[0].T_a_b == other.inverse()
    again = seen_from_b(back)
    assert again.T_a_b is not None
    assert again.T_a_b.distance_to(T) == pytest.approx((0, 0), abs=1e-9)
    assert again.covariance is not None
    np.testing.assert_allclose(again.covariance, covariance, atol=1e-9)
    assert seen_from_b(MatchResult(None, Verdict.REJECTED, "")).T_a_b is None
