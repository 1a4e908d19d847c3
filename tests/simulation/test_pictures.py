import numpy as np
from small import two_rooms

from mapmeld.report.palette import BLUE, GREEN, INK, RED
from mapmeld.se2 import Pose2
from mapmeld.simulation import Box, Environment, Furniture, Kind
from mapmeld.simulation.pictures import Drive, drive_picture, environment_picture


def test_a_floor_plan_shows_walls_doors_and_furniture() -> None:
    cabinet = Furniture(Kind.CABINET, Box(2.0, 1.0, 1.0, 0.5))
    bare = environment_picture(two_rooms())
    full = environment_picture(Environment(two_rooms().fields, (cabinet,)))
    assert bare.shape[1] == full.shape[1]
    assert (bare == INK).all(axis=2).sum() > 5000
    changed = (bare[:500] != full[:500]).any(axis=2)
    # 1.0 x 0.5 m at 111 px a metre.
    assert 0.9 < changed.sum() / (111 * 55) < 1.1


def test_walls_are_where_they_belong_with_y_up() -> None:
    picture = environment_picture(two_rooms())
    margin, px = 16, 111

    def at(x: float, y: float) -> list[int]:
        return [int(c) for c in picture[margin + round((5 - y) * px) + 1, margin + round(x * px) + 1]]

    assert at(4.5, 1.0) == list(INK)
    assert at(4.5, 2.5) != list(INK)  # the door
    assert at(2.0, 2.0) == [255, 255, 255]
    assert at(0.2, 0.2) == [205, 205, 205]


def test_ways_are_drawn_from_the_true_start() -> None:
    true = [Pose2(1.5 + 0.1 * i, 2.5) for i in range(50)]
    believed = [Pose2(0.1 * i, 0.01 * i) for i in range(50)]
    picture = drive_picture(two_rooms(), [Drive(true, believed), Drive([], [])], "a drive")
    for colour in (RED, BLUE, GREEN):
        assert (picture == colour).all(axis=2).sum() > 50
    rows = np.nonzero((picture == RED).all(axis=2)[:550])[0]
    assert abs(np.median(rows) - (16 + 2.5 * 111)) < 4
