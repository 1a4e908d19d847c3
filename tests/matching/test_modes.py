import math

import pytest
from drawing import drawn

from mapmeld.matching import Alternative
from mapmeld.matching.modes import distinct_modes
from mapmeld.se2 import Pose2

B = drawn("....\n....")  # its middle is at (2, 1)


def turned_about(x: float, y: float, degrees: float) -> Pose2:
    return Pose2(x, y) @ Pose2(0, 0, math.radians(degrees)) @ Pose2(-x, -y)


def modes(*others: Pose2, best: Pose2 | None = None) -> list[Pose2]:
    alternatives = (Alternative(T, 0.5 - 0.01 * i) for i, T in enumerate(others))
    return [mode.T_a_b for mode in distinct_modes(best or Pose2(), alternatives, B)]


@pytest.mark.parametrize(
    ("other", "another"),
    [
        (Pose2(0.49, 0), False),
        (Pose2(0, -0.49), False),
        (Pose2(0.51, 0), True),
        (Pose2(0.36, -0.36), True),
        (turned_about(2, 1, 4.9), False),
        (turned_about(2, 1, -4.9), False),
        (turned_about(2, 1, 5.1), True),
        (turned_about(2, 1, 180), True),
    ],
)
def test_half_a_metre_or_five_degrees_make_another_mode(other: Pose2, another: bool) -> None:
    assert modes(other) == ([other] if another else [])


def test_distance_is_that_of_the_middle_of_map_b() -> None:
    far = drawn("....\n....", origin=Pose2(1000, 500, math.pi / 2))
    middle = 1000 - 1, 500 + 2  # the lattice is turned: its columns go up
    about_middle = turned_about(*middle, 4)
    assert math.hypot(about_middle.x, about_middle.y) > 50
    assert distinct_modes(Pose2(), [Alternative(about_middle, 0.5)], far) == ()
    # The same turn about the zero of the frame moves the map by tens of metres.
    about_zero = Alternative(turned_about(0, 0, 4), 0.5)
    assert distinct_modes(Pose2(), [about_zero], far) == (about_zero,)
    # Long maps turn about their middle, not about a corner, and columns are not rows.
    long = drawn("." * 400)
    assert distinct_modes(Pose2(), [Alternative(turned_about(200, 0.5, 4), 0.5)], long) == ()
    assert len(distinct_modes(Pose2(), [Alternative(turned_about(0.5, 200, 4), 0.5)], long)) == 1


def test_directions_close_at_half_a_turn() -> None:
    assert modes(turned_about(2, 1, -178), best=turned_about(2, 1, 179)) == []


def test_neither_the_best_nor_an_earlier_one_is_repeated() -> None:
    assert modes(Pose2(3), Pose2(0.1), Pose2(3.3), Pose2(6), Pose2(3, 0.2)) == [Pose2(3), Pose2(6)]
    # 0.4 repeats the best and is gone, so 0.8 repeats nobody.
    assert modes(Pose2(0.4), Pose2(0.8)) == [Pose2(0.8)]
    assert modes() == []


def test_alternatives_keep_their_order_and_all_that_is_known_of_them() -> None:
    given = [Alternative(Pose2(6), 0.2, 0.9), Alternative(Pose2(3), 0.4, 0.1)]
    assert distinct_modes(Pose2(), given, B) == tuple(given)
