"""What every baseline says of the transforms that it finds: the walls and the floor under them.

The baselines find transforms in their own ways; this page judges them all alike, so that the figures
of a `MatchResult` mean the same whichever method wrote them. Transforms here go between the
lattices of two maps of the same resolution [px].
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmeld.grid import FREE_UP_TO, OCCUPIED_FROM, OccupancyGrid, at_resolution, overlap_share
from mapmeld.matching.drawn_walls import Image, binarise, black_pixels, jaccard_similarity
from mapmeld.matching.lattices import in_metres, in_pixels
from mapmeld.matching.result import MatchResult, Verdict
from mapmeld.se2 import Pose2

Points = NDArray[np.float64]

# Cells of map 2 asked for the acceptance index: the share needs no more, large maps would have millions.
_MOST_CELLS = 60_000
# Standard deviation of the obstacles [m] in the direction in which they spread the least: one wall alone
# fits on every other, with the best marks.
_LEAST_SPREAD = 0.2


@dataclass(frozen=True, slots=True)
class Evidence:
    """Two maps at the same resolution, ready to be compared under many transforms.

    Attributes
    ----------
    maps
        Both maps at the resolution of the coarser.
    walls_1
        Obstacles of map 1, black on white.
    walls_1_px, walls_2_px
        (n, 2) centres of the obstacles of the maps (col, row) [px].
    cells_2_px
        (m, 2) cells (col, row) [px] of map 2 that are obstacle or floor, a regular sample.
    is_wall_2
        (m,) which of them are obstacles.
    """

    maps: tuple[OccupancyGrid, OccupancyGrid]
    walls_1: Image
    walls_1_px: Points
    walls_2_px: Points
    cells_2_px: Points
    is_wall_2: NDArray[np.bool_]

    @classmethod
    def of(cls, a: OccupancyGrid, b: OccupancyGrid) -> Evidence:
        """Bring both maps to the coarser resolution: the finer map's detail has no partner."""
        coarser = max(a.resolution, b.resolution)
        map_1, map_2 = at_resolution(a, coarser), at_resolution(b, coarser)
        walls_1, walls_2 = binarise(map_1), binarise(map_2)
        wall = map_2.occupied
        rows, cols = np.nonzero(wall | map_2.free)
        # Every so many of what is known, not of all cells: unknown border then changes nothing.
        step = max(1, math.ceil(len(rows) / _MOST_CELLS))
        rows, cols = rows[::step], cols[::step]
        return cls(
            maps=(map_1, map_2),
            walls_1=walls_1,
            walls_1_px=black_pixels(walls_1),
            walls_2_px=black_pixels(walls_2),
            cells_2_px=np.stack([cols, rows], axis=-1).astype(np.float64) + 0.5,
            is_wall_2=wall[rows, cols],
        )

    def nothing_to_match_on(self) -> str | None:
        """Return the reason if a map has no obstacles, or no more than one straight wall."""
        for name, walls_px in zip("ab", (self.walls_1_px, self.walls_2_px), strict=True):
            if not len(walls_px):
                return f"nothing to match on: map {name} has no obstacle"
            off_px = walls_px - walls_px.mean(axis=0)
            narrowest_px = math.sqrt(max(0.0, float(np.linalg.eigvalsh(off_px.T @ off_px / len(off_px))[0])))
            if narrowest_px * self.maps[0].resolution < _LEAST_SPREAD:
                return f"nothing to match on: the obstacles of map {name} lie on one line or spot"
        return None

    def similarity(self, T_1_2_px: Pose2) -> float:
        """Return the Jaccard similarity of the obstacles as they are drawn in the maps, 0..1."""
        return jaccard_similarity(self.walls_1, self.walls_2_px, T_1_2_px)

    def acceptance_index(self, T_1_2_px: Pose2) -> float:
        """Return agreeing cells / (agreeing + disagreeing cells), 0..1 (Birk and Carpin 2006).

        Both wall or both floor agrees, wall on floor disagrees; where either is unknown nothing is
        counted. No common cell at all gives 0.
        """
        map_1 = self.maps[0]
        col, row = np.floor(T_1_2_px.apply(self.cells_2_px)).astype(np.intp).T
        height, width = map_1.shape
        inside = (col >= 0) & (col < width) & (row >= 0) & (row < height)
        is_wall_2 = self.is_wall_2[inside]
        under = map_1.cells[row[inside], col[inside]]
        wall, floor = under >= OCCUPIED_FROM, (under >= 0) & (under <= FREE_UP_TO)
        agreeing = np.count_nonzero(np.where(is_wall_2, wall, floor))
        both = np.count_nonzero(wall | floor)
        return agreeing / both if both else 0.0

    def overlap(self, T_1_2_px: Pose2) -> float:
        """Return the area known in both maps / the known area of the smaller, 0..1."""
        return float(overlap_share(*self.maps, self.in_metres(T_1_2_px)))

    def in_metres(self, T_1_2_px: Pose2) -> Pose2:
        """Take a transform between the lattices [px] to the maps' metric frames, T_a_b."""
        return in_metres(T_1_2_px, *self.maps)


def rejected(reason: str) -> MatchResult:
    """Return the answer of a method that found no transform at all."""
    return MatchResult(T_a_b=None, verdict=Verdict.REJECTED, reason=reason)


def similarity_at(a: OccupancyGrid, b: OccupancyGrid, T_a_b: Pose2, parameters: object = None) -> float:
    """Return what the baselines state as similarity, under a transform in metres.

    `parameters` is there because every method's measure is asked alike; this one has no settings.
    """
    evidence = Evidence.of(a, b)
    return float(evidence.similarity(in_pixels(T_a_b, *evidence.maps)))
