"""The settings of the paper's method, with the paper's values as defaults (section 3.3)."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields


@dataclass(frozen=True, slots=True, kw_only=True)
class AlphabetParameters:
    """Settings of the alphabet method. Lengths are pixels of the coarser of the two maps.

    Attributes
    ----------
    corners
        N, the most corners taken from each map (paper: 30).
    corner_quality
        q, weakest corner accepted, as a share of the strongest (paper: 0.2).
    corner_spacing_px
        Corners keep at least this distance from one another. The paper only says that they are
        "distributed throughout the image"; 10 px is our choice.
    relation_min_px
        D_min, shortest relation between two corners (paper: 18 px).
    relation_max_share
        D_max as a share of the greatest distance among the corners of either map (paper: half).
    distance_tolerance_px
        epsilon, distances that differ by no more are equal (paper: 1.1 px).
    angle_tolerance_deg
        nu, angles that differ by no more are equal (paper: 1.1 degrees).
    candidates
        candidates_number, how many candidates are tried on the maps (the paper gives no value).
    median_px
        Side of the median blur that removes clutter, odd (the paper gives no value).
    accept_similarity
        Jaccard similarity from which a match is accepted. The paper accepts everything; see
        docs/methods.md for how this was set and what it does not promise.
    ambiguous_share
        A match that would be accepted is ambiguous if a truly different fitting reaches this share of
        its similarity: a place that repeats itself looks alike in several positions.
    """

    corners: int = 30
    corner_quality: float = 0.2
    corner_spacing_px: float = 10.0
    relation_min_px: float = 18.0
    relation_max_share: float = 0.5
    distance_tolerance_px: float = 1.1
    angle_tolerance_deg: float = 1.1
    candidates: int = 30
    median_px: int = 3
    accept_similarity: float = 0.15
    ambiguous_share: float = 0.85

    def __post_init__(self) -> None:
        for setting in fields(self):
            value = getattr(self, setting.name)
            if not math.isfinite(value):
                raise ValueError(f"{setting.name} must be a finite number, not {value}")
        for name in ("corners", "candidates", "median_px"):
            if not isinstance(getattr(self, name), int):
                raise ValueError(f"{name} must be a whole number, not {getattr(self, name)}")
        for name, low, high in (
            ("corners", 2, 10_000),
            ("corner_spacing_px", 0, math.inf),
            ("relation_min_px", 0, math.inf),
            ("distance_tolerance_px", 0, math.inf),
            ("angle_tolerance_deg", 0, 90),
            ("candidates", 1, 1_000_000),
            ("accept_similarity", 0, 1),
        ):
            if not low <= getattr(self, name) <= high:
                raise ValueError(f"{name} must be in {low}..{high}, not {getattr(self, name)}")
        for name in ("corner_quality", "relation_max_share", "ambiguous_share"):
            if not 0 < getattr(self, name) <= 1:
                raise ValueError(f"{name} must be above 0 and at most 1, not {getattr(self, name)}")
        if self.median_px not in (1, 3, 5, 7, 9, 11):
            raise ValueError(f"median_px must be an odd number from 1 to 11, not {self.median_px}")
