import math

import numpy as np
import pytest
from drawing import drawn

from mapmeld.matching.alphabet import (
    Candidate,
    align,
    best_matching_points,
    binarise,
    black_pixels,
    jaccard_similarity,
)
from mapmeld.se2 import Pose2

CORNERS = np.array([(3, 2), (23, 2), (3, 32)], float)


def test_alignment_lays_the_matching_points_on_one_another() -> None:
    T = Pose2(7, -4, 2.0)
    T_1_2 = align(Candidate((0, 0), (2, 2), (1, 1)), T.apply(CORNERS), CORNERS)
    np.testing.assert_allclose(T_1_2.apply(CORNERS), T.apply(CORNERS), atol=1e-9)


def test_similarity_is_intersection_over_union_of_black() -> None:
    one, two = binarise(drawn("##..\n##..")), binarise(drawn(".##.\n...."))
    # 4 black in one, 2 in the other, 1 in both.
    assert jaccard_similarity(one, black_pixels(two), Pose2()) == pytest.approx(1 / 5)
    assert jaccard_similarity(one, black_pixels(two), Pose2(-1, 0)) == pytest.approx(2 / 4)
    assert jaccard_similarity(one, black_pixels(one), Pose2()) == 1.0


def test_what_falls_outside_belongs_to_the_union() -> None:
    one, two = binarise(drawn("##")), binarise(drawn("####"))
    assert jaccard_similarity(one, black_pixels(two), Pose2()) == pytest.approx(2 / 4)


def test_a_quarter_turn_counts_every_pixel() -> None:
    one, two = binarise(drawn("###\n..#")), binarise(drawn("##\n.#\n.#"))
    # (x, y) -> (3 - y, x): the upper bar and the cell below its left end; one has its cell on the right.
    T_1_2 = Pose2(3, 0, math.pi / 2)
    assert jaccard_similarity(one, black_pixels(two), T_1_2) == pytest.approx(3 / 5)


def test_maps_without_black_are_not_similar() -> None:
    blank = binarise(drawn(".."))
    assert jaccard_similarity(blank, black_pixels(blank), Pose2()) == 0.0


def test_the_best_fitting_comes_first_and_each_only_once() -> None:
    image = np.full((60, 60), 255, np.uint8)
    image[10:12, 5:50] = image[10:40, 5:7] = 0
    corners = np.array([(5, 10), (50, 10), (5, 40)], float)
    right = Candidate((0, 0), (1, 1), (5, 5))
    wrong = Candidate((0, 1), (1, 0), (9, 9))
    again = Candidate((1, 1), (0, 0), (5, 5))
    fittings = best_matching_points([wrong, right, again], image, image, corners, corners)
    assert [f.candidate for f in fittings] == [right, wrong]
    assert fittings[0].similarity == 1.0 > fittings[1].similarity
