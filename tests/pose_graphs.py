"""Synthetic graphs of poses: random true poses, measured transforms with noise, and false ones among them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from mapmeld.merging.graph.edges import Doubles, Edges, composed, inverted, pose_of
from mapmeld.se2 import Pose2

SURE = math.log(99)  # log odds of 0.99


@dataclass(frozen=True)
class Synthetic:
    poses: Doubles
    edges: Edges
    false: frozenset[int]

    @property
    def count(self) -> int:
        return len(self.poses)


def pairs_of(count: int) -> list[tuple[int, int]]:
    return [(i, j) for i in range(count) for j in range(i + 1, count)]


def synthetic(
    seed: int,
    count: int,
    pairs: Iterable[tuple[int, int]] | None = None,
    *,
    noise: tuple[float, float] = (0.05, 0.005),
    stated: tuple[float, float] = (0.05, 0.005),
    false: int = 0,
    replaced: Mapping[tuple[int, int], Pose2] | None = None,
    weight: float = SURE,
) -> Synthetic:
    """Make a graph; `noise` and `stated` are standard deviations [m, rad], really and as the edges say.

    `false` edges, drawn at random, lead anywhere; those `replaced` lead as far off the truth as they say.
    """
    rng = np.random.default_rng(seed)
    poses = np.column_stack([rng.uniform(-20, 20, (count, 2)), rng.uniform(-math.pi, math.pi, count)])
    pairs = pairs_of(count) if pairs is None else list(pairs)
    wrong = (
        {int(k) for k in rng.choice(len(pairs), min(false, len(pairs)), replace=False)} if false else set()
    )
    covariance = np.diag([stated[0] ** 2, stated[0] ** 2, stated[1] ** 2])
    rows = []
    for k, (i, j) in enumerate(pairs):
        T = pose_of(composed(inverted(poses[i]), poses[j]))
        e = rng.normal(size=3) * [noise[0], noise[0], noise[1]]
        T = Pose2(T.x + e[0], T.y + e[1], T.theta + e[2])
        if k in wrong:
            far = rng.uniform([5, 5, 0.5], [20, 20, math.pi]) * rng.choice([-1, 1], 3)
            T = Pose2(T.x + far[0], T.y + far[1], T.theta + far[2])
        if replaced and (i, j) in replaced:
            wrong.add(k)
            T = replaced[i, j] @ T
        rows.append((i, j, T, covariance, weight))
    return Synthetic(poses, Edges.of(rows), frozenset(wrong))


def apart(poses: Doubles, truth: Doubles) -> float:
    """How far [m or rad] poses are from the truth at most, both seen from the first."""
    seen = [composed(np.repeat(inverted(p[:1]), len(p), axis=0), p) for p in (poses, truth)]
    gap = composed(inverted(seen[0]), seen[1])
    return float(np.abs(gap).max())
