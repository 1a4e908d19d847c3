"""Bending a later map locally onto an earlier one, so that drift is not taken for change.

Two maps of one place never differ by a rigid motion alone: each robot's drift bends its map, by up to
some decimetres over a floor. A tolerance as wide as that would swallow chairs. So the later map
is bent first, as little as the walls ask for: a displacement that is stiff over a few metres
brings walls onto walls, and what moves against its surroundings (furniture) cannot pull it along.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.linalg import spsolve

from mapmeld.grid import Cells, OccupancyGrid, resample
from mapmeld.matching.correlative.alignment import look_up, robust_weights, to_local
from mapmeld.matching.correlative.prepared_map import prepare
from mapmeld.se2 import Pose2

Displacements = NDArray[np.complex128]
"""x + i y [m]."""

# Node spacing [m], tolerance [m] and stiffness (in wall points, ten to the metre) of each step: first what
# bends the whole floor, last what bends a room. Stiff at first, or walls snap to wrong ones.
_STEPS = (
    (8.0, 0.8, 3.0),
    (8.0, 0.8, 3.0),
    (8.0, 0.5, 3.0),
    (4.0, 0.5, 3.0),
    (4.0, 0.5, 3.0),
    (4.0, 0.35, 2.0),
    (4.0, 0.25, 2.0),
    (2.0, 0.25, 1.5),
    (2.0, 0.2, 1.0),
    (2.0, 0.15, 1.0),
    (2.0, 0.15, 1.0),
)
_NO_CELL = 0.01  # of a cell: a displacement that moves nothing
_REST = 1e-3  # weight of "where nothing says otherwise, nothing moves"
_MOST_NODES = 20_000  # very large maps get wider spaced nodes


@dataclass(frozen=True, slots=True, eq=False)
class Bending:
    """A displacement of the later map at every place of the earlier one.

    What the later map shows at ``p - at(p)``, once it is laid down rigidly, belongs at p.

    Attributes
    ----------
    frame
        Pose, in the earlier map's metric frame, of the frame that places and displacements are in.
    corner, spacing
        Place of the first node and distance between nodes [m].
    nodes
        Displacement at each node (rows, cols); linear between them, held at the edge.
    """

    frame: Pose2
    corner: complex
    spacing: float
    nodes: Displacements

    @property
    def greatest(self) -> float:
        """Length of the longest displacement [m]."""
        return float(np.abs(self.nodes).max())

    def at(self, places: Displacements) -> Displacements:
        """Return the displacement at places (...) of `frame`."""
        index, weight = _corners(places, self.corner, self.spacing, self.nodes.shape)
        return np.asarray((self.nodes.ravel()[index] * weight).sum(axis=-1))

    def laid(self, new: OccupancyGrid, T_old_new: Pose2, lattice: OccupancyGrid) -> Cells:
        """Return the cells of the later map, laid down and bent, on a lattice of the earlier map's frame."""
        if self.greatest < _NO_CELL * lattice.resolution:
            return resample(new, T_old_new, lattice)
        T = self.frame.inverse() @ lattice.origin
        turn = cmath.exp(1j * T.theta)

        def displacement(col: NDArray[np.float64], row: NDArray[np.float64]) -> Displacements:
            places = turn * lattice.resolution * (col + 1j * row) + complex(T.x, T.y)
            return self.at(places) / (turn * lattice.resolution)

        return resample(new, T_old_new, lattice, displacement=displacement)


def no_bending() -> Bending:
    """Return the bending that leaves everything where it is."""
    return Bending(Pose2(), 0j, 1.0, np.zeros((2, 2), complex))


def bend_onto(old: OccupancyGrid, new: OccupancyGrid, T_old_new: Pose2, limit: float) -> Bending:
    """Find the displacement that brings the walls of a later map onto those of an earlier one.

    Non-rigid alignment of walls by iteratively reweighted least squares: the distance across the
    nearest wall of the same direction, in both directions, against springs between the nodes of a
    lattice that is refined from 8 m to 2 m.

    Parameters
    ----------
    old, new
        The maps.
    T_old_new
        Takes a point of the later map's frame into the earlier one's, within some decimetres.
    limit
        Longest displacement [m]; 0 bends nothing.
    """
    prepared_old, prepared_new = prepare(old), prepare(new)
    if limit <= 0 or prepared_old is None or prepared_new is None:
        return no_bending()
    a, b = prepared_old.walls, prepared_new.walls
    t = to_local(a, b, T_old_new)[None]
    count = max(len(a.points), len(b.points))
    everything = look_up(a, b, t, count).x[0]
    low = complex(everything.real.min(), everything.imag.min())
    size = complex(everything.real.max(), everything.imag.max()) - low
    widest = math.sqrt(max(size.real, 1.0) * max(size.imag, 1.0) / _MOST_NODES)
    bending = Bending(a.frame, low, 1.0, np.zeros((2, 2), complex))
    for spacing, scale, stiffness in _STEPS:
        spacing = max(spacing, widest)
        bending = _on_nodes(bending, low, size, spacing)
        where = everything.astype(np.complex128)
        # b's points are displaced from where they lie, the field is that of where they come to lie.
        where[: len(b.points)] += bending.at(where[: len(b.points)])
        index, weight = _corners(where, bending.corner, spacing, bending.nodes.shape)
        u = (bending.nodes.ravel()[index] * weight).sum(axis=-1)
        p = look_up(a, b, t, count, u[None].astype(np.complex64))
        r, w = robust_weights(p, scale)
        bending = _step(bending, index, weight, p.normal[0], r[0], w[0], stiffness)
    length = np.abs(bending.nodes)
    held = bending.nodes * np.minimum(1.0, limit / np.maximum(length, 1e-9))
    return replace(bending, nodes=held)


def _on_nodes(bending: Bending, low: complex, size: complex, spacing: float) -> Bending:
    """Return the same bending on a lattice of nodes over the box from `low` on."""
    cols, rows = (max(2, math.ceil(side / spacing) + 1) for side in (size.real, size.imag))
    col, row = np.meshgrid(np.arange(cols), np.arange(rows))
    places = np.asarray(low + spacing * (col + 1j * row), np.complex128)
    return replace(bending, corner=low, spacing=spacing, nodes=bending.at(places))


def _corners(
    places: Displacements, corner: complex, spacing: float, shape: tuple[int, ...]
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return the four nodes (..., 4) around each place, as flat indices, and their weights."""
    rows, cols = shape
    z = (places - corner) / spacing
    x, y = np.clip(z.real, 0, cols - 1), np.clip(z.imag, 0, rows - 1)
    col, row = np.minimum(x.astype(np.intp), cols - 2), np.minimum(y.astype(np.intp), rows - 2)
    fx, fy = x - col, y - row
    first = row * cols + col
    index = np.stack([first, first + 1, first + cols, first + cols + 1], axis=-1)
    weight = np.stack([(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy], axis=-1)
    return index, weight


def _step(
    bending: Bending,
    index: NDArray[np.intp],
    weight: NDArray[np.float64],
    normal: NDArray[np.complex64],
    r: NDArray[np.float32],
    w: NDArray[np.float32],
    stiffness: float,
) -> Bending:
    """One Gauss-Newton step: distances `r` across the walls, weighed by `w`, against the springs."""
    rows, cols = bending.nodes.shape
    points, count = len(r), rows * cols
    root = np.sqrt(w.astype(np.float64))
    row = np.repeat(np.arange(points), 8)
    col = np.concatenate([index, index + count], axis=1)
    value = np.concatenate([weight * normal.real[:, None], weight * normal.imag[:, None]], axis=1)
    J = csr_array(((value * root[:, None]).ravel(), (row, col.ravel())), shape=(points, 2 * count))
    K = _springs(rows, cols, stiffness)
    c = np.concatenate([bending.nodes.real.ravel(), bending.nodes.imag.ravel()])
    c -= spsolve((J.T @ J + K).tocsc(), J.T @ (root * r) + K @ c)
    return replace(bending, nodes=(c[:count] + 1j * c[count:]).reshape(rows, cols))


def _springs(rows: int, cols: int, stiffness: float) -> csr_array:
    """Return the matrix of the energy of springs between neighbouring nodes, for x and then for y."""
    count = rows * cols
    node = np.arange(count).reshape(rows, cols)
    one = np.concatenate([node[:, :-1].ravel(), node[:-1].ravel()])
    other = np.concatenate([node[:, 1:].ravel(), node[1:].ravel()])
    one, other = (np.concatenate([n, n + count]) for n in (one, other))
    diagonal = stiffness * np.bincount(np.concatenate([one, other]), minlength=2 * count) + _REST
    every = np.arange(2 * count)
    pull = np.full(len(one), -stiffness)
    return csr_array(
        (
            np.concatenate([diagonal, pull, pull]),
            (np.concatenate([every, one, other]), np.concatenate([every, other, one])),
        )
    )
