"""Which signatures look like one: the cosine of word weights, rare words weighing more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmeld.index.signature import Signature, word_count

Doubles = NDArray[np.float64]
Index = NDArray[np.intp]

_LEAST_RARITY = 0.1
"""Keeps words that all maps have: in an index of a few maps these may be all there are."""


@dataclass(frozen=True, slots=True, eq=False)
class Ranking:
    """Signatures side by side, ready to be compared with others.

    Weights are multiplied with the inverse document frequency (Sparck Jones 1972) of their words among the
    signatures: words that most maps have tell little.

    Attributes
    ----------
    weights
        uint8 (rows, n): a row for each word that is at hand.
    rows
        Index (words,): which row is a word's; -1 if it is not at hand. A map that is looked for needs its own
        words' only.
    owners
        uint32 (words,): how many of the signatures have a word.
    lengths
        float32 (n,): Euclidean lengths of the weights times the rarities.
    """

    weights: NDArray[np.uint8]
    rows: Index
    owners: NDArray[np.uint32]
    lengths: NDArray[np.float32]

    @classmethod
    def of(cls, signatures: Sequence[Signature]) -> Ranking:
        """Make signatures ready."""
        weights = np.zeros((word_count(), len(signatures)), np.uint8)
        for n, signature in enumerate(signatures):
            weights[:, n] = signature.weights
        owners = np.count_nonzero(weights, axis=1).astype(np.uint32)
        squares = np.square(_rarity(owners, len(signatures)))
        squared = np.zeros(len(signatures))
        for row, square in zip(weights, squares, strict=True):
            squared += np.square(row.astype(np.float64)) * square
        return cls(weights, np.arange(word_count()), owners, np.sqrt(squared).astype(np.float32))

    @property
    def count(self) -> int:
        """How many signatures there are."""
        return len(self.lengths)

    def signature(self, number: int) -> Signature:
        """Return one of the signatures.

        Raises
        ------
        ValueError
            Not all words are at hand.
        """
        return Signature(np.ascontiguousarray(self.weights[self.rows_of(np.arange(len(self.rows))), number]))

    def scores(self, signature: Signature) -> Doubles:
        """Return how much each of the signatures looks like this one (count,), 0..1.

        Raises
        ------
        ValueError
            It has words that are not at hand.
        """
        words = np.flatnonzero(signature.weights)
        rows = self.rows_of(words)
        rarity = _rarity(self.owners, self.count)[words]
        value = signature.weights[words] * rarity
        length = float(np.linalg.norm(value))
        found = np.zeros(self.count)
        for row, weight in zip(rows, value * rarity / (length or 1.0), strict=True):
            found += weight * self.weights[row]
        # At most 1 by its nature; a forged file may say otherwise.
        return np.minimum(found / np.where(self.lengths > 0, self.lengths, np.inf), 1.0)

    def rows_of(self, words: Index) -> Index:
        """Return the rows of words.

        Raises
        ------
        ValueError
            One is not at hand.
        """
        rows = self.rows[words]
        if (rows < 0).any():
            raise ValueError("this index was read for another signature, without all words of this one")
        return rows

    def best(self, signature: Signature) -> tuple[Index, Doubles]:
        """Return the numbers of the signatures with words in common with this one, and scores, best first."""
        scores = self.scores(signature)
        order = np.argsort(-scores, kind="stable")
        order = order[scores[order] > 0]
        return order, scores[order]


def _rarity(owners: NDArray[np.uint32], count: int) -> Doubles:
    return np.asarray(np.log((1 + count) / (1 + owners.astype(np.float64))) + _LEAST_RARITY)


def likely_pairs(signatures: Sequence[Signature], candidates: int) -> list[tuple[int, int]]:
    """Return pairs (i, j), i < j, in which one map is among so many that look most like the other."""
    ranking = Ranking.of(signatures)
    pairs = set()
    for i, signature in enumerate(signatures):
        order, _ = ranking.best(signature)
        for j in order[order != i][:candidates]:
            pairs.add((min(i, int(j)), max(i, int(j))))
    return sorted(pairs)
