import numpy as np
from drawing import drawn, office
from numpy.typing import NDArray

from mapmeld.changes import Region, diff
from mapmeld.grid import OccupancyGrid
from mapmeld.report.changes import NUMBERED, change_labels, changes
from mapmeld.report.palette import BLUE, RED
from mapmeld.se2 import Pose2


def share(picture: NDArray[np.uint8], colour: tuple[int, int, int]) -> int:
    return int((picture == colour).all(axis=2).sum())


def test_what_each_cell_shows() -> None:
    old = drawn(".......##....#.. .##  \n" * 2, 0.2)
    new = drawn(".##....##.......  . .#\n" * 2, 0.2)
    labels = change_labels(diff(old, new, T_old_new=Pose2(), max_bend=0))
    #                           appeared     wall       vanished     unknown  vanished, unseen, explored
    expected = [5, 10, 10, 5, 2, 2, 2, 8, 8, 2, 2, 2, 4, 9, 4, 2, 0, 4, 9, 6, 3, 7]
    assert labels.tolist() == [expected, expected]


def test_red_and_blue_on_the_floor() -> None:
    cells = office().cells.copy()
    cells[180:192, 20:44] = 100
    later = OccupancyGrid(cells, 0.05)
    came = changes(diff(office(), later, T_old_new=Pose2()))
    went = changes(diff(later, office(), T_old_new=Pose2()))
    # The legend has a patch of each.
    assert share(came, RED) - share(went, RED) > 10 * share(came, BLUE)
    assert share(went, BLUE) - share(came, BLUE) > 10 * share(went, RED)


def test_many_changes_and_none() -> None:
    cells = office().cells.copy()
    for k in range(30):
        cells[160:164, 8 + 20 * (k % 12) + 4 * (k // 12) : 12 + 20 * (k % 12) + 4 * (k // 12)] = 100
        cells[200:203, 5 + 12 * (k % 14) : 8 + 12 * (k % 14)] = 100
    found = diff(office(), OccupancyGrid(cells, 0.05), T_old_new=Pose2())
    assert len(found.regions) > NUMBERED
    assert all(isinstance(region, Region) for region in found.regions)
    assert changes(found, "many").shape[2] == 3
    nothing = OccupancyGrid(np.full((3, 4), -1, np.int8), 0.1)
    assert changes(diff(nothing, nothing, T_old_new=Pose2())).shape[2] == 3
