"""What changed between two maps of one place, on one page: align, bend, compare, group."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from mapmeld.changes.classes import Change, Classes, classify
from mapmeld.changes.local_bending import bend_onto
from mapmeld.changes.regions import Region, find_regions
from mapmeld.errors import MapmeldError
from mapmeld.grid import UNKNOWN, Cells, OccupancyGrid, check_resolutions
from mapmeld.matching import DEFAULT_METHOD, MatchResult, Verdict, match
from mapmeld.merging import lattice_for_all
from mapmeld.se2 import Pose2
from mapmeld.wording import plural

TOLERANCE = 0.2
"""[m]; what local bending leaves of drift, and walls drawn by other scans."""
MAX_BEND = 0.5
"""[m]; real maps of a floor bend by up to some 0.4 m."""
MIN_AREA = 0.0075
"""[m^2]; three cells of 0.05 m: a table's leg."""
GAP = 0.4
"""[m]; cells of one kind nearer than this, as the legs of a chair are, belong to one change."""

PERCENT: Mapping[Change, int] = {
    Change.SAME: 0,
    Change.UNSEEN: 20,
    Change.EXPLORED: 40,
    Change.VANISHED: 60,
    Change.APPEARED: 100,
}
"""What stands for each class in the change map [percent]; UNKNOWN is unknown there too.

Only what appeared is an obstacle by the usual thresholds.
"""


class NoMatchError(MapmeldError):
    """Two maps cannot be compared, for it is not sure how one lies on the other; `match` says why."""

    def __init__(self, result: MatchResult) -> None:
        super().__init__(f"{result.verdict}: {result.reason}")
        self.match = result


@dataclass(frozen=True, slots=True, eq=False)
class MapDiff:
    """What changed between an earlier and a later map.

    Attributes
    ----------
    classes
        A `Change` for each cell, uint8 (rows, cols), row 0 at the bottom.
    old
        The earlier map on the lattice of `classes`: its own, extended by whole unknown cells.
    new
        The later map on that lattice, laid down and bent onto the earlier one.
    T_old_new
        Takes a point of the later map's frame into the earlier one's.
    match
        The evidence for it; None if it was given.
    bend
        The longest way [m] that any part of the later map was bent on top of it.
    regions
        The changes, the greatest first.
    """

    classes: Classes
    old: OccupancyGrid
    new: OccupancyGrid
    T_old_new: Pose2
    match: MatchResult | None
    bend: float
    regions: tuple[Region, ...]

    def area(self, change: Change) -> float:
        """Return the area [m^2] of the cells of one class."""
        return float(np.count_nonzero(self.classes == change)) * self.old.resolution**2

    def count(self, kind: str) -> int:
        """Return the number of regions of a kind, "appeared" or "vanished"."""
        return sum(region.kind == kind for region in self.regions)

    @property
    def summary(self) -> str:
        """The changes in one line."""
        parts = []
        for kind, change in (("appeared", Change.APPEARED), ("vanished", Change.VANISHED)):
            regions = self.count(kind)
            places = f" in {plural(regions, 'place')}" if regions else ""
            parts.append(f"{self.area(change):.2f} m2 of obstacles {kind}{places}")
        both = sum(self.area(c) for c in (Change.SAME, Change.APPEARED, Change.VANISHED))
        parts.append(f"{self.area(Change.EXPLORED):.1f} m2 newly explored")
        parts.append(f"{self.area(Change.UNSEEN):.1f} m2 not seen again")
        return f"{'; '.join(parts)}; {both:.1f} m2 known in both"

    def as_map(self) -> OccupancyGrid:
        """Return the classes as a map: occupied what appeared, and a percentage for every other class.

        The percentages are those of `PERCENT`; what neither map knows is unknown.
        """
        percent = np.full(len(Change), UNKNOWN, np.int8)
        percent[list(PERCENT)] = list(PERCENT.values())
        return replace(self.old, cells=percent[self.classes], stamp=self.new.stamp)

    def updated(self) -> OccupancyGrid:
        """Return the earlier map with what changed and what was newly explored carried into it.

        All that did not change keeps the earlier map's cells, so walls stay where goals and zones expect
        them; what the later map did not see again is kept.
        """
        taken = np.isin(self.classes, (Change.APPEARED, Change.VANISHED, Change.EXPLORED))
        cells: Cells = np.where(taken, self.new.cells, self.old.cells)
        return replace(self.old, cells=cells, stamp=self.new.stamp)


def diff(
    old: OccupancyGrid,
    new: OccupancyGrid,
    *,
    T_old_new: Pose2 | None = None,
    method: str = DEFAULT_METHOD,
    parameters: object | None = None,
    tolerance: float = TOLERANCE,
    max_bend: float = MAX_BEND,
    min_area: float = MIN_AREA,
) -> MapDiff:
    """Find what changed between an earlier and a later map of one place.

    The later map is laid on the earlier one and bent onto it locally (`mapmeld.changes.local_bending`);
    then an obstacle has appeared where the earlier map had seen floor, and has vanished where the later has.

    Parameters
    ----------
    old, new
        The earlier and the later map; resolution, size, origin and yaw may all differ.
    T_old_new
        Takes a point of the later map's frame into the earlier one's; None to match the maps.
    method, parameters
        As for `mapmeld.match`.
    tolerance
        An obstacle this near [m] to one of the other map is that one. At least two cells are taken.
    max_bend
        How far [m] any part of the later map may be bent; 0 compares it as it is.
    min_area
        Changed area [m^2] below which a group of cells is speckle, not a change; a single cell always is.

    Raises
    ------
    NoMatchError
        The maps were matched, and the match was not accepted.
    ResolutionError, MergeError
        Cell sizes that cannot both be right; maps too far apart for one lattice.
    UnknownMethodError
        There is no such method.
    """
    for name, value in (("tolerance", tolerance), ("max_bend", max_bend), ("min_area", min_area)):
        if not (math.isfinite(value) and value >= 0):
            raise ValueError(f"{name} must be a number from 0 on, not {value}")
    check_resolutions(old, new)
    result = None
    if T_old_new is None:
        result = match(old, new, method, parameters)
        if result.verdict is not Verdict.ACCEPTED or result.T_a_b is None:
            raise NoMatchError(result)
        T_old_new = result.T_a_b
    lattice = lattice_for_all([old, new], [Pose2(), T_old_new])
    bending = bend_onto(old, new, T_old_new, max_bend)
    laid = replace(new, cells=bending.laid(new, T_old_new, lattice), resolution=lattice.resolution)
    laid = replace(laid, origin=lattice.origin, frame_id=lattice.frame_id)
    # Nothing is drawn more exactly than the coarser cells allow.
    tolerance = max(tolerance, 2 * max(old.resolution, new.resolution))
    classes = classify(lattice, laid, tolerance)
    regions, classes = find_regions(classes, lattice, min_area, GAP)
    classes.flags.writeable = False
    return MapDiff(classes, lattice, laid, T_old_new, result, bending.greatest, regions)
