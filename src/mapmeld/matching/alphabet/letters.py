"""Step 3, the alphabet (paper, section 2.1.3): every corner becomes a letter.

A letter is a corner together with its relations: the distances to the other corners of its map
that are neither too near nor too far, and the angles between all pairs of those relations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmeld.matching.alphabet.corners import Points

ROUNDING = 1e-9
"""Distances [px] and angles [rad] are compared with this slack, so that values that equal a bound on
paper still do after rounding, whatever frame they were computed in."""


@dataclass(frozen=True, slots=True)
class Alphabet:
    """The letters of one map. Relation r belongs to letter ``letter[r]``.

    Attributes
    ----------
    corners_px
        (n, 2) corners (col, row), y up; letter i sits on corner i.
    letter, other
        (r,) indices: the relation goes from corner ``letter`` to corner ``other``.
    distance_px
        (r,) length d of the relation, between D_min and D_max.
    bearing
        (r,) direction of the relation [rad], counter-clockwise from the lattice's x axis.
        The angle between two relations of a letter is the difference of their bearings.
    """

    corners_px: Points
    letter: NDArray[np.intp]
    other: NDArray[np.intp]
    distance_px: NDArray[np.float64]
    bearing: NDArray[np.float64]

    def angles(self, letter: int) -> NDArray[np.float64]:
        """Return the signed angles [rad] in (-pi, pi] between all pairs of relations of one letter.

        Entry (j, y) of the (t, t) array turns relation j counter-clockwise onto relation y.
        """
        bearing = self.bearing[self.letter == letter]
        turn = bearing[None, :] - bearing[:, None]
        return np.asarray(np.pi - (np.pi - turn) % (2 * np.pi))


def _distances(corners_px: Points) -> NDArray[np.float64]:
    between = corners_px[None, :, :] - corners_px[:, None, :]
    return np.hypot(between[..., 0], between[..., 1])


def greatest_distance(corners_px: Points) -> float:
    """Return the greatest distance [px] among corners (n, 2); 0 for fewer than two."""
    return float(_distances(corners_px).max()) if len(corners_px) else 0.0


def generate_alphabet(corners_px: Points, relation_min_px: float, relation_max_px: float) -> Alphabet:
    """Relate every corner to the others with D_min <= d <= D_max (Expression 2).

    Parameters
    ----------
    corners_px
        (n, 2) corners (col, row) [px].
    relation_min_px, relation_max_px
        D_min and D_max [px]; D_max < D_min leaves letters without relations.
    """
    distance = _distances(corners_px)
    related = (distance >= relation_min_px - ROUNDING) & (distance <= relation_max_px + ROUNDING)
    np.fill_diagonal(related, False)
    letter, other = np.nonzero(related)
    step = corners_px[other] - corners_px[letter]
    return Alphabet(
        corners_px=corners_px,
        letter=letter,
        other=other,
        distance_px=distance[letter, other],
        bearing=np.arctan2(step[:, 1], step[:, 0]),
    )
