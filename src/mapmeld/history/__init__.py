"""Two mapping processes, map state by map state (the paper's Algorithm 1, and evidence over time)."""

from mapmeld.history.evidence_over_time import EvidenceParameters
from mapmeld.history.follower import (
    DEFAULT_STRATEGY,
    STRATEGIES,
    Follower,
    UnknownStrategyError,
    follow,
)
from mapmeld.history.step import Change, Standing, Step, Work

__all__ = [
    "DEFAULT_STRATEGY",
    "STRATEGIES",
    "Change",
    "EvidenceParameters",
    "Follower",
    "Standing",
    "Step",
    "UnknownStrategyError",
    "Work",
    "follow",
]
