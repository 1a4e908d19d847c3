"""Matchers: two occupancy grids in, one `MatchResult` out."""

from mapmeld.matching.match import DEFAULT_METHOD, METHODS, Method, UnknownMethodError, match, method_named
from mapmeld.matching.result import Alternative, MatchResult, Verdict

__all__ = [
    "DEFAULT_METHOD",
    "METHODS",
    "Alternative",
    "MatchResult",
    "Method",
    "UnknownMethodError",
    "Verdict",
    "match",
    "method_named",
]
