import math

import numpy as np
import pytest
from drawing import office, seen_from

from mapmeld import Pose2
from mapmeld.evaluation.parting import GAP_MOST, parted
from mapmeld.grid import UNKNOWN, OccupancyGrid, resample

A = office()
T_B_A = Pose2(3.0, -2.0, 0.7)
B = seen_from(A, T_B_A)
T_A_B = T_B_A.inverse()


def shared(a: OccupancyGrid, b: OccupancyGrid) -> int:
    return int(np.count_nonzero(a.known & (resample(b, T_A_B, a) > UNKNOWN)))


@pytest.mark.parametrize("seed", range(12))
def test_parts_share_a_strip_or_nothing(seed: int) -> None:
    a, b, width = parted(A, B, T_A_B, seed)
    assert width >= -GAP_MOST
    # Cells at the edge of the strip may lie on either side of it.
    if width > 0.2:
        assert shared(a, b) > 0
    if width < -0.2:
        assert shared(a, b) == 0
    assert shared(a, b) < shared(A, B)


@pytest.mark.parametrize("seed", range(6))
def test_parts_keep_their_cells_and_lose_the_others(seed: int) -> None:
    for whole, part in zip((A, B), parted(A, B, T_A_B, seed), strict=False):
        assert isinstance(part, OccupancyGrid)
        assert (part.origin, part.resolution, part.shape) == (whole.origin, whole.resolution, whole.shape)
        kept = part.known
        assert (part.cells[kept] == whole.cells[kept]).all()
        assert 0 < kept.sum() < whole.known.sum()


def test_parts_share_exactly_what_lies_between_the_lines() -> None:
    a, b, width = next(p for seed in range(40) if (p := parted(A, B, T_A_B, seed))[2] > 2)
    # Together the parts show everything, and the strip is as wide as it is said to be.
    both = a.known & (resample(b, T_A_B, a) > UNKNOWN)
    points = a.centres(both)
    points = points - points.mean(axis=0)
    directions = np.radians(np.arange(0, 180, 0.5))
    extents = [float(np.ptp(points @ [math.cos(t), math.sin(t)])) for t in directions]
    assert min(extents) == pytest.approx(width, abs=0.2)
    assert np.count_nonzero(a.known) + shared(B, B) >= np.count_nonzero(A.known)


def test_the_same_seed_gives_the_same_parts_and_another_gives_others() -> None:
    first, second, other = (parted(A, B, T_A_B, seed) for seed in (1, 1, 2))
    assert first[0] == second[0]
    assert first[1] == second[1]
    assert first[0] != other[0]


def test_two_fifths_of_the_seeds_share_nothing_or_more() -> None:
    widths = [parted(A, B, T_A_B, seed)[2] for seed in range(100)]
    assert 0.35 < np.mean(np.array(widths) <= 0) < 0.65
