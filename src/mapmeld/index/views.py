"""What the walls around a point of a wall look like: the parts that a map's signature counts.

Each is a shape context (Belongie, Malik, Puzicha 2002): how much wall lies in each of some rings and sectors
around the point. The sectors are counted from the wall's normal on the side of the floor, so turning
or moving the map changes nothing, and what a robot did not see further away changes nothing either. A
wall with floor on both sides is looked at from both.
"""

from __future__ import annotations

import math

import numpy as np

from mapmeld.grid import OccupancyGrid
from mapmeld.matching.correlative.prepared_map import prepare
from mapmeld.matching.correlative.wall_map import STRAIGHT_LEAST, Doubles, Floats, Index, Plane, WallMap

RINGS = (
    0.0,
    0.3,
    0.6,
    0.9,
    1.3,
    1.7,
    2.2,
)  # [m] their edges; a room, not a floor: most maps share only a part
SECTORS = 12
SIZE = (len(RINGS) - 1) * SECTORS
MOST = 600  # views of a map

_SIDE = 0.3  # [m] from a wall at which its floor is looked for
_LONGEST = 0.3  # [m] of wall that one point stands for at most: what is longer is no line but a blob
_SELF = 1e-3  # [m] a point nearer than this is the point itself
_AT_ONCE = 100  # views computed together


def wall_views(grid: OccupancyGrid) -> Floats:
    """Return the views (n, SIZE) of a map's walls from up to `MOST` points of them; none without walls.

    Each has length 1. The square root of the lengths of wall is counted, so that one long wall does
    not drown all else (Arandjelovic, Zisserman 2012).
    """
    prepared = prepare(grid)
    if prepared is None:
        return np.zeros((0, SIZE), np.float32)
    walls = prepared.walls
    index, normals = _lookouts(walls)
    seen = _lengths(walls, walls.points[index], normals)
    np.sqrt(seen, out=seen)
    norm = np.linalg.norm(seen, axis=1)
    some = norm > 0
    return np.asarray((seen[some] / norm[some, None]).astype(np.float32))


def _lookouts(walls: WallMap) -> tuple[Index, Plane]:
    """Choose wall points with floor on a side; return their indices and the normals to that side."""
    straight = walls.straight > STRAIGHT_LEAST
    index, normals = [], []
    for side in (1, -1):
        beside = walls.points + np.float32(side * _SIDE) * walls.normals
        at = np.flatnonzero(straight & (walls.depth[walls.at(beside)] > 0))
        index.append(at)
        normals.append(side * walls.normals[at])
    chosen = np.random.default_rng(0).permutation(len(index[0]) + len(index[1]))[:MOST]
    return np.concatenate(index)[chosen], np.concatenate(normals)[chosen].astype(np.complex64)


def _lengths(walls: WallMap, places: Plane, normals: Plane) -> Doubles:
    """Return the length of wall [m] in each ring and sector (n, SIZE) around the places (n,)."""
    edges = np.square(np.array(RINGS, np.float32))
    metres = np.minimum(walls.metres, _LONGEST)
    lengths = np.zeros((len(places), SIZE))
    for first in range(0, len(places), _AT_ONCE):
        away = walls.points - places[first : first + _AT_ONCE, None]
        squared = away.real**2 + away.imag**2
        view, point = np.nonzero((squared < edges[-1]) & (squared > _SELF**2))
        away = away[view, point] * normals[first + view].conj()
        ring = np.searchsorted(edges, squared[view, point], side="right") - 1
        angle = np.arctan2(away.imag, away.real) * np.float32(SECTORS / math.tau)
        below = np.floor(angle)
        share = angle - below  # of the next sector: no jump where a wall crosses from one to another
        sector = below.astype(np.intp)
        block = lengths[first : first + _AT_ONCE].reshape(-1)
        base = view * SIZE + ring * SECTORS
        for turn, weight in ((0, 1 - share), (1, share)):
            at = base + (sector + turn) % SECTORS
            block += np.bincount(at, weight * metres[point], len(block))
    return lengths
