"""Merging: aligned grids into one, and many maps into components that belong together."""

from mapmeld.merging.aligned import merge_aligned
from mapmeld.merging.fusion import FUSIONS, UnknownFusionError, fuse
from mapmeld.merging.merge import Joint, MergeError, MergeResult, merge

__all__ = [
    "FUSIONS",
    "Joint",
    "MergeError",
    "MergeResult",
    "UnknownFusionError",
    "fuse",
    "merge",
    "merge_aligned",
]
