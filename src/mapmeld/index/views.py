"""What the walls around a point of a wall look like: the parts that a map's signature counts.

Each is a shape context (Belongie, Malik, Puzicha 2002): how much wall lies in each of some rings and sectors
around the point. The sectors are counted from the wall's normal on the side of the floor, so turning
or moving the map changes nothing, and what a robot did not see further away changes nothing either. A
wall with floor on both sides is looked at from both.

Points, normals and lengths are metric, from lines fitted to the cells, and nothing has a sharp edge:
how the cells lie to the walls is not to show.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mapmeld.grid import OccupancyGrid
from mapmeld.matching.correlative.prepared_map import prepare
from mapmeld.matching.correlative.wall_map import STRAIGHT_LEAST, Doubles, Floats, Index, Plane, WallMap

SECTORS = 12
RINGS = 6
SIZE = RINGS * SECTORS
MOST = 600  # views of a map
REACHES = (
    (0.3, 0.6, 0.9, 1.3, 1.7, 2.2),
    (0.5, 1.0, 1.6, 2.4, 3.4, 4.5),
)
"""[m] outer edges of the rings: near views, which parts of maps share, and wide views, which tell more."""

_SIDE = 0.3  # [m] from a wall at which its floor is looked for
_LONGEST = 0.3  # [m] of wall that one point stands for at most: what is longer is no line but a blob
_SELF = 1e-3  # [m] a point nearer than this is the point itself
_AROUND, _ACROSS = 0.25, 0.12  # [m] along and across a wall, in which its direction is averaged
_AT_ONCE = 100  # views computed together


@dataclass(frozen=True, slots=True, eq=False)
class Views:
    """Views of a map's walls.

    Attributes
    ----------
    seen
        For each reach, (n, SIZE): each of length 1, or 0 if there is no wall in it.
    metres
        Length of wall (n,) that each view stands for.
    """

    seen: tuple[Floats, ...]
    metres: Floats


def wall_views(grid: OccupancyGrid) -> Views:
    """Return the views of a map's walls from up to `MOST` points of them; none without walls.

    The square root of the lengths of wall is counted, so that one long wall does not drown all else
    (Arandjelovic, Zisserman 2012).
    """
    prepared = prepare(grid)
    if prepared is None:
        return Views(tuple(np.zeros((0, SIZE), np.float32) for _ in REACHES), np.zeros(0, np.float32))
    walls = prepared.walls
    index, normals = _lookouts(walls)
    metres = np.minimum(walls.metres, np.float32(_LONGEST))
    seen = tuple(_unit(_lengths(walls, metres, walls.points[index], normals, edges)) for edges in REACHES)
    return Views(seen, metres[index])


def _unit(lengths: Doubles) -> Floats:
    seen = np.sqrt(lengths)
    norm = np.linalg.norm(seen, axis=1, keepdims=True)
    return np.asarray((seen / np.where(norm > 0, norm, 1)).astype(np.float32))


def _lookouts(walls: WallMap) -> tuple[Index, Plane]:
    """Choose wall points with floor on a side; return their indices and the normals to that side."""
    straight = np.flatnonzero(walls.straight > STRAIGHT_LEAST)
    smooth = _smoothed(walls, straight)
    index, normals = [], []
    for side in (1, -1):
        beside = (walls.points[straight] + np.float32(side * _SIDE) * smooth).astype(np.complex64)
        has_floor = walls.depth[walls.at(beside)] > 0
        index.append(straight[has_floor])
        normals.append(side * smooth[has_floor])
    chosen = np.random.default_rng(0).permutation(len(index[0]) + len(index[1]))[:MOST]
    return np.concatenate(index)[chosen], np.concatenate(normals)[chosen].astype(np.complex64)


def _smoothed(walls: WallMap, straight: Index) -> Plane:
    """Average the normals of the wall that a point is on; they have no sign, so twice their angles."""
    twice = walls.metres[straight] * walls.straight[straight] * walls.normals[straight] ** 2
    smooth = np.array(walls.normals[straight])
    for first in range(0, len(straight), _AT_ONCE):
        some = slice(first, first + _AT_ONCE)
        away = walls.points[straight] - walls.points[straight[some], None]
        near = away.real**2 + away.imag**2 < _AROUND**2
        near &= np.abs((away * smooth[some, None].conj()).real) < _ACROSS
        mean = np.sqrt((near * twice).sum(axis=1))
        mean = np.where((mean * smooth[some].conj()).real < 0, -mean, mean)
        size = np.abs(mean)
        smooth[some] = np.where(size > 0, mean / np.where(size > 0, size, 1), smooth[some])
    return smooth


def _lengths(
    walls: WallMap, metres: Floats, places: Plane, normals: Plane, edges: tuple[float, ...]
) -> Doubles:
    """Return the length of wall [m] in each ring and sector (n, SIZE) around the places (n,)."""
    middles = [(inner + outer) / 2 for inner, outer in zip((0.0, *edges[:-1]), edges, strict=True)]
    reach = edges[-1]
    lengths = np.zeros((len(places), SIZE))
    for first in range(0, len(places), _AT_ONCE):
        away = walls.points - places[first : first + _AT_ONCE, None]
        squared = away.real**2 + away.imag**2
        view, point = np.nonzero((squared < reach**2) & (squared > _SELF**2))
        distance = np.sqrt(squared[view, point])
        away = away[view, point] * normals[first + view].conj()
        angle = np.arctan2(away.imag, away.real) * np.float32(SECTORS / math.tau)
        sector = np.floor(angle).astype(np.intp)
        of_next = angle - sector  # share of the next sector: no jump where a wall crosses to it
        at = np.interp(distance, middles, np.arange(RINGS))
        ring = np.minimum(at.astype(np.intp), RINGS - 2)
        of_outer = at - ring
        length = metres[point] * np.minimum((reach - distance) / (reach - middles[-1]), 1)
        block = lengths[first : first + _AT_ONCE].reshape(-1)
        for r, r_share in ((0, 1 - of_outer), (1, of_outer)):
            for s, s_share in ((0, 1 - of_next), (1, of_next)):
                cell = view * SIZE + (ring + r) * SECTORS + (sector + s) % SECTORS
                block += np.bincount(cell, length * r_share * s_share, len(block))
    return lengths
