import math

import cv2
import numpy as np
import pytest
from drawing import cut, hall, office, row_of_rooms, school, seen_from
from hypothesis import given, settings
from hypothesis import strategies as st
from ready import reduced

from mapmeld.matching.correlative.search import (
    APART_METRES,
    APART_RADIANS,
    LISTED,
    Hypothesis,
    _distinct,
    _interpolation,
    _Raster,
    _spectrum,
    search,
)
from mapmeld.se2 import Pose2

A = office()
OFFICE = reduced(A)


def off(found: Pose2, truth: Pose2, at: tuple[float, float] = (8.0, 6.0)) -> tuple[float, float]:
    point = truth.inverse().apply(at)
    return float(np.hypot(*(found.apply(point) - at))), math.degrees(found.distance_to(truth)[1])


def assert_first(found: list[Hypothesis], truth: Pose2) -> None:
    metres, degrees = off(found[0].T_a_b, truth)
    assert metres < 0.3
    assert degrees < 2.1
    assert [h.score for h in found] == sorted((h.score for h in found), reverse=True)


@settings(max_examples=15)
@given(st.floats(-math.pi, math.pi))
def test_the_truth_comes_first_for_any_turn(turn: float) -> None:
    T = Pose2(2, -7, turn)
    assert_first(search(OFFICE, reduced(seen_from(A, T))), T.inverse())


@pytest.mark.parametrize("quarter", range(4))
def test_the_truth_comes_first_for_parts(quarter: int) -> None:
    T = Pose2(-5, 3, 0.4 + quarter * math.pi / 2)
    a, b = reduced(cut(A, 0, 0, 11, 12)), reduced(seen_from(cut(A, 5, 0, 16, 12), T))
    assert_first(search(a, b), T.inverse())


@pytest.mark.parametrize("resolutions", [(0.02, 0.2), (0.1, 0.05), (0.04, 0.07)])
def test_the_truth_comes_first_for_mixed_resolutions(resolutions: tuple[float, float]) -> None:
    T = Pose2(2, -7, 1.0)
    fine = office(0.02)
    a, b = (seen_from(fine, P, r) for P, r in zip((Pose2(), T), resolutions, strict=True))
    assert_first(search(reduced(a), reduced(b)), T.inverse())


def test_frames_move_along() -> None:
    T_1_a, T_2_b = Pose2(100, -30, 2), Pose2(-7, 5, -1)
    still = search(OFFICE, reduced(school()))
    moved = search(reduced(A.moved(T_1_a)), reduced(school().moved(T_2_b)))
    for one, other in zip(still, moved, strict=True):
        assert (T_1_a @ one.T_a_b @ T_2_b.inverse()).distance_to(other.T_a_b) == pytest.approx(
            (0, 0), abs=1e-6
        )
        assert one.score == other.score


def test_both_ways_of_a_symmetric_hall_are_listed() -> None:
    T = Pose2(1, 2, 0.7)
    found = search(reduced(hall()), reduced(seen_from(hall(), T)))
    half_turn = Pose2(14, 8, math.pi)
    for truth in (T.inverse(), half_turn @ T.inverse()):
        assert any(off(h.T_a_b, truth, (7.0, 4.0))[0] < 0.4 for h in found[:2])


def test_every_room_of_a_row_is_listed() -> None:
    g = row_of_rooms(6)
    a, b = reduced(cut(g, 1, 0, 15, 5)), reduced(cut(g, 5, 0, 19, 5))
    found = search(a, b)
    for x in (0, -4, -8):
        assert any(off(h.T_a_b, Pose2(x, 0, 0), (8.0, 2.5))[0] < 0.4 for h in found[:12]), x


def test_the_list_is_no_longer_than_asked_for_and_repeats_nothing() -> None:
    b = reduced(school())
    everything = search(OFFICE, b)
    assert len(everything) <= LISTED
    assert search(OFFICE, b, 5) == everything[:5]
    assert len(everything) > 5


def test_small_maps_are_searched_too() -> None:
    corner = reduced(cut(A, 0, 0, 1, 1))
    assert search(OFFICE, corner, 3)
    assert search(corner, corner, 3)[0].score > 0


# ---------------------------------------------------------------------- the list
def kept(*poses: tuple[float, float, float]) -> list[tuple[float, ...]]:
    scored = np.array([(*pose, 1 - 0.001 * i) for i, pose in enumerate(poses)]).reshape(-1, 4)
    return [tuple(row[:3].tolist()) for row in _distinct(scored)]


def test_what_is_near_a_better_one_is_left_out() -> None:
    a_bit, more = 0.9 * APART_METRES, 1.1 * APART_METRES
    assert kept((0, 0, 0), (a_bit, 0, 0)) == [(0, 0, 0)]
    assert kept((0, 0, 0), (0, more, 0)) == [(0, 0, 0), (0, more, 0)]
    assert kept((0, 0, 0), (0, 0, 1.1 * APART_RADIANS)) == [(0, 0, 0), (0, 0, 1.1 * APART_RADIANS)]
    assert kept((0, 0, 0), (a_bit, 0, 0.9 * APART_RADIANS)) == [(0, 0, 0)]
    assert kept((0, 0, math.pi - 0.01), (0, 0, 0.01 - math.pi)) == [(0, 0, math.pi - 0.01)]
    # What was left out leaves nothing out itself.
    assert kept((0, 0, 0), (a_bit, 0, 0), (2 * a_bit, 0, 0)) == [(0, 0, 0), (2 * a_bit, 0, 0)]


def test_the_list_ends() -> None:
    assert kept() == []
    many = [(float(k), 0.0, 0.0) for k in range(3 * LISTED)]
    assert kept(*many) == many[:LISTED]


# ---------------------------------------------------------------------- the pictures that are correlated
PICTURE = _Raster(np.random.default_rng(2).random((31, 44)).astype(np.float32), 0.2, (20.3, 17.0))


@given(st.floats(-math.pi, math.pi), st.sampled_from([0.2, 0.3, 0.71]))
def test_a_picture_turned_by_a_quarter_is_the_turned_picture_turned_by_a_quarter(
    theta: float, cell: float
) -> None:
    one = np.rot90(PICTURE.turned(theta, cell), -1)
    other = PICTURE.turned(theta + math.pi / 2, cell)
    # Rounding may decide about a row or column of nothing at the edge.
    rows, cols = (max(n) for n in zip(one.shape, other.shape, strict=True))
    one, other = (np.pad(i, [((rows - i.shape[0]) // 2,), ((cols - i.shape[1]) // 2,)]) for i in (one, other))
    np.testing.assert_allclose(one, other, atol=0.05)  # OpenCV may round places to 1/32 pixel


@given(st.floats(-math.pi, math.pi), st.floats(0.2, 0.7))
def test_nothing_of_a_turned_picture_is_cut_off(theta: float, cell: float) -> None:
    whole = PICTURE.turned(theta, cell)
    assert all(n % 2 == 0 for n in whole.shape)
    # Each pixel stands for cell^2; that sum is the picture's own but for what sampling misses.
    assert whole.sum() * cell**2 == pytest.approx(PICTURE.image.sum() * PICTURE.cell**2, rel=0.15)
    dark = _Raster(np.ones((31, 44), np.float32), 0.2, (20.3, 17.0)).turned(theta, 0.2)
    assert dark.sum() == pytest.approx(31 * 44, rel=0.01)


@pytest.mark.parametrize("shape", [(10, 8), (20, 16), (6, 20), (20, 4), (4, 4)])
def test_pictures_are_cut_or_filled_up_about_their_middle(shape: tuple[int, int]) -> None:
    image = np.random.default_rng(0).random((8, 10)).astype(np.float32)
    found = cv2.dft(_spectrum(image, shape), flags=cv2.DFT_INVERSE | cv2.DFT_SCALE)
    expected = np.zeros(shape[::-1], np.float32)
    for row in range(shape[1]):
        for col in range(shape[0]):
            r, c = row + (8 - shape[1]) // 2, col + (10 - shape[0]) // 2
            if 0 <= r < 8 and 0 <= c < 10:
                expected[row, col] = image[r, c]
    np.testing.assert_allclose(found, expected, atol=1e-6)


@given(st.lists(st.floats(-30, 30), min_size=1, max_size=8), st.integers(1, 6))
def test_interpolation_is_linear_between_values_that_repeat(at: list[float], n: int) -> None:
    values = np.arange(n) ** 2.0
    expected = np.interp(at, np.arange(-40, 41), [values[k % n] for k in range(-40, 41)])
    np.testing.assert_allclose(_interpolation(np.array(at), n) @ values, expected, atol=1e-4)
