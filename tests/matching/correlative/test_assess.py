import math

import pytest
from drawing import cut, office, row_of_rooms, school, seen_from
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.grid import OccupancyGrid, ResolutionError, overlap_share
from mapmeld.matching import Verdict, match
from mapmeld.matching.correlative import CorrelativeParameters
from mapmeld.matching.correlative import assess as assess_module
from mapmeld.matching.correlative import search as search_module
from mapmeld.matching.correlative.assess import assess, similarity_at
from mapmeld.se2 import Pose2

T_B_A = Pose2(3.0, -2.0, 0.7)
T_A_B = T_B_A.inverse()


@pytest.fixture(scope="module")
def maps() -> tuple[OccupancyGrid, OccupancyGrid]:
    return office(), seen_from(office(), T_B_A)


def test_the_true_transform_is_as_probable_as_the_matcher_says(
    maps: tuple[OccupancyGrid, OccupancyGrid],
) -> None:
    found = match(*maps)
    # With its rivals: alone it would be surer.
    given = assess(*maps, [T_A_B, *(other.T_a_b for other in found.alternatives)])
    assert given.verdict is Verdict.ACCEPTED
    assert given.probability == pytest.approx(found.probability, abs=0.01)
    assert given.similarity == pytest.approx(found.similarity, abs=0.02)
    assert given.overlap == pytest.approx(found.overlap, abs=0.01)
    assert given.covariance is not None
    assert "m of wall in the overlap" in given.reason


def test_it_is_aligned_to_the_walls_near_it(maps: tuple[OccupancyGrid, OccupancyGrid]) -> None:
    near = assess(*maps, [Pose2(0.15, -0.1, math.radians(1.5)) @ T_A_B])
    assert near.T_a_b is not None
    metres, radians = near.T_a_b.distance_to(T_A_B)
    assert metres < 0.05
    assert radians < 0.01


def test_a_wrong_one_is_not_probable_and_no_other_is_looked_for(
    maps: tuple[OccupancyGrid, OccupancyGrid], monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: object) -> None:
        raise AssertionError("searched")

    monkeypatch.setattr(search_module, "_correlate", never)
    wrong = assess(*maps, [Pose2(2.0, 1.0, 0.4) @ T_A_B])
    assert wrong.probability is not None
    assert wrong.probability < 0.01
    assert wrong.verdict is Verdict.REJECTED


def test_the_best_comes_first_and_repetitions_count_once(maps: tuple[OccupancyGrid, OccupancyGrid]) -> None:
    wrong, again = Pose2(2.0, 1.0, 0.4) @ T_A_B, Pose2(0.05, 0.0, 0.0) @ T_A_B
    found = assess(*maps, [wrong, T_A_B, again])
    assert found.T_a_b is not None
    assert found.T_a_b.distance_to(T_A_B)[0] < 0.05
    assert len(found.alternatives) == 1
    assert found.probability is not None
    assert found.probability > 0.99


def test_rivals_share_the_probability() -> None:
    rooms = row_of_rooms(5)
    one = cut(rooms, 4, 0, 8.1, 5)
    alone = assess(rooms, one, [Pose2()])
    rivals = assess(rooms, one, [Pose2(), Pose2(4.0, 0.0, 0.0)])
    assert alone.probability is not None
    assert rivals.probability is not None
    assert rivals.probability < 0.6 * alone.probability


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (office(), seen_from(office(), T_B_A)),
        (cut(office(), 0, 0, 10, 12), cut(office(), 6, 0, 16, 12)),
        (cut(school(), 0, 0, 12, 9), cut(office(), 0, 0, 8, 12)),
        (row_of_rooms(6), cut(row_of_rooms(6), 4, 0, 12.1, 5)),
    ],
    ids=["all", "overlapping", "different", "repeating"],
)
def test_with_all_rivals_it_is_what_the_matcher_says(a: OccupancyGrid, b: OccupancyGrid) -> None:
    found = match(a, b)
    assert found.T_a_b is not None
    assert found.probability is not None
    again = assess(a, b, [found.T_a_b, *(other.T_a_b for other in found.alternatives)])
    assert again.probability == pytest.approx(found.probability, abs=0.02)
    alone = assess(a, b, [found.T_a_b])
    assert alone.probability is not None
    if (found.alternatives[0].probability or 0.0) < 0.1:  # missing rivals count as usual ones
        assert alone.probability < found.probability + 0.3


@given(
    st.floats(-40, 40), st.floats(-40, 40), st.floats(-4, 4), st.sampled_from([(0, 0, 3, 2), (8, 3, 16, 12)])
)
def test_transforms_that_lay_the_maps_side_by_side_are_dropped(
    x: float, y: float, theta: float, part: tuple[float, float, float, float]
) -> None:
    a, b, T = office(), cut(office(), *part), Pose2(x, y, theta)
    weighed = assess(a, b, [T])
    if overlap_share(a, b, T) > 0:
        assert weighed.T_a_b is not None
    if weighed.T_a_b is None:
        assert "do not meet" in weighed.reason
        assert similarity_at(a, b, T, CorrelativeParameters()) == 0.0


@pytest.mark.parametrize("way", [Pose2(30, 0, 0), Pose2(-30, 0, 0), Pose2(0, 30, 0), Pose2(0, -30, 0)])
def test_nothing_is_weighed_where_the_maps_do_not_meet(way: Pose2, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(assess_module, "weigh", None)
    monkeypatch.setattr(assess_module, "refine", None)
    assert assess(office(), school(), [way]).T_a_b is None
    assert similarity_at(office(), school(), way, CorrelativeParameters()) == 0.0


def test_both_maps_play_the_same_part(maps: tuple[OccupancyGrid, OccupancyGrid]) -> None:
    a, b = maps
    part = cut(b, 2, 2, 9, 9)
    one, other = assess(a, part, [T_A_B]), assess(part, a, [T_B_A])
    assert one.T_a_b is not None
    assert other.T_a_b is not None
    metres, radians = other.T_a_b.inverse().distance_to(one.T_a_b)
    assert metres < 1e-9
    assert radians < 1e-9
    assert one.probability == pytest.approx(other.probability)
    assert similarity_at(a, part, T_A_B, CorrelativeParameters()) == pytest.approx(
        similarity_at(part, a, T_B_A, CorrelativeParameters())
    )


def test_the_threshold_is_that_of_the_settings(maps: tuple[OccupancyGrid, OccupancyGrid]) -> None:
    a, b = maps
    part = cut(b, 5, 5, 10, 10)
    p = assess(a, part, [T_A_B]).probability
    assert p is not None
    for accept in (0.55, 0.95):
        verdict = assess(a, part, [T_A_B], CorrelativeParameters(accept_probability=accept)).verdict
        assert (verdict is Verdict.ACCEPTED) == (p >= accept)


def test_nothing_to_weigh(maps: tuple[OccupancyGrid, OccupancyGrid]) -> None:
    a, b = maps
    bare = OccupancyGrid(a.cells * 0, 0.05)
    for one, other in ((a, bare), (bare, a)):
        answer = assess(one, other, [Pose2()])
        assert answer.T_a_b is None
        assert answer.probability == 0.0
        assert "has no obstacle" in answer.reason
        assert similarity_at(one, other, Pose2(), CorrelativeParameters()) == 0.0
    assert assess(a, b, []).T_a_b is None
    far = assess(a, school(), [Pose2(500.0, 0.0, 0.0)])
    assert far.probability == pytest.approx(0.0, abs=1e-6)
    with pytest.raises(ResolutionError):
        assess(a, OccupancyGrid(b.cells, 50.0), [Pose2()])
