"""Whether a robot's new map is a later state of the one before, or its mapping has started anew."""

from __future__ import annotations

import math

import cv2
import numpy as np

from mapmeld.grid import Mask, OccupancyGrid

KEPT_AREA = 0.5
"""Share of what a map shows that its later states show in the same place, at least;"""

KEPT_WALLS = 0.4
"""and of its walls, to within `NEAR`.

By chance, in a frame of its own, a fifth of them is, and never more than a third in thousands of frames; real
mapping, loops that close included, keeps three quarters from one state to one much later.
"""

NEAR = 0.3
"""Distance [m] by which a later state may move a wall: closing a loop moves parts of a map."""

_SAMPLES = 20_000  # cells that are looked at: 0.4 percent exact, and quick for any size of map


def started_anew(before: OccupancyGrid, now: OccupancyGrid) -> str | None:
    """Return in words by what a new map shows that its mapping has started anew; None if it does not.

    A map that grows, is corrected or gets another origin still shows most of what it showed in the same
    place of its frame. One that has started anew in another frame does not.
    """
    if before.frame_id != now.frame_id:
        return f"its frame is {now.frame_id!r} now, not {before.frame_id!r}"
    if before.resolution != now.resolution:
        return f"its cells are {now.resolution:g} m now, not {before.resolution:g} m"
    area = _share(before, before.known, now, now.known)
    if area < KEPT_AREA:
        return f"only {100 * area:.0f} % of what its map showed is there now"
    reach = 2 * math.ceil(NEAR / now.resolution) + 1
    near = cv2.dilate(now.occupied.view(np.uint8), np.ones((reach, reach), np.uint8)).view(np.bool_)
    walls = _share(before, before.occupied, now, near)
    if walls < KEPT_WALLS:
        return f"only {100 * walls:.0f} % of its walls are where they were"
    return None


def _share(before: OccupancyGrid, cells: Mask, now: OccupancyGrid, there: Mask) -> float:
    """Return the share of some cells (rows, cols) of a map that lie where `there` of the later one holds."""
    every = np.flatnonzero(cells)
    if not every.size:
        return 1.0
    # Evenly over the cells that count, not over the lattice, whose unknown border would thin them out.
    chosen = every[np.linspace(0, every.size - 1, min(_SAMPLES, every.size)).astype(np.int64)]
    rows, cols = np.divmod(chosen, before.shape[1])
    centres = before.lattice_to_metres(np.stack([cols, rows], axis=-1) + 0.5)
    u, v = np.floor(now.metres_to_lattice(centres)).astype(np.int64).T
    inside = (u >= 0) & (u < now.shape[1]) & (v >= 0) & (v < now.shape[0])
    return float(np.count_nonzero(there[v[inside], u[inside]])) / len(chosen)
