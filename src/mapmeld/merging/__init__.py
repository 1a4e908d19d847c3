"""Merging: aligned grids into one, and many maps into components that belong together."""

from mapmeld.merging.aligned import MergeError, lattice_for_all, merge_aligned
from mapmeld.merging.fusion import FUSIONS, UnknownFusionError, check_fusion, fuse
from mapmeld.merging.graph import KnownPose, PairMatch, PairState
from mapmeld.merging.merge import merge
from mapmeld.merging.result import Joint, MergeResult

__all__ = [
    "FUSIONS",
    "Joint",
    "KnownPose",
    "MergeError",
    "MergeResult",
    "PairMatch",
    "PairState",
    "UnknownFusionError",
    "check_fusion",
    "fuse",
    "lattice_for_all",
    "merge",
    "merge_aligned",
]
