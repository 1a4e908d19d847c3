"""Step 4, comparison of the letters of two alphabets (paper, section 2.1.4).

``gamma[i, z]`` counts in how many ways two relations j, y of letter i in map 1 find two relations
k, q of letter z in map 2 with d_ij = d_zk and d_iy = d_zq (within epsilon) and the angle from
j to y equal to the angle from k to q (within nu). Each combination {j -> k, y -> q} counts once.

Angles are signed. An unsigned angle is the same in a mirror, so with it a map and its mirror
image, which no rotation can lay on one another, would share letters.

Signed angles also make the count cheap: angle(j, y) = angle(k, q) says that the two
correspondences j -> k and y -> q turn map 1 by the same rotation. So per pair of letters it is
enough to sort the rotations of the correspondences of equal length and to count neighbours.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapmeld.matching.alphabet.letters import ROUNDING, Alphabet

_TURN = 2 * np.pi
# Correspondences handled at a time: what fits into the cache is sorted fastest, and memory is bounded.
_CHUNK = 1 << 17


def compare_alphabets(
    first: Alphabet, second: Alphabet, distance_tolerance_px: float, angle_tolerance: float
) -> NDArray[np.int64]:
    """Return the matrix gamma of shape (letters of first, letters of second).

    Parameters
    ----------
    distance_tolerance_px
        epsilon [px].
    angle_tolerance
        nu [rad], less than pi / 2.
    """
    epsilon, nu = distance_tolerance_px + ROUNDING, angle_tolerance + ROUNDING
    n1, n2 = len(first.corners_px), len(second.corners_px)
    gamma = np.zeros(n1 * n2, np.int64)
    by_distance = np.argsort(second.distance_px, kind="stable")
    low, high = _ranges(
        second.distance_px[by_distance], first.distance_px - epsilon, first.distance_px + epsilon
    )
    letters_per_chunk = max(1, _CHUNK * n1 // max(int((high - low).sum()), 1))
    for letter in range(0, n1, letters_per_chunk):
        start, stop = np.searchsorted(first.letter, (letter, letter + letters_per_chunk))
        r1, position = _expand_ranges(low[start:stop], high[start:stop])
        r1, r2 = r1 + start, by_distance[position]
        gamma += _count_equal_rotations(
            pair=first.letter[r1] * n2 + second.letter[r2],
            rotation=(second.bearing[r2] - first.bearing[r1]) % _TURN,
            nu=nu,
            pairs=n1 * n2,
        )
    # A combination needs two different relations on either side.
    return (
        gamma.reshape(n1, n2)
        - _count_relations_used_twice(first, second, epsilon, nu)
        - _count_relations_used_twice(second, first, epsilon, nu).T
    )


def _ranges(
    line: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return where in the sorted `line` the values in [low, high] start and stop."""
    start = np.searchsorted(line, low, side="left")
    return start, np.maximum(np.searchsorted(line, high, side="right"), start)


def _expand_ranges(
    start: NDArray[np.intp], stop: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return (owner, member) of every whole number in the half-open ranges [start, stop)."""
    length = stop - start
    owner = np.repeat(np.arange(len(start)), length)
    shift = np.repeat(start - (np.cumsum(length) - length), length)
    return owner, shift + np.arange(len(owner))


def _count_equal_rotations(
    pair: NDArray[np.intp], rotation: NDArray[np.float64], nu: float, pairs: int
) -> NDArray[np.int64]:
    """Count, per pair of letters, the couples of correspondences whose rotations agree within nu."""
    # One sort for all: every pair of letters gets its own stretch of a line, wider than a turn.
    # It starts a little inside, so that rounding moves no key into the stretch before.
    stretch = 2 * _TURN
    key = pair * stretch + rotation + 1.0
    # The circle closes: what lies within nu past zero is also a turn further on.
    across = np.sort(key[rotation <= nu]) + _TURN
    late = key[rotation >= _TURN - nu]
    partners = np.searchsorted(across, late + nu, side="right") - np.searchsorted(across, late)
    counts = np.bincount((late // stretch).astype(np.intp), partners, pairs).astype(np.int64)
    key.sort()
    ahead = 1
    first = np.flatnonzero(key[1:] - key[:-1] <= nu)
    while len(first):
        counts += np.bincount((key[first] // stretch).astype(np.intp), minlength=pairs)
        ahead += 1
        first = first[first < len(key) - ahead]
        first = first[key[first + ahead] - key[first] <= nu]
    return counts


def _count_relations_used_twice(one: Alphabet, two: Alphabet, epsilon: float, nu: float) -> NDArray[np.int64]:
    """Count, per pair of letters, the couples {j -> k, j -> q} that use a relation of `one` twice.

    They need two corners k, q of `two` that look nearly the same from a letter: neighbours, so few.
    """
    n1, n2 = len(one.corners_px), len(two.corners_px)
    counts = np.zeros((n1, n2), np.int64)
    if not (len(one.letter) and len(two.letter)):
        return counts
    distance, bearing = np.full((2, n2, n2), np.nan)
    distance[two.letter, two.other] = two.distance_px
    bearing[two.letter, two.other] = two.bearing
    reach = 2 * epsilon + nu * float(two.distance_px.max())
    from scipy.spatial import KDTree  # takes longer to import than most matches take

    k, q = KDTree(two.corners_px).query_pairs(reach, output_type="ndarray").T
    turn = np.abs((bearing[:, k] - bearing[:, q] + np.pi) % _TURN - np.pi)
    z, twin = np.nonzero((np.abs(distance[:, k] - distance[:, q]) <= 2 * epsilon) & (turn <= nu))
    d_k, d_q = distance[z, k[twin]], distance[z, q[twin]]
    order = np.argsort(one.distance_px, kind="stable")
    start, stop = _ranges(
        one.distance_px[order], np.maximum(d_k, d_q) - epsilon, np.minimum(d_k, d_q) + epsilon
    )
    owner, position = _expand_ranges(start, stop)
    np.add.at(counts, (one.letter[order[position]], z[owner]), 1)
    return counts
