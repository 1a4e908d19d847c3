import math
from importlib import import_module

import numpy as np
import pytest
from drawing import drawn, office

from mapmeld.grid import OccupancyGrid
from mapmeld.report.canvas import Canvas
from mapmeld.report.overlay import overlay
from mapmeld.report.palette import BLUE, ORANGE, RED
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
    for start, colour in zip(starts, (RED, BLUE), strict=True):
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
    assert colour_at(canvas, grid, (-3.5, 6)) == RED


def test_starts_far_away_are_named_not_drawn() -> None:
    canvas, far = with_references(office(), [Pose2(), None, Pose2(1e6, 0, 0)])
    assert far == [2]
    assert max(canvas.picture.shape) <= 2000
    picture = references(office(), [Pose2(1e6, 0, 0)], ["a"], "Caption.")
    assert not (picture == RED).all(axis=2).any()


def test_robots_have_the_colours_of_their_maps_in_an_overlay() -> None:
    starts = [None, None, Pose2(4, 4, 0)]
    alone = references(office(), starts, ["a", "b", "c"])
    laid_over = overlay([office()] * 3, [Pose2(), None, Pose2(30, 0, 0)], ["a", "b", "c"])
    for picture in (alone, laid_over):
        assert (picture == ORANGE).all(axis=2).any()
        assert not (picture == BLUE).all(axis=2).any()


def test_a_turned_lattice_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    captions: list[str] = []

    def note(panels: object, caption: str, *_: object) -> None:
        captions.append(caption)

    # By import_module, for the package's attribute of that name is the function.
    monkeypatch.setattr(import_module("mapmeld.report.references"), "compose", note)
    references(OccupancyGrid(office().cells, 0.05, Pose2(-3, 2, math.radians(10))), [], [], "Caption.")
    references(office(), [], [], "Caption.")
    assert "Caption. The picture lies along the cells, which are turned by 10.0 degrees" in captions[0]
    assert captions[1] == "Caption."


def test_nothing_known() -> None:
    canvas, far = with_references(drawn("   "), [Pose2()])
    assert far == []
    assert canvas.picture.size
