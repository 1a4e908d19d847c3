"""A later map in an earlier map's frame, so that what was drawn on the earlier one stays valid."""

from __future__ import annotations

from dataclasses import replace

from mapmeld.grid import OccupancyGrid, resample
from mapmeld.merging import lattice_for_all
from mapmeld.se2 import Pose2


def rebase(
    new: OccupancyGrid, old: OccupancyGrid, T_old_new: Pose2, *, lattice: bool = False
) -> OccupancyGrid:
    """Return the later map in the earlier one's frame.

    Parameters
    ----------
    new, old
        The later and the earlier map.
    T_old_new
        Takes a point of the later map's frame into the earlier one's.
    lattice
        Leave the cells as they are and change the origin only, exactly (False); or sample the map
        on the earlier one's lattice, extended by whole cells as far as the later map reaches (True):
        then cell lies on cell, and the origin has the earlier map's yaw.

    Raises
    ------
    ResolutionError, MergeError
        On the lattice: cell sizes that cannot both be right; maps too far apart for one lattice.
    """
    if not lattice:
        return replace(new.moved(T_old_new), frame_id=old.frame_id)
    target = lattice_for_all([old, new], [Pose2(), T_old_new])
    return replace(target, cells=resample(new, T_old_new, target), stamp=new.stamp)
