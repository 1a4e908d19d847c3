"""Many maps as a graph: every pair matched, false matches found by contradiction, poses of all maps."""

from mapmeld.merging.graph.all_pairs import match_all_pairs
from mapmeld.merging.graph.g2o import as_g2o
from mapmeld.merging.graph.known_poses import KnownPose, KnownPosesError, read_known_poses
from mapmeld.merging.graph.map_graph import MUCH_OVERLAP, MapGraph, PairMatch, PairState, solve

__all__ = [
    "MUCH_OVERLAP",
    "KnownPose",
    "KnownPosesError",
    "MapGraph",
    "PairMatch",
    "PairState",
    "as_g2o",
    "match_all_pairs",
    "read_known_poses",
    "solve",
]
