"""Step 5, candidates for matching points (paper, section 2.1.5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmeld.matching.alphabet.letters import ROUNDING, Alphabet


@dataclass(frozen=True, slots=True)
class Candidate:
    """Two corners of map 1 and the two corners of map 2 that they may be.

    Attributes
    ----------
    first
        (i, z): corner i of map 1 is taken for corner z of map 2; phi_a1 in the paper.
    second
        (j, k): likewise; phi_a2. The distance i-j equals the distance z-k within epsilon.
    votes
        (gamma[i, z], gamma[j, k]).
    """

    first: tuple[int, int]
    second: tuple[int, int]
    votes: tuple[int, int]


def _distance_table(alphabet: Alphabet) -> NDArray[np.float64]:
    table = np.full((len(alphabet.corners_px),) * 2, np.nan)
    table[alphabet.letter, alphabet.other] = alphabet.distance_px
    return table


def select_candidates(
    gamma: NDArray[np.int64],
    first: Alphabet,
    second: Alphabet,
    number: int,
    distance_tolerance_px: float,
) -> tuple[Candidate, ...]:
    """Return at most `number` candidates, most votes first.

    First points are the greatest entries of gamma, each used once; entries of 0 are no
    candidates. The second point of each is the greatest entry (j, k) of gamma for which i-j
    and z-k are relations of similar length. Equal entries are taken in row order, so
    the answer does not depend on chance.
    """
    candidates: list[Candidate] = []
    distance_1, distance_2 = _distance_table(first), _distance_table(second)
    for position in np.argsort(-gamma, axis=None, kind="stable"):
        i, z = (int(n) for n in divmod(int(position), gamma.shape[1]))
        if len(candidates) == number or gamma[i, z] == 0:
            break
        # Not-a-number (no relation) compares false.
        similar = np.abs(distance_1[i][:, None] - distance_2[z][None, :]) <= distance_tolerance_px + ROUNDING
        votes = np.where(similar, gamma, 0)
        j, k = (int(n) for n in divmod(int(votes.argmax()), gamma.shape[1]))
        if votes[j, k] > 0:
            candidates.append(Candidate((i, z), (j, k), (int(gamma[i, z]), int(gamma[j, k]))))
    return tuple(candidates)
