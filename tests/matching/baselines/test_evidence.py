import math

import numpy as np
import pytest
from drawing import drawn, office
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.matching.baselines.evidence import Evidence
from mapmeld.se2 import Pose2

ONE = drawn("##..\n##. ")
TWO = drawn(".#..\n.# .")


def test_both_maps_are_taken_at_the_coarser_resolution() -> None:
    evidence = Evidence.of(office(0.05), office(0.1))
    assert [m.resolution for m in evidence.maps] == [0.1, 0.1]


def test_the_acceptance_index_counts_where_both_are_known() -> None:
    # Four cells of the top row and two of the bottom row; in each the first is wall on floor.
    assert Evidence.of(ONE, TWO).acceptance_index(Pose2()) == pytest.approx(4 / 6)


def test_the_similarity_is_of_the_walls() -> None:
    assert Evidence.of(ONE, TWO).similarity(Pose2()) == pytest.approx(2 / 4)
    assert Evidence.of(ONE, TWO).similarity(Pose2(-1, 0)) == pytest.approx(2 / 4)
    assert Evidence.of(ONE, TWO).similarity(Pose2(2, 0)) == 0.0


def test_maps_that_do_not_meet_have_no_agreement() -> None:
    evidence = Evidence.of(ONE, TWO)
    assert evidence.acceptance_index(Pose2(100, 0)) == 0.0
    assert evidence.overlap(Pose2(100, 0)) == 0.0


def test_the_overlap_is_the_grids() -> None:
    assert Evidence.of(ONE, ONE).overlap(Pose2()) == 1.0
    assert Evidence.of(ONE, ONE).overlap(Pose2(2, 0)) == pytest.approx(3 / 7)


def test_cells_between_wall_and_floor_say_nothing() -> None:
    cells = np.array([[0, 100, 50]], np.int8)
    half = Evidence.of(type(ONE)(cells, 1.0), drawn(".##"))
    assert half.acceptance_index(Pose2()) == 1.0


@given(st.from_type(Pose2), st.from_type(Pose2))
def test_lattice_and_metres_agree(origin_1: Pose2, origin_2: Pose2) -> None:
    a, b = drawn("#.\n.#", 0.1, origin_1), drawn("#.\n.#", 0.1, origin_2)
    T_1_2_px = Pose2(3, -5, math.pi / 3)
    T_a_b = Evidence.of(a, b).in_metres(T_1_2_px)
    point_px = np.array((1.5, 0.5))
    np.testing.assert_allclose(
        a.metres_to_lattice(T_a_b.apply(b.lattice_to_metres(point_px))), T_1_2_px.apply(point_px), atol=1e-6
    )
