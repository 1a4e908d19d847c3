import math

import numpy as np
import pytest

from mapmeld.matching.alphabet import compare_alphabets, generate_alphabet, greatest_distance
from mapmeld.se2 import Pose2

# A right angle at the middle letter and a far corner:  2 (0, 4)
#                                                       0 (0, 0)   1 (3, 0)        3 (100, 0)
CORNERS = np.array([(0, 0), (3, 0), (0, 4), (100, 0)], float)


def test_relations_keep_between_the_least_and_the_greatest_distance() -> None:
    alphabet = generate_alphabet(CORNERS, 3.0, 4.0)  # both bounds belong to the range
    relations = set(zip(alphabet.letter.tolist(), alphabet.other.tolist(), strict=True))
    assert relations == {(0, 1), (1, 0), (0, 2), (2, 0)}
    assert sorted(alphabet.distance_px) == [3, 3, 4, 4]


def test_no_corner_is_related_to_itself() -> None:
    assert len(generate_alphabet(CORNERS[:1], 0.0, 10.0).letter) == 0
    alphabet = generate_alphabet(CORNERS, 0.0, 1000.0)
    assert (alphabet.letter != alphabet.other).all()
    assert len(alphabet.letter) == 4 * 3


def test_angles_are_signed_and_counter_clockwise() -> None:
    angles = generate_alphabet(CORNERS[:3], 1.0, 10.0).angles(0)  # relations to 1 (east), 2 (north)
    np.testing.assert_allclose(np.degrees(angles), [[0, 90], [-90, 0]])


def test_angles_stay_within_half_a_turn() -> None:
    star = np.array([(0, 0), (-5, 1), (-5, -1)], float)
    angles = generate_alphabet(star, 4.0, 10.0).angles(0)
    np.testing.assert_allclose(angles[0, 1], 2 * np.arctan2(1, 5))


@pytest.mark.parametrize(
    ("corners", "distance"), [(CORNERS, np.hypot(100, 4)), (CORNERS[:1], 0), (CORNERS[:0], 0)]
)
def test_the_greatest_distance(corners: np.ndarray, distance: float) -> None:
    assert greatest_distance(corners) == pytest.approx(distance)


def test_bounds_the_wrong_way_round_leave_letters_without_relations() -> None:
    assert len(generate_alphabet(CORNERS, 5.0, 4.0).letter) == 0


@pytest.mark.parametrize(("least", "greatest"), [(18.0, 1000.0), (1.0, 30.0)])
def test_relations_as_long_as_a_bound_stay_so_wherever_the_map_lies(least: float, greatest: float) -> None:
    corners = np.array([(0, 0), (18, 0), (0, 30)], float)
    alphabet = generate_alphabet(corners, least, greatest)
    gamma = compare_alphabets(alphabet, alphabet, 1.1, math.radians(1.1))
    assert gamma[0, 0] == 1  # 18 and 30 are both in
    for T in np.random.default_rng(0).uniform((-100, -100, -math.pi), (100, 100, math.pi), (200, 3)):
        moved = generate_alphabet(Pose2(*T).apply(corners), least, greatest)
        assert moved.letter.tolist() == alphabet.letter.tolist()
        assert moved.other.tolist() == alphabet.other.tolist()
        for one, other in ((alphabet, moved), (moved, alphabet)):
            np.testing.assert_array_equal(compare_alphabets(one, other, 1.1, math.radians(1.1)), gamma)
