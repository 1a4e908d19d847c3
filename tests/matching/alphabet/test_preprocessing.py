import numpy as np
from drawing import drawn, office

from mapmeld.grid import OccupancyGrid
from mapmeld.matching.alphabet import binarise, blur_clutter, preprocess, thicken_walls, thin_walls
from mapmeld.matching.alphabet.preprocessing import Image


def picture(image: Image) -> str:
    return "\n".join("".join("#" if v == 0 else "." for v in row) for row in image[::-1])


def test_unknown_becomes_white() -> None:
    assert picture(binarise(drawn("#. \n .#"))) == "#..\n..#"


def test_binarised_maps_have_two_greys() -> None:
    cells = np.array([[-1, 0, 30, 64, 65, 100]], np.int8)
    assert binarise(OccupancyGrid(cells, 1.0)).tolist() == [[255, 255, 255, 255, 0, 0]]


def test_two_erosions_and_two_dilations_close_a_gap_and_keep_the_thickness() -> None:
    wall = drawn("\n".join([".........."] * 4 + ["###....###"] + [".........."] * 4))
    image = binarise(wall)
    assert picture(thicken_walls(image, 2)).split("\n")[4] == "##########"
    closed = thin_walls(thicken_walls(image, 2), 2)
    assert picture(closed).split("\n")[4] == "##########"
    assert np.count_nonzero(closed == 0) == 10


def test_a_wider_gap_stays_open() -> None:
    wall = drawn("\n".join(["............"] * 4 + ["###......###"] + ["............"] * 4))
    assert picture(thin_walls(thicken_walls(binarise(wall), 2), 2)).split("\n")[4] == "###......###"


def test_the_median_removes_specks() -> None:
    speck = drawn("\n".join(["......"] * 3 + ["..#..."] + ["......"] * 3))
    assert "#" in picture(binarise(speck))
    assert "#" not in picture(blur_clutter(binarise(speck), 3))


def test_walls_of_a_clean_plan_survive() -> None:
    grid = office()
    kept = preprocess(grid) == 0
    assert np.count_nonzero(kept & grid.occupied) > 0.98 * np.count_nonzero(grid.occupied)
    assert np.count_nonzero(kept & ~grid.occupied) < 0.02 * np.count_nonzero(grid.occupied)


def test_an_empty_map_gives_an_empty_picture() -> None:
    assert preprocess(OccupancyGrid(np.zeros((0, 0), np.int8), 1.0)).shape == (0, 0)
