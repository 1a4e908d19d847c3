"""Which signatures look like one: the cosine of word counts, rare words weighing more."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mapmeld.index.signature import Signature, vocabulary

Doubles = NDArray[np.float64]
Index = NDArray[np.intp]

_LEAST_RARITY = 0.1
"""Keeps words that all maps have: in an index of a few maps these may be all there are."""


class Ranking:
    """Signatures made ready to be compared with others, many at a time.

    Word counts are taken as shares of a map's views, and of them the square root (a place that
    repeats itself counts for less, after Jegou, Douze, Schmid 2009), times the inverse document frequency
    (Sparck Jones 1972) among the signatures given: words that most maps have tell little.

    Parameters
    ----------
    signatures
        Those to choose from.
    """

    def __init__(self, signatures: Sequence[Signature]) -> None:
        starts = np.cumsum([0, *(len(s.words) for s in signatures)])
        words = np.concatenate([np.zeros(0, np.uint16), *(s.words for s in signatures)]).astype(np.intp)
        counts = np.concatenate([np.zeros(0), *(s.counts for s in signatures)]).astype(np.float64)
        self._count = len(signatures)
        owner = np.repeat(np.arange(self._count), np.diff(starts))
        k = len(vocabulary())
        self._rarity = np.log((1 + self._count) / (1 + np.bincount(words, minlength=k))) + _LEAST_RARITY
        value = np.sqrt(counts) * self._rarity[words]
        length = np.sqrt(np.bincount(owner, value**2, self._count))
        value /= np.where(length > 0, length, 1)[owner]
        # By word: a map that is looked for needs its own words only.
        order = np.argsort(words.astype(np.uint16), kind="stable")  # of 16 bits: sorted by radix
        self._owner, self._value = owner[order], value[order].astype(np.float32)
        self._of_word = np.searchsorted(words[order], np.arange(k + 1))

    def scores(self, signature: Signature) -> Doubles:
        """Return how much each of the signatures looks like this one (count,), 0..1."""
        words = signature.words.astype(np.intp)
        value = np.sqrt(signature.counts.astype(np.float64)) * self._rarity[words]
        length = float(np.linalg.norm(value))
        found = np.zeros(self._count)
        for word, weight in zip(words, value / (length or 1.0), strict=True):
            at = slice(self._of_word[word], self._of_word[word + 1])
            found[self._owner[at]] += weight * self._value[at]  # no map twice among the owners of a word
        return found

    def best(self, signature: Signature) -> tuple[Index, Doubles]:
        """Return the numbers of the signatures with words in common with this one, and scores, best first."""
        scores = self.scores(signature)
        order = np.argsort(-scores, kind="stable")
        order = order[scores[order] > 0]
        return order, scores[order]


def likely_pairs(signatures: Sequence[Signature], candidates: int) -> list[tuple[int, int]]:
    """Return pairs (i, j), i < j, in which one map is among so many that look most like the other."""
    ranking = Ranking(signatures)
    pairs = set()
    for i, signature in enumerate(signatures):
        order, _ = ranking.best(signature)
        for j in order[order != i][:candidates]:
            pairs.add((min(i, int(j)), max(i, int(j))))
    return sorted(pairs)
