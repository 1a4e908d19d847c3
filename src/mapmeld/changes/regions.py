"""Changed cells that belong together: what a person would call one change."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import find_objects, label
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from mapmeld.changes.classes import Change, Classes
from mapmeld.changes.outlines import outline
from mapmeld.grid import Mask, OccupancyGrid

Kind = Literal["appeared", "vanished"]

KINDS: dict[Kind, Change] = {"appeared": Change.APPEARED, "vanished": Change.VANISHED}


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """One change: obstacle cells that appeared or vanished together. All in the earlier map's frame.

    Attributes
    ----------
    kind
        "appeared" or "vanished".
    area_m2
        Area of the changed cells. A laser sees the outside of things: of a cabinet it is that of its sides.
    centroid
        (x, y) of the changed cells [m].
    bounds
        (least x, least y, greatest x, greatest y) of the outline [m].
    outline
        Corners (n, 2) [m] of a simple polygon around the changed cells, counter-clockwise, the first not
        repeated. It takes in what they enclose, and joins parts (the legs of a table) by a strip.
    """

    kind: Kind
    area_m2: float
    centroid: tuple[float, float]
    bounds: tuple[float, float, float, float]
    outline: NDArray[np.float64]


def find_regions(
    classes: Classes, lattice: OccupancyGrid, min_area: float, gap: float
) -> tuple[tuple[Region, ...], Classes]:
    """Group the changed cells; what is too small to be a change is none.

    Parameters
    ----------
    classes, lattice
        A `Change` for each cell, and the lattice that they lie on; its cells are not read.
    min_area
        Changed area [m^2] below which a group is speckle; a single cell always is.
    gap
        Changed cells of one kind with at most this [m] between them, from centre to centre, belong together.

    Returns
    -------
    tuple of Region
        The greatest first.
    Classes
        As given, but with `Change.SAME` in place of speckle.
    """
    found: list[Region] = []
    cleaned = classes.copy()
    reach = gap / lattice.resolution
    # A hair less, lest rounding decide about an area that is exactly the least.
    least = max(min_area / lattice.resolution**2 - 1e-6, 2)
    for kind, change in KINDS.items():
        for corner, cells in _groups(classes == change, reach):
            count = int(np.count_nonzero(cells))
            if count < least:
                row, col = np.nonzero(cells)
                cleaned[row + corner[1], col + corner[0]] = Change.SAME
            else:
                found.append(_region(kind, cells, corner, lattice, reach))
    found.sort(key=lambda region: (-region.area_m2, region.kind, region.centroid))
    return tuple(found), cleaned


def _region(kind: Kind, cells: Mask, corner: tuple[int, int], lattice: OccupancyGrid, reach: float) -> Region:
    rows, cols = np.nonzero(cells)
    middle = lattice.lattice_to_metres(np.array([cols.mean(), rows.mean()]) + 0.5 + corner)
    ring = lattice.lattice_to_metres(outline(_joined(cells, reach)) + corner)
    low, high = ring.min(axis=0), ring.max(axis=0)
    return Region(
        kind=kind,
        area_m2=len(rows) * lattice.resolution**2,
        centroid=(float(middle[0]), float(middle[1])),
        bounds=(float(low[0]), float(low[1]), float(high[0]), float(high[1])),
        outline=ring,
    )


def _groups(mask: Mask, reach: float) -> Iterator[tuple[tuple[int, int], Mask]]:
    """Yield (col, row) of the lower left corner and the cells of each group, cut out."""
    parts, count = label(mask)
    if not count:
        return
    links = _links(parts, reach)
    graph = coo_array((np.ones(len(links)), (links[:, 0] - 1, links[:, 1] - 1)), shape=(count, count))
    _, group_of = connected_components(graph, directed=False)
    groups = np.append(0, group_of + 1)[parts]
    for number, place in enumerate(find_objects(groups), start=1):
        yield (place[1].start, place[0].start), groups[place] == number


def _links(parts: NDArray[np.signedinteger[Any]], reach: float) -> NDArray[np.intp]:
    """Return the shortest links between neighbouring parts, at most `reach` cells long.

    Parts are neighbours where the places nearest to one meet those nearest to the other.

    Returns
    -------
    (n, 6): the two parts, and (row, col) of the cell of each where the link ends.
    """
    _, nearest = cv2.distanceTransformWithLabels(
        (parts == 0).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    rows, cols = np.nonzero(parts)
    cell_of = np.zeros(len(rows) + 1, np.intp)
    cell_of[nearest[rows, cols]] = rows * parts.shape[1] + cols
    cell = cell_of[nearest]
    part = parts.ravel()[cell]
    ends = []
    for one, other in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        apart = part[one] != part[other]
        ends.append(np.stack([cell[one][apart], cell[other][apart]], axis=1))
    pairs = np.concatenate(ends)
    place = np.stack(np.divmod(pairs, parts.shape[1]), axis=-1)
    length = np.hypot(*(place[:, 0] - place[:, 1]).T)
    near = length <= reach + 1e-6
    pairs, place, length = pairs[near], place[near], length[near]
    between = parts.ravel()[pairs]
    swapped = between[:, 0] > between[:, 1]
    between[swapped], place[swapped] = between[swapped, ::-1], place[swapped, ::-1]
    links = np.concatenate([between, place.reshape(-1, 4)], axis=1).astype(np.intp)
    order = np.lexsort((*links.T[::-1], length, links[:, 1], links[:, 0]))
    links = links[order]
    first = np.append(True, (links[1:, :2] != links[:-1, :2]).any(axis=1))[: len(links)]
    return np.asarray(links[first])


def _joined(cells: Mask, reach: float) -> Mask:
    """Return the cells with strips one cell wide along the links between their parts."""
    parts, count = label(cells)
    if count == 1:
        return cells
    joined = cells.astype(np.uint8)
    for row, col, to_row, to_col in _links(parts, reach)[:, 2:].tolist():
        cv2.line(joined, (col, row), (to_col, to_row), 1, 1, cv2.LINE_4)
    return joined.astype(bool)
