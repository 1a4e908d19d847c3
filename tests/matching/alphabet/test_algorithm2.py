import math
from itertools import combinations, pairwise

import numpy as np
import pytest
from drawing import drawn, office, seen_from
from hypothesis import given, settings
from hypothesis import strategies as st

import mapmeld
from mapmeld.grid import OccupancyGrid
from mapmeld.matching import Verdict
from mapmeld.matching.alphabet import (
    AlphabetParameters,
    in_metres,
    map_matching,
    match_alphabet,
    preprocess,
)
from mapmeld.se2 import Pose2

A = office()
B_T = Pose2(2.0, -7.0, 0.7)  # takes A's frame into B's
B = seen_from(A, B_T)


def error(found: Pose2 | None, T_a_b: Pose2) -> tuple[float, float]:
    """Errors in metres, at the middle of the office, and degrees."""
    assert found is not None
    middle = T_a_b.inverse().apply((8.0, 6.0))
    return float(np.hypot(*(found.apply(middle) - (8.0, 6.0)))), math.degrees(found.distance_to(T_a_b)[1])


def test_a_turned_map_is_found() -> None:
    result = mapmeld.match(A, B, method="alphabet")
    metres, degrees = error(result.T_a_b, B_T.inverse())
    assert metres < 0.1
    assert degrees < 0.5
    assert result.verdict is Verdict.ACCEPTED
    assert result.method == "alphabet"
    assert result.seconds > 0
    assert result.probability is None
    assert result.overlap > 0.95
    assert f"{result.similarity:.3f}" in result.reason
    assert all(other.similarity <= result.similarity for other in result.alternatives)


@pytest.mark.parametrize("resolution", [0.04, 0.08])
def test_maps_of_different_resolution_are_matched_at_the_coarser(resolution: float) -> None:
    other = seen_from(office(0.02), B_T, resolution)
    result = mapmeld.match(A, other, method="alphabet")
    metres, degrees = error(result.T_a_b, B_T.inverse())
    assert metres < 0.15
    assert degrees < 1.0
    matching = map_matching(A, other, AlphabetParameters())
    assert {m.resolution for m in matching.maps} == {max(0.05, resolution)}


# A part of the office: the greatest distance among its corners is smaller than in the whole.
PART = OccupancyGrid(A.cells[:150, :170], A.resolution)


@pytest.mark.parametrize(("a", "b"), [(A, PART), (PART, A)])
@pytest.mark.parametrize("share", [1.0, 0.5])
@pytest.mark.parametrize("least", [18.0, 70.0])
def test_both_alphabets_have_the_same_bounds(
    a: OccupancyGrid, b: OccupancyGrid, share: float, least: float
) -> None:
    parameters = AlphabetParameters(relation_max_share=share, relation_min_px=least)
    alphabets = map_matching(a, b, parameters).alphabets
    distances = []
    for alphabet in alphabets:
        x, y = alphabet.corners_px.T
        distances.append(np.hypot(x[:, None] - x, y[:, None] - y))
    small, large = sorted(float(d.max()) for d in distances)
    assert small < 0.8 * large  # else the two maps could not be told apart
    for alphabet, distance in zip(alphabets, distances, strict=True):
        expected = np.argwhere((distance >= least - 1e-6) & (distance <= share * large + 1e-6))
        assert np.stack([alphabet.letter, alphabet.other], axis=1).tolist() == expected.tolist()
        assert ((distance > 0) & (distance < least)).any()


def test_the_size_of_the_median_holds_for_both_maps() -> None:
    matching = map_matching(A, B, AlphabetParameters(median_px=1))
    for grid, image in zip((A, B), matching.preprocessed, strict=True):
        np.testing.assert_array_equal(image, preprocess(grid, 1))
        assert (image != preprocess(grid)).any()


def test_alternatives_are_other_modes_best_first() -> None:
    result = match_alphabet(A, B)
    similarities = [result.similarity, *(other.similarity for other in result.alternatives)]
    assert len(similarities) > 5
    assert all(one > next_one for one, next_one in pairwise(similarities))
    middle = B.lattice_to_metres((B.shape[1] / 2, B.shape[0] / 2))
    assert result.T_a_b is not None
    modes = [result.T_a_b, *(other.T_a_b for other in result.alternatives)]
    for one, other in combinations(modes, 2):
        metres = float(np.hypot(*(one.apply(middle) - other.apply(middle))))
        assert metres > 0.5 or one.distance_to(other)[1] > math.radians(5)
    # Every other fitting repeats one of them.
    matching = map_matching(A, B, AlphabetParameters())
    assert len(matching.fittings) > len(modes)
    assert modes[0] == in_metres(matching.fittings[0].T_1_2_px, A, B)


@settings(max_examples=20)
@given(st.from_type(Pose2), st.from_type(Pose2))
def test_moving_the_frames_moves_the_answer(T_1_a: Pose2, T_2_b: Pose2) -> None:
    still = match_alphabet(A, B).T_a_b
    moved = match_alphabet(A.moved(T_1_a), B.moved(T_2_b)).T_a_b
    assert still is not None
    assert moved is not None
    metres, radians = moved.distance_to(T_1_a @ still @ T_2_b.inverse())
    assert metres < 1e-6
    assert radians < 1e-9


@settings(max_examples=20)
@given(*[st.integers(5, 60)] * 4)
def test_unknown_border_changes_nothing(left: int, bottom: int, right: int, top: int) -> None:
    framed = A.extended(5, 5, 5, 5)
    still = match_alphabet(framed, B).T_a_b
    padded = match_alphabet(A.extended(left, bottom, right, top), B.extended(top, right, bottom, left)).T_a_b
    assert still is not None
    assert padded is not None
    assert padded.distance_to(still) == pytest.approx((0, 0), abs=1e-9)


@pytest.mark.parametrize(
    ("nothing", "reason"),
    [
        (OccupancyGrid(np.zeros((0, 0), np.int8), 0.05), "map b has no obstacle"),
        (drawn("."), "map b has no obstacle"),
        (drawn("#"), "have no relations"),
        (drawn("   \n   "), "map b has no obstacle"),
        (drawn("\n".join(["." * 50] * 50)), "map b has no obstacle"),
    ],
)
def test_a_map_with_nothing_to_match_on_is_rejected_with_the_reason(
    nothing: OccupancyGrid, reason: str
) -> None:
    result = mapmeld.match(A, nothing, method="alphabet")
    assert result.verdict is Verdict.REJECTED
    assert result.T_a_b is None
    assert "nothing to match on" in result.reason
    assert reason in result.reason
    swapped = mapmeld.match(nothing, A, method="alphabet")
    assert swapped.verdict is Verdict.REJECTED
    assert reason.replace("map b", "map a") in swapped.reason


def test_the_same_input_gives_the_same_answer() -> None:
    one, two = match_alphabet(A, B), match_alphabet(A, B)
    assert one == two


def test_the_threshold_decides() -> None:
    similarity = match_alphabet(A, B).similarity
    strict = AlphabetParameters(accept_similarity=similarity + 0.01)
    result = match_alphabet(A, B, strict)
    assert result.verdict is Verdict.REJECTED
    assert "below" in result.reason
    assert result.T_a_b == match_alphabet(A, B).T_a_b
