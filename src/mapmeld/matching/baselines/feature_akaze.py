"""`feature_akaze`: the pipeline of multirobot_map_merge with AKAZE features (Alcantarilla et al. 2013)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2

from mapmeld.errors import MapmeldError
from mapmeld.grid import OccupancyGrid
from mapmeld.matching.baselines.feature_pipeline import FeatureMatchingParameters, match_features
from mapmeld.matching.result import MatchResult


class AkazeMissingError(MapmeldError):
    """The installed OpenCV was built without AKAZE."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FeatureAkazeParameters(FeatureMatchingParameters):
    """Settings of `feature_akaze`; the defaults are OpenCV's and multirobot_map_merge's.

    Attributes
    ----------
    response
        Weakest response of AKAZE's detector that counts as a feature.
    """

    response: float = 0.001

    def __post_init__(self) -> None:
        FeatureMatchingParameters.__post_init__(self)
        if not (math.isfinite(self.response) and self.response > 0):
            raise ValueError(f"response must be a positive number, not {self.response}")


def match_feature_akaze(
    a: OccupancyGrid, b: OccupancyGrid, parameters: FeatureAkazeParameters | None = None
) -> MatchResult:
    """Match two maps by AKAZE features, see `feature_pipeline`.

    Raises
    ------
    AkazeMissingError
        OpenCV 5 keeps AKAZE among its extra modules, and the plain wheel has none of them.
    """
    parameters = parameters or FeatureAkazeParameters()
    return match_features(a, b, _akaze(parameters.response), parameters)


def _akaze(response: float) -> Any:
    # OpenCV 4 has it at the top, OpenCV 5 in the extra module xfeatures2d.
    for home in (cv2, getattr(cv2, "xfeatures2d", None)):
        create = getattr(home, "AKAZE_create", None)
        if create is not None:
            return create(threshold=response)
    raise AkazeMissingError(
        "this OpenCV has no AKAZE features: put the build with the extra modules in its place, "
        "pip uninstall -y opencv-python-headless && pip install opencv-contrib-python-headless"
    )
