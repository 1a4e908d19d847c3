import math

import numpy as np
import pytest
from drawing import drawn, office, seen_from
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.evaluation import PoseErrors, Tolerance, accuracy, overlap_centroid, pose_errors
from mapmeld.grid import OccupancyGrid
from mapmeld.se2 import Pose2

points = st.tuples(st.floats(-50, 50), st.floats(-50, 50))


def test_errors_counted_by_hand() -> None:
    truth = Pose2(10, 0, 0)
    errors = pose_errors(Pose2(10.3, 0.4, 0), truth, (12.0, 5.0))
    assert errors.translation == pytest.approx(0.5)
    assert errors.rotation == 0


def test_a_turn_about_the_centroid_moves_nothing_there() -> None:
    # Turned by a quarter about (5, 0): the frame's origin goes to (5, -5), the centroid stays.
    errors = pose_errors(Pose2(5, -5, math.pi / 2), Pose2(), (5.0, 0.0))
    assert errors.translation == pytest.approx(0)
    assert errors.rotation == pytest.approx(math.pi / 2)


def test_rotation_errors_go_the_short_way_round() -> None:
    assert pose_errors(Pose2(0, 0, 3.1), Pose2(0, 0, -3.1), (0.0, 0.0)).rotation == pytest.approx(
        2 * math.pi - 6.2
    )


@given(st.from_type(Pose2), points)
def test_the_truth_has_no_error(truth: Pose2, centroid: tuple[float, float]) -> None:
    errors = pose_errors(truth, truth, centroid)
    assert errors.translation == pytest.approx(0, abs=1e-9)
    assert errors.rotation == 0


@given(st.from_type(Pose2), st.from_type(Pose2), st.from_type(Pose2), points)
def test_errors_do_not_depend_on_the_frames(
    guess: Pose2, truth: Pose2, motion: Pose2, centroid: tuple[float, float]
) -> None:
    plain = pose_errors(guess, truth, centroid)
    x, y = motion.apply(centroid)
    first_moved = pose_errors(motion @ guess, motion @ truth, (float(x), float(y)))
    second_moved = pose_errors(guess @ motion, truth @ motion, centroid)
    for other in (first_moved, second_moved):
        assert other.translation == pytest.approx(plain.translation, abs=1e-8)
        assert other.rotation == pytest.approx(plain.rotation, abs=1e-8)


def test_both_errors_must_be_within_the_tolerance() -> None:
    tolerance = Tolerance.of(0.5, 5)
    assert PoseErrors(0.5, math.radians(5)).within(tolerance)
    assert not PoseErrors(0.51, 0).within(tolerance)
    assert not PoseErrors(0, math.radians(5.1)).within(tolerance)
    assert not PoseErrors(math.nan, 0).within(tolerance)


@pytest.mark.parametrize(
    ("metres", "degrees"), [(0, 5), (-1, 5), (math.nan, 5), (1, 0), (1, 181), (1, math.inf)]
)
def test_impossible_tolerances_are_refused(metres: float, degrees: float) -> None:
    with pytest.raises(ValueError, match="a tolerance is"):
        Tolerance.of(metres, degrees)


def test_the_default_tolerance() -> None:
    assert str(Tolerance()) == "0.5 m and 5 degrees"


def test_the_centroid_is_the_mean_of_the_cells_known_in_both() -> None:
    a = drawn("....", origin=Pose2(100, 0, 0))
    b = drawn(".. .")
    # b's cells come to lie on a's columns 1, 2 and (beyond a's edge) 4: centres at 101.5 and 102.5.
    assert overlap_centroid(a, b, Pose2(101, 0, 0)) == pytest.approx((102.0, 0.5))


def test_maps_that_do_not_meet_have_no_centroid() -> None:
    assert overlap_centroid(drawn("."), drawn("."), Pose2(5, 0, 0)) is None


def test_accuracy_counted_by_hand() -> None:
    result = drawn(
        """
    ##.
    #.
    """.replace("    ", "")
    )
    truth = drawn(
        """
    #..
    # #
    """.replace("    ", "")
    )
    # Of the result's 5 cells: # as #, # as ., . as ., # as #, . where nothing is known.
    assert accuracy(result, truth, Pose2()) == pytest.approx(3 / 5)


def test_accuracy_counts_neither_unknown_cells_nor_doubtful_ones() -> None:
    result = OccupancyGrid(np.array([[100, -1, 50, 0]]), 1.0)
    truth = OccupancyGrid(np.array([[100, 0, 0, 50]]), 1.0)
    assert accuracy(result, truth, Pose2()) == pytest.approx(1 / 2)


def test_accuracy_takes_the_result_into_the_frame_of_the_truth() -> None:
    truth = office(0.1)
    T_new_old = Pose2(30, -4, 1.1)
    result = seen_from(truth, T_new_old)
    assert accuracy(result, truth, T_new_old.inverse()) > 0.98
    assert accuracy(result, truth, T_new_old) < 0.5


def test_a_result_without_cells_has_no_accuracy() -> None:
    with pytest.raises(ValueError, match="neither black nor white"):
        accuracy(drawn("  "), drawn(".."), Pose2())
