import math

import numpy as np
import pytest
from drawing import cut, drawn, hall, office, row_of_rooms, school, seen_from
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmeld.grid import UNKNOWN, OccupancyGrid
from mapmeld.index.ranking import Ranking
from mapmeld.index.signature import (
    Signature,
    describe,
    packed_words,
    signature_of,
    vocabulary,
    word_count,
    words_from,
)
from mapmeld.index.views import MOST, SIZE, Views, wall_views
from mapmeld.se2 import Pose2

OTHERS = [signature_of(grid) for grid in (school(), hall(), row_of_rooms(3))]
OFFICE = office()


def likeness(a: OccupancyGrid, b: OccupancyGrid) -> float:
    """The score of b among the other buildings, asked with a."""
    return float(Ranking.of([signature_of(b), *OTHERS]).scores(signature_of(a))[0])


def others_best(a: OccupancyGrid) -> float:
    return float(Ranking.of([signature_of(OFFICE), *OTHERS]).scores(signature_of(a))[1:].max())


def test_views_are_of_length_one_and_words_too_many_to_be_one_another() -> None:
    views = wall_views(OFFICE).seen[0]
    assert views.shape[1] == SIZE
    assert len(views) > 100
    np.testing.assert_allclose(np.linalg.norm(views, axis=1), 1, atol=1e-5)
    assert (views >= 0).all()


def test_the_vocabulary_is_what_views_are() -> None:
    assert word_count() == sum(map(len, vocabulary()))
    for words in vocabulary():
        assert words.shape[1] == SIZE
        assert (words >= 0).all()
        assert np.linalg.norm(words, axis=1).min() > 0.2
        assert np.linalg.norm(words, axis=1).max() < 1.02


def test_words_survive_packing_to_half_a_step() -> None:
    words = np.random.default_rng(0).random((5, SIZE)).astype(np.float32)
    assert np.abs(words_from(packed_words(words)) - words).max() <= 0.5 / 255 + 1e-6


def test_each_view_counts_for_its_nearest_word() -> None:
    words = np.eye(SIZE, dtype=np.float32)[:4]
    seen = np.array([words[2], words[0], 0.9 * words[2] + 0.1 * words[1]], np.float32)
    found = describe(Views((seen, 0 * seen), np.array([1, 2, 1], np.float32)), (words, words))
    assert found.weights.tolist() == [180, 0, 180, 0, 0, 0, 0, 0]  # half of the length each


@pytest.mark.parametrize("picture", ["   ", "...", " # "])
def test_maps_with_no_wall_to_look_at_have_no_words(picture: str) -> None:
    assert not signature_of(drawn(picture)).weights.any()


@given(quarters=st.integers(0, 3), pad=st.tuples(*[st.integers(0, 40)] * 4), origin=st.from_type(Pose2))
@settings(max_examples=15)
def test_quarter_turns_padding_and_other_frames_change_next_to_nothing(
    quarters: int, pad: tuple[int, int, int, int], origin: Pose2
) -> None:
    turned = OccupancyGrid(np.rot90(OFFICE.cells, quarters), OFFICE.resolution, origin)
    assert likeness(turned.extended(*pad), OFFICE) > 0.7


@given(quarters=st.integers(1, 3), pad=st.tuples(*[st.integers(0, 40)] * 4), origin=st.from_type(Pose2))
@settings(max_examples=15)
def test_a_quarter_turn_changes_nothing_where_all_of_the_wall_is_looked_at(
    quarters: int, pad: tuple[int, int, int, int], origin: Pose2
) -> None:
    half = cut(OFFICE, 0, 0, 8, 12)  # the whole has more points of wall than are looked at
    assert len(wall_views(half).metres) < MOST
    turned = OccupancyGrid(np.rot90(half.cells, quarters), half.resolution, origin).extended(*pad)
    difference = signature_of(turned).weights.astype(int) - signature_of(half).weights
    assert np.abs(difference).max() <= 1  # of 255: the last digit of a sum


def test_padding_by_whole_cells_of_unknown_space_and_the_frame_change_nothing() -> None:
    plain, moved = signature_of(OFFICE), signature_of(OFFICE.extended(20, 30, 7, 3).moved(Pose2(9, 8, 2)))
    assert np.array_equal(plain.weights, moved.weights)


@given(
    theta=st.floats(-math.pi, math.pi),
    x=st.floats(-30, 30),
    y=st.floats(-30, 30),
    resolution=st.sampled_from([0.03, 0.04, 0.05, 0.06]),
)
@settings(max_examples=15)
def test_any_turn_shift_and_resolution_leave_it_nearer_to_itself_than_to_others(
    theta: float, x: float, y: float, resolution: float
) -> None:
    other = seen_from(OFFICE, Pose2(x, y, theta), resolution)
    assert likeness(other, OFFICE) > max(0.3, 1.5 * others_best(other))


@given(theta=st.floats(-math.pi, math.pi), left=st.booleans())
@settings(max_examples=15)
def test_half_a_map_is_nearer_to_the_whole_than_to_others(theta: float, left: bool) -> None:
    half = cut(OFFICE, 0 if left else 8, 0, 8 if left else 16, 12)
    asked = seen_from(half, Pose2(1, 2, theta))
    assert likeness(asked, OFFICE) > 1.2 * others_best(asked)


def test_a_mirrored_map_is_another() -> None:
    mirrored = OccupancyGrid(OFFICE.cells[:, ::-1], OFFICE.resolution)
    assert likeness(mirrored, OFFICE) < 0.6
    turn = Pose2(0, 0, 1.0)
    assert likeness(seen_from(mirrored, turn), OFFICE) < likeness(seen_from(OFFICE, turn), OFFICE)


def test_what_is_unknown_around_changes_nothing() -> None:
    assert likeness(OFFICE, OFFICE) == pytest.approx(1, abs=1e-6)
    empty = OccupancyGrid(np.full((5, 5), UNKNOWN, np.int8), 0.05)
    order, scores = Ranking.of(OTHERS).best(signature_of(empty))
    assert len(order) == len(scores) == 0


def test_an_index_of_maps_without_words_finds_nothing() -> None:
    none = Signature(np.zeros(word_count(), np.uint8))
    assert len(Ranking.of([none, none]).best(signature_of(OFFICE))[0]) == 0
    assert len(Ranking.of([]).best(signature_of(OFFICE))[0]) == 0
