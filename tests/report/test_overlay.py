import math

import numpy as np
import pytest
from drawing import drawn, office, seen_from
from numpy.typing import NDArray

from mapmeld.grid import resample
from mapmeld.merging import merge_aligned
from mapmeld.report.overlay import overlay, overlay_labels
from mapmeld.report.palette import BLUE, GREEN, ORANGE, RED
from mapmeld.se2 import Pose2


def share(picture: NDArray[np.uint8], colour: tuple[int, int, int]) -> int:
    return int((picture == colour).all(axis=2).sum())


def test_red_blue_and_green_walls() -> None:
    a = drawn("#....  #..")
    b = drawn(" ...#   #.")
    # The walls at the right are a cell apart, so common; those at the left four.
    assert overlay_labels([a.cells, b.cells]).tolist() == [[2, 1, 1, 1, 3, 0, 0, 4, 4, 1]]


def test_a_third_map_has_its_own_colour_and_two_are_enough_for_common() -> None:
    layers = [drawn(row).cells for row in ("#.....#", "..#...#", "....#..")]
    assert overlay_labels(layers).tolist() == [[2, 1, 3, 1, 4, 1, 5]]


def test_floor_of_one_map_does_not_hide_a_wall_of_the_other() -> None:
    assert overlay_labels([drawn(".").cells, drawn("#").cells]).tolist() == [[3]]


def test_a_map_and_itself_rotated_share_all_walls() -> None:
    a = office()
    T_b_a = Pose2(2, 3, math.radians(33))
    b = seen_from(a, T_b_a)
    lattice = merge_aligned([a, b], [Pose2(), T_b_a.inverse()])
    labels = overlay_labels([resample(a, Pose2(), lattice), resample(b, T_b_a.inverse(), lattice)])
    assert np.count_nonzero(labels == 4) > 0.98 * np.count_nonzero(labels >= 2)


def test_the_picture_has_the_colours_of_figure_8() -> None:
    a, b = office(), office()
    apart = overlay([a, b], [Pose2(), Pose2(2.0, 1.0, 0.3)], ["a", "b"])
    alike = overlay([a, b], [Pose2(), Pose2()], ["a", "b"])
    assert share(apart, RED) > 1000
    assert share(apart, BLUE) > 1000
    assert share(alike, GREEN) > 5 * share(apart, GREEN)
    # Only the swatches of the legend are left of red.
    assert share(alike, RED) < 1000


def test_more_than_two_maps() -> None:
    grids = [office()] * 3
    picture = overlay(grids, [Pose2(), Pose2(30, 0, 0), Pose2(0, 30, 0)], ["1", "2", "3"])
    assert share(picture, ORANGE) > 1000


def test_the_first_map_must_be_the_reference() -> None:
    with pytest.raises(ValueError, match="identity"):
        overlay([office()], [Pose2(1, 0, 0)], ["a"])
