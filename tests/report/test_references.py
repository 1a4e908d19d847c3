import math

import numpy as np
import pytest
from drawing import drawn, office

from mapmeld.grid import OccupancyGrid
from mapmeld.report.canvas import Canvas
from mapmeld.report.palette import BLUE, RED
from mapmeld.report.references import references, with_references
from mapmeld.se2 import Pose2


def colour_at(canvas: Canvas, grid: OccupancyGrid, metres: tuple[float, float]) -> tuple[int, ...]:
    x, y = np.floor(canvas.place(grid.metres_to_lattice(metres))).astype(int)
    return tuple(int(v) for v in canvas.picture[y, x])


@pytest.mark.parametrize("yaw", [0.0, 0.7])
def test_arrows_start_at_the_starts_and_point_along_the_headings(yaw: float) -> None:
    grid = OccupancyGrid(office().cells, 0.05, Pose2(-3, 2, yaw))
    starts = [Pose2(0, 4, 0.5), Pose2(3, 5, -2.0)]
    canvas, far = with_references(grid, starts)
    assert far == []
    for start, colour in zip(starts, (BLUE, RED), strict=True):
        # 0.07 of 16 m is 1.1 m: half a metre ahead lies the shaft, half a metre behind nothing.
        ahead = start.apply((0.6, 0))
        behind = start.apply((-0.6, 0))
        assert colour_at(canvas, grid, (float(ahead[0]), float(ahead[1]))) == colour
        assert colour_at(canvas, grid, (float(behind[0]), float(behind[1]))) not in (BLUE, RED)


def test_the_picture_reaches_to_a_start_beside_the_map() -> None:
    grid = office()
    canvas, far = with_references(grid, [Pose2(-3, 6, math.pi)])
    assert far == []
    assert canvas.window.col < -60
    assert colour_at(canvas, grid, (-3.5, 6)) == BLUE


def test_starts_far_away_are_named_not_drawn() -> None:
    canvas, far = with_references(office(), [Pose2(), None, Pose2(1e6, 0, 0)])
    assert far == [2]
    assert max(canvas.picture.shape) <= 2000
    picture = references(office(), [Pose2(1e6, 0, 0)], ["a"], "Caption.")
    assert not (picture == BLUE).all(axis=2).any()


def test_nothing_known() -> None:
    canvas, far = with_references(drawn("   "), [Pose2()])
    assert far == []
    assert canvas.picture.size
