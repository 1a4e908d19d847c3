"""`feature_orb`: the pipeline of multirobot_map_merge with ORB features (Rublee et al. 2011)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2

from mapmeld.grid import OccupancyGrid
from mapmeld.matching.baselines.feature_pipeline import FeatureMatchingParameters, match_features
from mapmeld.matching.result import MatchResult


@dataclass(frozen=True, slots=True, kw_only=True)
class FeatureOrbParameters(FeatureMatchingParameters):
    """Settings of `feature_orb`; the defaults are OpenCV's and multirobot_map_merge's.

    Attributes
    ----------
    features
        The most features taken from each map.
    """

    features: int = 500

    def __post_init__(self) -> None:
        FeatureMatchingParameters.__post_init__(self)
        if not 2 <= self.features <= 1_000_000:
            raise ValueError(f"features must be in 2..1000000, not {self.features}")


def match_feature_orb(
    a: OccupancyGrid, b: OccupancyGrid, parameters: FeatureOrbParameters | None = None
) -> MatchResult:
    """Match two maps by ORB features, see `feature_pipeline`."""
    parameters = parameters or FeatureOrbParameters()
    return match_features(a, b, cv2.ORB.create(nfeatures=parameters.features), parameters)
