import math
from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from mapmeld.matching.alphabet import Alphabet, compare_alphabets, generate_alphabet
from mapmeld.se2 import Pose2

# Letter 0 has three relations: 20 to the east, 30 to the north, 40 to the west.
STAR = np.array([(0, 0), (20, 0), (0, 30), (-40, 0)], float)
NU = math.radians(1.1)


def alphabet_of(corners: NDArray[np.float64]) -> Alphabet:
    return generate_alphabet(np.asarray(corners, float), 18.0, 1000.0)


def gamma_of(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.int64]:
    return compare_alphabets(alphabet_of(first), alphabet_of(second), 1.1, NU)


def gamma_by_loops(first: Alphabet, second: Alphabet, epsilon: float, nu: float) -> NDArray[np.int64]:
    """The words of section 2.1.4 as loops."""
    gamma = np.zeros((len(first.corners_px), len(second.corners_px)), np.int64)
    for i, z in product(*map(range, gamma.shape)):
        mine, theirs = np.flatnonzero(first.letter == i), np.flatnonzero(second.letter == z)
        for j, y in combinations(mine, 2):
            for k, q in product(theirs, repeat=2):
                if k == q:
                    continue
                if abs(first.distance_px[j] - second.distance_px[k]) > epsilon:
                    continue
                if abs(first.distance_px[y] - second.distance_px[q]) > epsilon:
                    continue
                a_ijy = first.bearing[y] - first.bearing[j]
                a_zkq = second.bearing[q] - second.bearing[k]
                if abs(math.remainder(a_ijy - a_zkq, math.tau)) <= nu:
                    gamma[i, z] += 1
    return gamma


def test_gamma_counted_by_hand() -> None:
    # Letter 0 with itself: {20, 30}, {20, 40}, {30, 40} each find themselves: 3.
    # Letter 1: distances 20, hypot(20, 30) = 36.1 and 60; letter 2: 30, 36.1 and 50; letter 3: 40, 60, 50.
    # Every letter finds its own three combinations and no other's:
    #   1 and 2 share only 36.1, 1 and 3 only 60, 2 and 3 only 50, 0 and any other one distance.
    assert gamma_of(STAR, STAR).tolist() == np.diag([3, 3, 3, 3]).tolist()


def test_one_moved_corner_takes_its_combinations_away() -> None:
    moved = STAR.copy()
    moved[3] = (-45, 0)  # 40 becomes 45: only {20, 30} is left to letter 0
    # Letters 1 and 2 keep {20, 36.1} and {30, 36.1}; letter 3 has no old distance left.
    assert gamma_of(STAR, moved).tolist() == np.diag([1, 1, 1, 0]).tolist()


def test_tolerances_belong_to_the_range() -> None:
    two = np.array([(0, 0), (20, 0), (0, 30)], float)
    longer = np.array([(0, 0), (21.1, 0), (0, 30)], float)
    assert gamma_of(two, longer)[0, 0] == 1
    too_long = np.array([(0, 0), (21.2, 0), (0, 30)], float)
    assert gamma_of(two, too_long)[0, 0] == 0
    for degrees, count in ((1.0, 1), (1.2, 0)):
        angle = math.radians(90 + degrees)
        bent = np.array([(0, 0), (20, 0), (30 * math.cos(angle), 30 * math.sin(angle))], float)
        assert gamma_of(two, bent)[0, 0] == count


def test_a_mirrored_map_does_not_match() -> None:
    lopsided = np.array([(0, 0), (20, 0), (12, 31), (-43, 9)], float)
    assert gamma_of(lopsided, lopsided)[0, 0] == 3
    assert gamma_of(lopsided, lopsided * (-1, 1)).sum() == 0


def test_one_relation_cannot_stand_for_two() -> None:
    # Two corners in nearly the same place, seen from the letter: both are like the other map's one.
    twins = np.array([(0, 0), (100, 0), (100, 1)], float)
    single = np.array([(0, 0), (100, 0), (500, 500)], float)
    assert gamma_of(twins, single)[0, 0] == 0
    assert gamma_of(single, twins)[0, 0] == 0
    # {100, 100'} with itself in two ways: straight and crossed (the crossed angle is 1.1 degrees off).
    assert (
        gamma_of(twins, twins)[0, 0] == gamma_by_loops(alphabet_of(twins), alphabet_of(twins), 1.1, NU)[0, 0]
    )


coordinates = st.integers(0, 60).map(float)
corner_lists = st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=7, unique=True).map(
    np.array
)


@given(corner_lists, corner_lists)
def test_gamma_is_what_the_loops_of_the_paper_count(
    first: NDArray[np.float64], second: NDArray[np.float64]
) -> None:
    # Wide tolerances on a small integer lattice: many equal, shared and wrapped values.
    one, two = generate_alphabet(first, 3.0, 50.0), generate_alphabet(second, 3.0, 50.0)
    epsilon, nu = 2.5, math.radians(20.0)
    np.testing.assert_array_equal(
        compare_alphabets(one, two, epsilon, nu), gamma_by_loops(one, two, epsilon + 1e-9, nu + 1e-9)
    )


@given(corner_lists, st.from_type(Pose2))
def test_gamma_does_not_change_when_a_map_moves(corners: NDArray[np.float64], T: Pose2) -> None:
    np.testing.assert_array_equal(gamma_of(corners, corners), gamma_of(corners, T.apply(corners)))


@given(corner_lists, corner_lists)
def test_swapping_the_maps_transposes_gamma(first: NDArray[np.float64], second: NDArray[np.float64]) -> None:
    np.testing.assert_array_equal(gamma_of(first, second), gamma_of(second, first).T)


def test_chunks_do_not_change_the_count(monkeypatch: pytest.MonkeyPatch) -> None:
    corners = np.random.default_rng(0).uniform(0, 300, (40, 2))
    whole = gamma_of(corners, corners[::-1])
    monkeypatch.setattr("mapmeld.matching.alphabet.comparison._CHUNK", 50)
    np.testing.assert_array_equal(gamma_of(corners, corners[::-1]), whole)
    assert whole.sum() > 0
