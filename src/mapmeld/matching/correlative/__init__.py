"""The default matcher: correlation of walls and floor, alignment of walls, and a calibrated probability."""

from mapmeld.matching.correlative.matcher import match_correlative
from mapmeld.matching.correlative.parameters import CorrelativeParameters

__all__ = ["CorrelativeParameters", "match_correlative"]
