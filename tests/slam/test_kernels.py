"""The inner loops against plain ones on dense arrays."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mapmeld.slam.kernels import FULLNESS, PATCH, Floats, Sensor, climb, evaluate
from mapmeld.slam.shared_maps import SharedMaps

NOWHERE = np.zeros(2)
SENSOR = Sensor(1, 0.5, 2.0, -7.0)


def one_map() -> SharedMaps:
    """One map with cells of 1 m, whose tables reach from (-64, -64) to (64, 64)."""
    return SharedMaps(1, 1.0, (-PATCH, -PATCH), (PATCH, PATCH))


def entered(maps: SharedMaps, start: tuple[float, float], end: tuple[float, float], hit: bool = True) -> None:
    pose = np.array([*start, 0.0])
    maps.enter(0, pose, NOWHERE, np.array([[end[0] - start[0], end[1] - start[1]]]), np.array([hit]))


def picture(maps: SharedMaps) -> str:
    """Known cells: ``#`` wall, ``.`` visited, space unknown; the top line is the top row."""
    hits, visits, _ = maps.counts(0)
    rows, cols = np.nonzero(visits)
    part = np.s_[rows.min() : rows.max() + 1, cols.min() : cols.max() + 1]
    signs = np.where(hits[part] > 0, "#", np.where(visits[part] > 0, ".", " "))
    return "\n".join("".join(row) for row in signs[::-1])


# ---------------------------------------------------------------- rays
@pytest.mark.parametrize(
    ("end", "drawn"),
    [
        ((4.5, 0.5), "....#"),
        ((-3.5, 0.5), "#...."),
        ((0.5, 2.5), "#\n.\n."),
        ((3.5, 3.5), "   #\n  . \n .  \n.   "),
        ((5.5, 2.5), "    .#\n  ..  \n..    "),
    ],
)
def test_a_ray_visits_the_cells_on_its_way_and_hits_the_last(end: tuple[float, float], drawn: str) -> None:
    maps = one_map()
    entered(maps, (0.5, 0.5), end)
    assert picture(maps) == drawn


def test_a_ray_that_meets_nothing_leaves_its_last_cell_alone() -> None:
    maps = one_map()
    entered(maps, (0.5, 0.5), (4.5, 0.5), hit=False)
    assert picture(maps) == "...."


# In quarters of a cell, which floating point adds up without rounding.
@given(st.tuples(*[st.integers(-100, 100).map(lambda n: n / 4)] * 4))
def test_a_ray_is_unbroken_and_close_to_the_line(ends: tuple[float, float, float, float]) -> None:
    x0, y0, x1, y1 = ends
    maps = one_map()
    entered(maps, (x0, y0), (x1, y1))
    hits, visits, (col, row) = maps.counts(0)
    rows, cols = np.nonzero(visits)
    rows, cols = rows + row, cols + col
    long = max(abs(math.floor(x1) - math.floor(x0)), abs(math.floor(y1) - math.floor(y0)))
    assert len(rows) == long + 1  # one per row or column, whichever are more
    assert visits.max() == 1
    assert hits.sum() == 1
    assert hits[math.floor(y1) - row, math.floor(x1) - col] == 1
    # Bresenham's line joins the centres of the cells, half a cell from it at most.
    c0, r0 = math.floor(x0), math.floor(y0)
    dx, dy = math.floor(x1) - c0, math.floor(y1) - r0
    if long:
        off = np.abs((cols - c0) * dy - (rows - r0) * dx) / long
        assert off.max() <= 0.5 + 1e-9


def test_a_cell_keeps_the_mean_of_what_ended_in_it() -> None:
    maps = one_map()
    for x, y in [(3.2, 0.1), (3.6, 0.5), (3.4, 0.9)]:
        entered(maps, (0.5, 0.5), (x, y))
    entered(maps, (0.5, 0.5), (6.5, 0.5))
    hits, visits, (col, row) = maps.counts(0)
    assert hits[-row, 3 - col] == 3
    assert visits[-row, 3 - col] == 4
    table = maps.tables[0]
    corner = maps.corner
    patch = table[-corner[1] // PATCH, (3 - corner[0]) // PATCH]
    mean = maps.cells[patch, 3, :2]
    np.testing.assert_allclose(mean, (0.4, 0.5), atol=1e-6)


def test_a_cell_stays_wall_until_fewer_than_a_tenth_end_in_it() -> None:
    maps = one_map()
    entered(maps, (0.5, 0.5), (3.5, 0.5))
    for passing in range(1, 15):
        entered(maps, (0.5, 0.5), (6.5, 0.5), hit=False)
        maps_patch = maps.tables[0][-maps.corner[1] // PATCH, -maps.corner[0] // PATCH]
        assert (maps.walls[maps_patch, 0] >> 3) & 1 == (1 / (1 + passing) > FULLNESS)


# ---------------------------------------------------------------- the score
def dense(maps: SharedMaps) -> dict[tuple[int, int], tuple[float, float]]:
    """Mean points of the wall cells by (row, col) in the tables' lattice, plainly."""
    found = {}
    for a, line in enumerate(maps.tables[0]):
        for b, patch in enumerate(line):
            for at, (x, y, hits, visits) in enumerate(maps.cells[patch].tolist()):
                if hits > FULLNESS * visits:
                    row, col = a * PATCH + at // PATCH, b * PATCH + at % PATCH
                    found[row, col] = (col + x, row + y)
    return found


def plain_score(
    walls: dict[tuple[int, int], tuple[float, float]], pose: Floats, ends: Floats, sensor: Sensor
) -> tuple[float, float]:
    score = likelihood = 0.0
    c, s = math.cos(pose[2]), math.sin(pose[2])
    reach = range(-sensor.kernel, sensor.kernel + 1)
    for x, y in ends:
        end = pose[0] + c * x - s * y, pose[1] + s * x + c * y
        row, col = math.floor(end[1]), math.floor(end[0])
        near = [walls[row + i, col + j] for i in reach for j in reach if (row + i, col + j) in walls]
        if near:
            squared = min((end[0] - px) ** 2 + (end[1] - py) ** 2 for px, py in near)
            score += math.exp(-sensor.score_gain * squared)
            likelihood -= sensor.likelihood_gain * squared
        else:
            likelihood += sensor.missed
    return score, likelihood


@settings(max_examples=25)
@given(st.integers(0, 10_000), st.integers(0, 3), st.floats(-3, 3))
def test_the_score_is_that_of_the_nearest_walls(seed: int, kernel: int, theta: float) -> None:
    rng = np.random.default_rng(seed)
    maps = one_map()
    # About the corner of four patches, so that windows reach over it; and far out, where there is nothing.
    for x, y in rng.normal(0, 6, (60, 2)):
        entered(maps, (0.5, 0.5), (float(x), float(y)))
    ends = np.vstack([rng.normal(0, 7, (80, 2)), [[500.0, 0.0], [0.0, -500.0], [63.0, 63.0]]])
    pose = maps.lattice(np.array([[*rng.normal(0, 1, 2), theta]]))[0]
    sensor = Sensor(kernel, 0.5, 2.0, -7.0)
    x, y, turn = pose.tolist()
    found = evaluate(maps.cells, maps.walls, maps.tables[0], x, y, turn, ends, sensor, -1.0)
    assert found == pytest.approx(plain_score(dense(maps), pose, ends, sensor), rel=1e-5)


def test_giving_up_never_hides_a_better_score() -> None:
    rng = np.random.default_rng(1)
    maps = one_map()
    for x, y in rng.normal(0, 6, (60, 2)):
        entered(maps, (0.5, 0.5), (float(x), float(y)))
    ends = rng.normal(0, 6, (50, 2))
    gave_up = 0
    for x, y in rng.normal(0, 2, (50, 2)):
        px, py, _ = maps.lattice(np.array([[x, y, 0.0]]))[0].tolist()
        arguments = (maps.cells, maps.walls, maps.tables[0], px, py, 0.0, ends, SENSOR)
        true, _ = evaluate(*arguments, -1.0)
        for enough in (true - 0.1, true, true + 0.1, true + 10):
            found, _ = evaluate(*arguments, enough)
            assert (found > enough) == (true > enough)
            gave_up += found != true
    assert gave_up


# ---------------------------------------------------------------- climbing
def corner_scan() -> tuple[SharedMaps, Floats]:
    """A map of a corner of a room in cells of 5 cm, and a scan of it from the origin [cells]."""
    maps = SharedMaps(2, 0.05, (-3.0, -3.0), (3.0, 3.0))
    angles = np.linspace(-0.9, 2.4, 300)
    with np.errstate(divide="ignore"):
        distance = np.minimum(
            np.where(np.cos(angles) > 0, 2.02 / np.cos(angles), np.inf),
            np.where(np.sin(angles) > 0, 1.53 / np.sin(angles), np.inf),
        )
    ends = (distance[:, None] * np.column_stack([np.cos(angles), np.sin(angles)]) / 0.05)[distance < 3]
    for number in range(2):
        maps.enter(number, np.zeros(3), NOWHERE, ends, np.ones(len(ends), np.bool_))
    return maps, ends


def climbed(guesses: NDArray[np.float64], halvings: int = 5) -> tuple[Floats, Floats]:
    maps, ends = corner_scan()
    sensor = Sensor(1, 0.05**2 / (2 * 0.05**2), 0.05**2 / 0.075, -0.5 / 0.075)
    poses = maps.lattice(guesses)
    scores, _ = climb(maps.cells, maps.walls, maps.tables, poses, ends, sensor, 1.0, 0.05, halvings)
    return maps.metres(poses), scores


def test_climbing_finds_back_to_where_the_scan_was_taken() -> None:
    found, scores = climbed(np.array([[0.04, -0.05, 0.03], [-0.06, 0.03, -0.04]]))
    np.testing.assert_allclose(found[:, :2], 0.0, atol=0.01)
    np.testing.assert_allclose(found[:, 2], 0.0, atol=0.005)
    _, at_truth = climbed(np.zeros((2, 3)))
    assert (scores > 0.99 * at_truth).all()


def test_climbing_never_makes_it_worse() -> None:
    maps, ends = corner_scan()
    guesses = np.array([[0.3, 0.2, 0.4], [0.0, 0.0, 0.0]])
    before = [
        evaluate(maps.cells, maps.walls, maps.tables[0], x, y, theta, ends, Sensor(1, 0.5, 0.03, -6.0), -1.0)[
            0
        ]
        for x, y, theta in maps.lattice(guesses).tolist()
    ]
    _, after = climbed(guesses)
    assert (after >= before).all()
