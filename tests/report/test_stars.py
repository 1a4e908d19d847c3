import math

import numpy as np
import pytest
from numpy.typing import NDArray

from mapmeld.matching.alphabet import Alphabet, AlphabetParameters, generate_alphabet
from mapmeld.report.canvas import paint
from mapmeld.report.palette import BLUE, FAINT, FLOOR_WHITE, RED
from mapmeld.report.stars import common_relations, with_star
from mapmeld.se2 import Pose2

CORNERS = np.array([[50.0, 50.0], [90.0, 50.0], [50.0, 75.0], [20.0, 30.0], [60.0, 85.0]])


def alphabet(corners: NDArray[np.float64]) -> Alphabet:
    return generate_alphabet(corners, 18.0, 1000.0)


def others(one: Alphabet, relations: list[int]) -> list[int]:
    return [int(one.other[r]) for r in relations]


@pytest.mark.parametrize("degrees", [0.0, 30.0, 179.0, -120.0])
def test_all_relations_of_a_turned_copy_agree(degrees: float) -> None:
    first = alphabet(CORNERS)
    second = alphabet(Pose2(5, 7, math.radians(-degrees)).apply(CORNERS))
    pairs = common_relations(first, second, (0, 0), math.radians(degrees), AlphabetParameters())
    assert sorted(others(first, [r for r, _ in pairs])) == [1, 2, 3, 4]
    assert others(first, [r for r, _ in pairs]) == others(second, [q for _, q in pairs])


def test_a_wrong_turn_agrees_with_nothing() -> None:
    first = alphabet(CORNERS)
    assert common_relations(first, first, (0, 0), math.radians(20), AlphabetParameters()) == []


def test_no_relation_is_used_twice() -> None:
    first = alphabet(CORNERS)
    # Corner 5 of the second map looks nearly like corner 1 from corner 0.
    second = alphabet(np.vstack([CORNERS, [[90.5, 50.2]]]))
    pairs = common_relations(first, second, (0, 0), 0.0, AlphabetParameters())
    assert len(pairs) == 4
    assert len({q for _, q in pairs}) == 4
    assert 5 not in others(second, [q for _, q in pairs])


def test_a_letter_without_relations() -> None:
    lonely = generate_alphabet(CORNERS, 500.0, 1000.0)
    assert common_relations(lonely, alphabet(CORNERS), (0, 0), 0.0, AlphabetParameters()) == []


def test_the_star_is_drawn_with_its_common_relations_in_colour() -> None:
    letters = alphabet(CORNERS)
    relations = np.flatnonzero(letters.letter == 0)
    canvas = paint(np.zeros((100, 100), np.uint8), [FLOOR_WHITE], px_per_cell=8.0)
    star = with_star(canvas, letters, 0, [int(relations[1]), int(relations[0])])

    def seen(position: tuple[float, float]) -> tuple[int, ...]:
        x, y = np.floor(star.place(position)).astype(int)
        return tuple(int(v) for v in star.picture[y, x])

    assert seen((50, 62)) == RED  # to corner 2, named first
    assert seen((65, 50)) == BLUE  # to corner 1
    third = star.place((35, 40)).astype(int)
    around = star.picture[third[1] - 2 : third[1] + 3, third[0] - 2 : third[0] + 3]
    assert min(FAINT) <= around.min() < 240  # thin and faint, so mixed with the white around it
