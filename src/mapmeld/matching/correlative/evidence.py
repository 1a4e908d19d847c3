"""Evidence: how two maps explain each other under one transform."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmeld.matching.correlative.alignment import WallPairs, look_up, turn_and_shift
from mapmeld.matching.correlative.bending import nearest_rigid, patch_shifts, patches_of, smooth_bending
from mapmeld.matching.correlative.wall_map import STRAIGHT_LEAST, Doubles, Floats, Plane, WallMap

HIT = 0.1  # [m] across the wall: explained by the other map's wall
NEAR = 0.3  # [m] next to the other map's wall
DEEP = 0.3  # [m] further than this from anything inside free space: there is no wall here


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """How well two maps explain each other under one transform; lengths in metres of wall of both maps.

    Attributes
    ----------
    wall
        Wall that lies where the other map knows something.
    hit, hit_bent
        Of it, explained: within HIT of the other's wall and of the same direction; as it lies, and
        after b is bent smoothly and patch by patch onto a.
    contra, contra_bent
        Deep in the other's free space, where no wall can be; rigidly, and bent.
    chance, chance_deep
        Share of the common floor within HIT of a wall / deeper than DEEP: what walls placed at
        random would get.
    bend
        Rms displacement by the bending [m].
    overlap
        Area known in both / known area of the smaller map.
    weak
        Explained wall that fixes the least fixed direction [m]; small along corridors.
    unbent
        The rigid transform (local frames, (3,)) nearest to the bent one.
    """

    wall: float
    hit: float
    hit_bent: float
    contra: float
    contra_bent: float
    chance: float
    chance_deep: float
    bend: float
    overlap: float
    weak: float
    unbent: Doubles

    @property
    def shares(self) -> tuple[float, float]:
        """Shares of the tested wall that are explained, after bending, and contradicted, as it lies."""
        return self.hit_bent / self.wall, self.contra / self.wall

    @property
    def surplus(self) -> float:
        """Root of the deviance [nats x metres] of (hit, contradicted, neither) from a random placement.

        Grows with the length of wall that was tested and with its distance from chance.
        """
        hit, deep = self.hit_bent / self.wall, self.contra_bent / self.wall
        hit_by_chance = min(max(self.chance, 0.02), 0.8)
        deep_by_chance = min(max(self.chance_deep, 0.02), 0.9)
        if hit <= hit_by_chance:
            return 0.0
        nats = 0.0
        for seen, expected in (
            (min(max(hit, 1e-3), 0.999), hit_by_chance),
            (min(max(deep, 1e-3), 0.9), deep_by_chance),
            (max(1 - hit - deep, 1e-3), max(1 - hit_by_chance - deep_by_chance, 0.05)),
        ):
            nats += seen * math.log(seen / expected)
        return math.sqrt(max(0.0, nats * self.wall))

    @property
    def per_metre(self) -> float:
        """Deviance [nats] that a metre of wall has from a random placement."""
        return max(self.surplus**2 / self.wall, 1e-9)

    @property
    def clean(self) -> float:
        """How little wall lies in the other's free space, as a logarithm: 0 (all of it) .. 3.9 (none)."""
        return -math.log(self.contra / self.wall + 0.02)

    @property
    def log_overlap(self) -> float:
        """Small overlaps of large maps come about by chance in many more ways than large ones."""
        return math.log(self.overlap + 0.02)

    @property
    def clean_bent(self) -> float:
        """The same after bending."""
        return -math.log(self.contra_bent / self.wall + 0.02)


def weigh(pa: WallMap, pb: WallMap, t: Doubles, n: int = 1200) -> list[Evidence]:
    """Measure how both maps explain each other under each t (k, 3), which takes b's local frame into a's.

    `n` wall points of each map are looked at.
    """
    metres = _metres(pa, pb, n)
    rigid = look_up(pa, pb, t, n)
    u = smooth_bending(pa, pb, t, rigid.x)
    patch, patches = patches_of(rigid.x)
    u += patch_shifts(look_up(pa, pb, t, n, u), patch, patches).take(patch)
    bent = look_up(pa, pb, t, n, u)

    depth, depth_bent = rigid.depth, bent.depth
    near = np.minimum(_squared(rigid.e), _squared(bent.e)) < NEAR**2
    inside = near | (depth >= 0) | (depth_bent >= 0)
    explained = metres * _hits(bent)
    hit_bent = explained.sum(axis=1) + 1e-6
    turn, _ = turn_and_shift(t)
    lines_a = np.broadcast_to(pa.lines[:n], (len(t), len(pa.lines[:n])))
    lines = np.concatenate([pb.lines[:n] * turn, lines_a], axis=1)
    nx, ny = lines.real, lines.imag
    xx, xy, yy = (np.sum(explained * v, axis=1) for v in (nx * nx, nx * ny, ny * ny))
    area, close, deep = _common_floor(pa, pb, t)
    columns = zip(
        (inside @ metres + 1e-6).tolist(),
        ((_hits(rigid) & inside) @ metres).tolist(),
        hit_bent.tolist(),
        ((depth > DEEP) @ metres).tolist(),
        ((np.minimum(depth, depth_bent) > DEEP) @ metres).tolist(),
        close.tolist(),
        deep.tolist(),
        np.sqrt((explained * _squared(u)).sum(axis=1) / hit_bent).tolist(),
        (area / min(pa.area, pb.area)).tolist(),
        np.maximum(0, (xx + yy) / 2 - np.hypot((xx - yy) / 2, xy)).tolist(),
        nearest_rigid(t, rigid.x, u, explained),
        strict=True,
    )
    return [Evidence(*figures) for figures in columns]


def _common_floor(pa: WallMap, pb: WallMap, t: Doubles) -> tuple[Doubles, Doubles, Doubles]:
    """Return, for each t (k, 3), what is known in both maps.

    Its area [m^2], and its shares within `HIT` of the other map's wall and deep in its free space.
    """
    turn, shift = turn_and_shift(t)
    area, close, deep, both = np.zeros((4, len(t)))
    for p, other, z in ((pa, pb, turn * pb.floor + shift), (pb, pa, (pa.floor - shift) * turn.conj())):
        at = p.at(z)
        depth = p.depth.take(at)
        known = depth >= 0
        count = np.count_nonzero(known, axis=1)
        area += 0.5 * count / z.shape[1] * other.area
        both += count
        z -= p.points.take(p.nearest.take(at))
        close += np.count_nonzero(known & (_squared(z) < HIT**2), axis=1)
        deep += np.count_nonzero(depth > DEEP, axis=1)
    some = np.maximum(both, 1)
    return area, np.where(both > 0, close / some, 1.0), deep / some


def _squared(z: Plane) -> Floats:
    """Return |z|^2, which numpy computes several times as fast as |z|."""
    return np.asarray(z.real**2 + z.imag**2)


def _hits(p: WallPairs) -> NDArray[np.bool_]:
    """Whether a wall point (k, m) is explained: a wall of the same direction within `HIT` across it."""
    r, along = p.across()
    same_way = (p.cosine() > 0.85) | (p.straight < STRAIGHT_LEAST)
    return np.asarray((np.abs(r) < HIT) & (np.abs(along) < 0.2) & same_way)


def quick_scores(pa: WallMap, pb: WallMap, t: Doubles, n: int) -> Floats:
    """Score roughly refined t (k, 3) cheaply: walls explained beyond chance, less walls contradicted."""
    p = look_up(pa, pb, t, n)
    metres = _metres(pa, pb, n)
    depth, squared = p.depth, _squared(p.e)
    explained = np.exp(squared * np.float32(-0.5 / 0.2**2)) @ metres
    tested = ((depth >= 0) | (squared < NEAR**2)) @ metres
    against = (depth > DEEP) @ metres
    return np.asarray((explained - 0.35 * tested - 0.5 * against) / np.sqrt(tested + 10))


def _metres(pa: WallMap, pb: WallMap, n: int) -> Floats:
    """Length of wall [m] that each of the first n points of b, then of a, stands for."""
    samples = [(p.metres[:n], p.metres) for p in (pb, pa)]
    return np.concatenate([some * (every.sum() / some.sum()) for some, every in samples])
