"""How far an answer is from the truth, when that counts as right, and how true a map is to its plan."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mapmeld.grid import FREE_UP_TO, OCCUPIED_FROM, UNKNOWN, OccupancyGrid, resample
from mapmeld.se2 import Pose2, wrap_angle


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Errors up to which an answer counts as right.

    Attributes
    ----------
    translation
        At the middle of the overlap [m].
    rotation
        [rad]
    """

    translation: float = 0.5
    rotation: float = math.radians(5.0)

    def __post_init__(self) -> None:
        if not (math.isfinite(self.translation) and self.translation > 0):
            raise ValueError(f"a tolerance is a positive number of metres, not {self.translation:g}")
        if not (math.isfinite(self.rotation) and 0 < self.rotation <= math.pi):
            degrees = math.degrees(self.rotation)
            raise ValueError(f"a tolerance is above 0 and at most 180 degrees, not {degrees:g}")

    @classmethod
    def of(cls, metres: float, degrees: float) -> Tolerance:
        """Return a tolerance in the units in which people state it."""
        return cls(metres, math.radians(degrees))

    def __str__(self) -> str:
        return f"{self.translation:g} m and {math.degrees(self.rotation):g} degrees"


@dataclass(frozen=True, slots=True)
class PoseErrors:
    """Errors of an estimated transform.

    Attributes
    ----------
    translation
        At the middle of the overlap [m].
    rotation
        Unsigned [rad].
    """

    translation: float
    rotation: float

    def within(self, tolerance: Tolerance) -> bool:
        """Report whether both errors are at most the tolerance (never, if one is not a number)."""
        return self.translation <= tolerance.translation and self.rotation <= tolerance.rotation


def pose_errors(T_a_b: Pose2, truth_a_b: Pose2, centroid: tuple[float, float]) -> PoseErrors:
    """Compare an estimate with the truth.

    The translation error is how far the estimate moves the point that the truth lays on
    `centroid`. Measured at the frames' origins instead, which may lie far off the maps, a small
    rotation error would count a second time, multiplied by that distance.

    Parameters
    ----------
    T_a_b, truth_a_b
        Estimate and truth; each takes a point of map b's metric frame into map a's.
    centroid
        Middle of the overlap under the truth, in map a's frame [m]; see `overlap_centroid`.
    """
    there = T_a_b.apply(truth_a_b.inverse().apply(centroid))
    translation = math.hypot(there[0] - centroid[0], there[1] - centroid[1])
    difference = T_a_b.theta - truth_a_b.theta
    rotation = abs(wrap_angle(difference)) if math.isfinite(difference) else math.nan
    return PoseErrors(translation, rotation)


def overlap_centroid(a: OccupancyGrid, b: OccupancyGrid, T_a_b: Pose2) -> tuple[float, float] | None:
    """Return the mean of the centres [m, in a's frame] of a's cells known in both maps; None without any."""
    both = a.known & (resample(b, T_a_b, a) > UNKNOWN)
    if not both.any():
        return None
    x, y = a.centres(both).mean(axis=0)
    return float(x), float(y)


def accuracy(result: OccupancyGrid, truth: OccupancyGrid, T_truth_result: Pose2) -> float:
    """Return the accuracy of a map or a merged map, 0..1.

    The share of the black and white cells of the result that have the same colour in the truth.

    Source: "Map Matching for SLAM with Multiple Robots in Different Moments", section 4, Equation 3,
    (P_p + P_b) / (P_pc + P_bc). Cells of the result where the truth is unknown count as wrong.

    Parameters
    ----------
    result
        The map to judge.
    truth
        The original environment.
    T_truth_result
        Takes a point of the result's metric frame into the truth's.

    Raises
    ------
    ValueError
        The result has neither a black nor a white cell.
    """
    counted = int(np.count_nonzero(result.occupied)) + int(np.count_nonzero(result.free))
    if not counted:
        raise ValueError("the result has neither black nor white cells, so it has no accuracy")
    under = resample(truth, T_truth_result.inverse(), result)
    black = np.count_nonzero(result.occupied & (under >= OCCUPIED_FROM))
    white = np.count_nonzero(result.free & (under > UNKNOWN) & (under <= FREE_UP_TO))
    return (int(black) + int(white)) / counted
