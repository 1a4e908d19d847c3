import numpy as np

from mapmeld.matching.alphabet import Candidate
from mapmeld.report.canvas import Canvas
from mapmeld.report.heatmap import with_gamma
from mapmeld.report.palette import BLUE, GREEN, heat_palette


def centre(canvas: Canvas, i: int, z: int) -> tuple[int, ...]:
    x, y = np.floor(canvas.place((z + 0.5, i + 0.5))).astype(int)
    return tuple(int(v) for v in canvas.picture[y, x])


def left_edge(canvas: Canvas, i: int, z: int) -> tuple[int, ...]:
    x, y = np.floor(canvas.place((z, i + 0.5))).astype(int)
    return tuple(int(v) for v in canvas.picture[y, x])


def test_more_votes_are_darker_and_none_is_white() -> None:
    gamma = np.array([[0, 1, 5], [10, 20, 1000]])
    canvas = with_gamma(gamma, [], None)
    assert centre(canvas, 0, 0) == (255, 255, 255)
    shades = [sum(centre(canvas, i, z)) for i, z in ((0, 0), (0, 1), (1, 2))]
    assert shades[0] > shades[1] > shades[2]
    assert centre(canvas, 1, 2) == tuple(int(v) for v in heat_palette()[255])


def test_candidates_are_framed_blue_and_the_winner_green() -> None:
    gamma = np.ones((4, 5), np.int64)
    winner = Candidate((3, 1), (0, 4), (1, 1))
    other = Candidate((1, 2), (2, 2), (1, 1))
    canvas = with_gamma(gamma, [winner, other], winner)
    assert left_edge(canvas, 3, 1) == GREEN
    assert left_edge(canvas, 0, 4) == GREEN
    assert left_edge(canvas, 1, 2) == BLUE
    assert left_edge(canvas, 2, 2) not in (BLUE, GREEN)


def test_votes_nowhere_and_very_many_corners() -> None:
    assert with_gamma(np.zeros((3, 2), np.int64), [], None).picture.size
    canvas = with_gamma(np.ones((300, 1), np.int64), [], None)
    assert 600 < max(canvas.picture.shape) < 1500


def test_the_palette_darkens_all_the_way() -> None:
    brightness = heat_palette().astype(int).sum(axis=1)
    assert (np.diff(brightness) <= 0).all()
    assert tuple(heat_palette()[0]) == (255, 255, 255)
