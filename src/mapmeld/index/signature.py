"""The signature of a map: which words, and how often, describe what its walls look like.

A bag of words (Sivic, Zisserman 2003): every view of a wall counts for the word nearest to it. Where
things lie is left out, so two maps that share a part
of a place share the words of that part, however each of them is turned, moved, cut or sampled.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from mapmeld.grid import OccupancyGrid
from mapmeld.index import views
from mapmeld.index.views import SIZE, wall_views
from mapmeld.matching.correlative.wall_map import Floats

VOCABULARY = "words.bin"
"""File of the words (k, SIZE) in the package, a byte for each number, by `benchmarks/train_words.py`."""

_METHOD = 1  # changes with the code of this module and of `views`


@dataclass(frozen=True, slots=True, eq=False)
class Signature:
    """Which words describe a map, and by how many views each.

    Attributes
    ----------
    words
        uint16 (n,), growing.
    counts
        uint16 (n,), above 0: views that look like the word.
    """

    words: NDArray[np.uint16]
    counts: NDArray[np.uint16]


def signature_of(grid: OccupancyGrid) -> Signature:
    """Describe a map; one without walls has no words."""
    return describe(wall_views(grid), vocabulary())


def describe(seen: Floats, words: Floats) -> Signature:
    """Count views (n, SIZE) for the nearest of the words (k, SIZE)."""
    if not len(seen):
        return Signature(np.zeros(0, np.uint16), np.zeros(0, np.uint16))
    # Less the squared length of the view, which is the same for all words.
    nearest = np.argmax(seen @ words.T * 2 - np.square(words).sum(axis=1), axis=1)
    found, counts = np.unique(nearest, return_counts=True)
    return Signature(found.astype(np.uint16), counts.astype(np.uint16))


@cache
def vocabulary() -> Floats:
    """Return the words (k, SIZE), views that stand for all that look like them."""
    return words_from(_packed())


def words_from(packed: bytes) -> Floats:
    """Undo `packed_words`."""
    return np.frombuffer(packed, np.uint8).reshape(-1, SIZE).astype(np.float32) / np.float32(255)


def packed_words(words: Floats) -> bytes:
    """Return words (k, SIZE), all of 0..1, as they are stored: a byte for each number."""
    return np.rint(words * 255).astype(np.uint8).tobytes()


def _packed() -> bytes:
    return (files("mapmeld.index") / VOCABULARY).read_bytes()


@cache
def signature_version() -> str:
    """Return a text that differs as soon as signatures would: those of two versions do not compare."""
    how = (_METHOD, views.RINGS, views.SECTORS, views.MOST)
    return hashlib.blake2b(repr(how).encode() + _packed(), digest_size=8).hexdigest()
