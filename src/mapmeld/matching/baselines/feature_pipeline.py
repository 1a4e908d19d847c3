"""Matching by image features, as the ROS package multirobot_map_merge does it.

Source: J. Hörner, "Map-merging for multi-robot system" (bachelor's thesis, Charles University, Prague, 2016)
and its package multirobot_map_merge (m-explore). It hands maps to OpenCV's stitching classes as pictures;
so does this module, with the same classes, the same settings and the same bytes. Which
features are used is the business of `feature_orb` and `feature_akaze`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmeld.grid import OccupancyGrid
from mapmeld.matching.baselines.evidence import Evidence, Points, rejected
from mapmeld.matching.result import MatchResult, Verdict
from mapmeld.se2 import Pose2

_T = TypeVar("_T")

# OpenCV's matcher asks for the two nearest neighbours of every feature.
_FEWEST_FEATURES = 2
# No detector finds anything so near to the border, and ORB's pyramid has no room for its smallest level.
_SMALLEST_SIDE_PX = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class FeatureMatchingParameters:
    """Settings that ORB and AKAZE share, with the values of multirobot_map_merge.

    Attributes
    ----------
    match_conf
        How much nearer the best partner of a feature must be than the second: a match is kept if its
        distance is below (1 - match_conf) of the second's. OpenCV's default for ORB.
    accept_confidence
        OpenCV's confidence, inliers / (8 + 0.3 matches), from which a match is accepted
        (`estimation_confidence` there).
    seed
        Seed of the random trees in which the features are looked up.
    """

    match_conf: float = 0.3
    accept_confidence: float = 1.0
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.match_conf < 1:
            raise ValueError(f"match_conf must be at least 0 and below 1, not {self.match_conf}")
        if not (math.isfinite(self.accept_confidence) and self.accept_confidence >= 0):
            raise ValueError(
                f"accept_confidence must be a number of at least 0, not {self.accept_confidence}"
            )
        if not 0 <= self.seed < 2**31:
            raise ValueError(f"seed must be in 0..2147483647, not {self.seed}")


def as_bytes(grid: OccupancyGrid) -> NDArray[np.uint8]:
    """Return the cells as the picture that multirobot_map_merge sees: its int8 values read as bytes.

    Unknown is 255, as white as can be, floor 0, obstacles 100; row 0 stays the bottom row, so pixels are
    lattice positions without a flip.
    """
    return grid.cells.view(np.uint8)


def match_features(
    a: OccupancyGrid, b: OccupancyGrid, finder: Any, parameters: FeatureMatchingParameters
) -> MatchResult:
    """Match two maps by the features that an OpenCV `Feature2D` finds in them.

    The rotation, translation and scale that OpenCV estimates from its inliers is replaced by the rigid
    motion with the least squares over the same inliers. The original has no check of the scale and merges
    with whatever it is; here it decides nothing either, but the reason names it.
    """
    evidence = Evidence.of(a, b)
    if nothing := evidence.nothing_to_match_on():
        return rejected(nothing)
    found = _in_seeded_thread(parameters.seed, lambda: _find(evidence, finder, parameters.match_conf))
    if isinstance(found, str):
        return rejected(f"nothing to match on: {found}")
    accepted = found.confidence >= parameters.accept_confidence
    T_1_2_px = least_squares(found.inliers_2_px, found.inliers_1_px)
    return MatchResult(
        T_a_b=evidence.in_metres(T_1_2_px),
        verdict=Verdict.ACCEPTED if accepted else Verdict.REJECTED,
        reason=(
            f"confidence {found.confidence:.2f} ({len(found.inliers_1_px)} inliers of "
            f"{found.matches} matches, scale {found.scale:.3g}) is {'at least' if accepted else 'below'} "
            f"the threshold {parameters.accept_confidence:g}"
        ),
        similarity=evidence.similarity(T_1_2_px),
        overlap=evidence.overlap(T_1_2_px),
    )


@dataclass(frozen=True, slots=True)
class _Found:
    """What OpenCV's matcher answers: corresponding lattice positions [px], scale of map 2 on map 1."""

    inliers_1_px: Points
    inliers_2_px: Points
    matches: int
    confidence: float
    scale: float


def _find(evidence: Evidence, finder: Any, match_conf: float) -> _Found | str:
    """Return OpenCV's inliers, or the reason why there are none."""
    for name, grid in zip("ab", evidence.maps, strict=True):
        if min(grid.shape) < _SMALLEST_SIDE_PX:
            return f"map {name} is less than {_SMALLEST_SIDE_PX} cells wide"
    features = [cv2.detail.computeImageFeatures2(finder, as_bytes(grid)) for grid in evidence.maps]
    keypoints = [f.getKeypoints() for f in features]
    for name, points in zip("ab", keypoints, strict=True):
        if len(points) < _FEWEST_FEATURES:
            return f"map {name} has {len(points)} features"
    # Arguments: full affine (no: rotation, translation, scale), graphics card (no), match_conf.
    info: Any = cv2.detail.AffineBestOf2NearestMatcher(False, False, match_conf).apply(*features)
    matches = info.getMatches()
    if info.H is None or info.num_inliers < _FEWEST_FEATURES:
        return f"{len(matches)} matches of features agree on no transform"
    kept = [m for m, inlier in zip(matches, info.getInliers(), strict=True) if inlier]
    # OpenCV's whole numbers are the centres of pixels, the lattice's are their corners.
    return _Found(
        inliers_1_px=np.array([keypoints[0][m.queryIdx].pt for m in kept]) + 0.5,
        inliers_2_px=np.array([keypoints[1][m.trainIdx].pt for m in kept]) + 0.5,
        matches=len(matches),
        confidence=float(info.confidence),
        scale=1 / max(math.hypot(info.H[0, 0], info.H[1, 0]), 1e-12),
    )


def least_squares(from_px: Points, to_px: Points) -> Pose2:
    """Return the rigid motion that takes points (n, 2) nearest to their partners (n, 2)."""
    middle_from, middle_to = from_px.mean(axis=0), to_px.mean(axis=0)
    u, v = from_px - middle_from, to_px - middle_to
    theta = math.atan2(float((u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum()), float((u * v).sum()))
    x, y = middle_to - Pose2(theta=theta).apply(middle_from)
    return Pose2(float(x), float(y), theta)


def _in_seeded_thread(seed: int, step: Callable[[], _T]) -> _T:
    """Run a step with OpenCV's random numbers seeded, and leave the caller's as they are.

    The nearest neighbours are looked up in hash tables drawn at random. OpenCV keeps one generator per
    thread and gives no way to read and restore its state, so the step gets a thread of its own.
    """
    with ThreadPoolExecutor(max_workers=1, initializer=cv2.setRNGSeed, initargs=(seed,)) as thread:
        return thread.submit(step).result()
