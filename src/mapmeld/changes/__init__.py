"""What changed between two maps of one place, and what was drawn on one map carried to the other."""

from mapmeld.changes.classes import Change
from mapmeld.changes.diff import MapDiff, NoMatchError, diff
from mapmeld.changes.rebase import rebase
from mapmeld.changes.regions import Region

__all__ = ["Change", "MapDiff", "NoMatchError", "Region", "diff", "rebase"]
