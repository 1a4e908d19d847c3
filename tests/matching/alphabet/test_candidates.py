import numpy as np
import pytest

from mapmeld.matching.alphabet import Candidate, generate_alphabet, select_candidates
from mapmeld.se2 import Pose2

# Both maps: corners on a line at 0, 20, 50.
LINE = generate_alphabet(np.array([(0, 0), (20, 0), (50, 0)], float), 18.0, 100.0)

MOTIONS = [Pose2(*v) for v in np.random.default_rng(0).uniform((-9, -9, -3), (9, 9, 3), (50, 3))]


def test_first_points_come_by_votes_and_positions_do_not_recur() -> None:
    gamma = np.array([[9, 1, 0], [0, 8, 0], [0, 0, 7]])
    candidates = select_candidates(gamma, LINE, LINE, 10, 1.1)
    assert [c.first for c in candidates] == [(0, 0), (1, 1), (2, 2)]
    # (0, 1) has a vote but no partner: 0-j and 1-k are never equally long where gamma has votes.
    assert [c.second for c in candidates] == [(1, 1), (0, 0), (0, 0)]
    assert [c.votes for c in candidates] == [(9, 8), (8, 9), (7, 9)]


def test_the_second_point_has_a_similar_distance() -> None:
    gamma = np.array([[9, 0, 0], [0, 0, 8], [0, 0, 1]])
    # (1, 2) has more votes than (2, 2), but 0-1 is 20 and 0-2 is 50.
    assert select_candidates(gamma, LINE, LINE, 1, 1.1)[0].second == (2, 2)


@pytest.mark.parametrize(("distance", "similar"), [(21.1, True), (18.9, True), (21.2, False), (18.8, False)])
def test_distances_are_similar_up_to_the_tolerance(distance: float, similar: bool) -> None:
    gamma = np.array([[9, 0], [0, 8]])
    one = generate_alphabet(np.array([(0, 0), (20, 0)], float), 18.0, 100.0)
    other = generate_alphabet(np.array([(0, 0), (distance, 0)], float), 18.0, 100.0)
    expected = (Candidate((0, 0), (1, 1), (9, 8)), Candidate((1, 1), (0, 0), (8, 9))) if similar else ()
    assert select_candidates(gamma, one, other, 10, 1.1) == expected
    # The tolerance itself still counts when rounding makes it a little more.
    for T in MOTIONS:
        moved = generate_alphabet(T.apply(other.corners_px), 18.0, 100.0)
        assert select_candidates(gamma, one, moved, 10, 1.1) == expected


def test_no_more_candidates_than_asked_for() -> None:
    gamma = np.ones((3, 3), int)
    assert len(select_candidates(gamma, LINE, LINE, 2, 1.1)) == 2


def test_without_votes_there_are_no_candidates() -> None:
    assert select_candidates(np.zeros((3, 3), int), LINE, LINE, 10, 1.1) == ()
    nothing = generate_alphabet(np.empty((0, 2)), 18.0, 100.0)
    assert select_candidates(np.zeros((0, 3), int), nothing, LINE, 10, 1.1) == ()
