"""The settings of the default matcher. Few, because it measures in metres and knows how sure it is."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrelativeParameters:
    """Settings of the correlative method.

    Attributes
    ----------
    accept_probability
        A match is accepted from this probability of being right. Higher accepts less.
    hypotheses
        How many of the poses that the search lists, best first, are looked at more closely.
    """

    accept_probability: float = 0.8
    hypotheses: int = 12

    def __post_init__(self) -> None:
        if not (math.isfinite(self.accept_probability) and 0.5 < self.accept_probability < 1.0):
            raise ValueError(
                f"accept_probability must be above 0.5 and below 1, not {self.accept_probability}"
            )
        if not (isinstance(self.hypotheses, int) and 1 <= self.hypotheses <= 40):
            raise ValueError(f"hypotheses must be a whole number in 1..40, not {self.hypotheses}")
