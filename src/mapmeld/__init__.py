"""mapmeld: find how occupancy grid maps fit together, say how sure we are, and merge them.

The three levels of the API:

>>> mapmeld.merge(["a.yaml", "b.yaml"]).save("merged.yaml")                # doctest: +SKIP
>>> result = mapmeld.match(mapmeld.load("a.yaml"), mapmeld.load("b.yaml"))  # doctest: +SKIP
>>> from mapmeld.matching import alphabet   # every step of the paper's method
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from mapmeld.changes import MapDiff, diff
    from mapmeld.errors import MapmeldError
    from mapmeld.grid import OccupancyGrid
    from mapmeld.history import Follower, follow
    from mapmeld.io import load, save
    from mapmeld.matching import MatchResult, Verdict, match
    from mapmeld.merging import MergeResult, merge
    from mapmeld.se2 import Pose2

# Resolved on first use, so that importing mapmeld (and `mapmeld --help`) does not import OpenCV.
_HOMES = {
    "MapDiff": "mapmeld.changes",
    "Follower": "mapmeld.history",
    "MapmeldError": "mapmeld.errors",
    "MatchResult": "mapmeld.matching",
    "MergeResult": "mapmeld.merging",
    "OccupancyGrid": "mapmeld.grid",
    "Pose2": "mapmeld.se2",
    "Verdict": "mapmeld.matching",
    "diff": "mapmeld.changes",
    "follow": "mapmeld.history",
    "load": "mapmeld.io",
    "match": "mapmeld.matching",
    "merge": "mapmeld.merging",
    "save": "mapmeld.io",
}

__all__ = [
    "Follower",
    "MapDiff",
    "MapmeldError",
    "MatchResult",
    "MergeResult",
    "OccupancyGrid",
    "Pose2",
    "Verdict",
    "__version__",
    "diff",
    "follow",
    "load",
    "match",
    "merge",
    "save",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'mapmeld' has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
