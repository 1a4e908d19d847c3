"""The signature of a map: which words, and how much wall of each, describe what its walls look like.

A bag of words (Sivic, Zisserman 2003): every view of a wall counts for the word nearest to it, by the length
of wall that it stands for. Where things lie is left out, so two maps that share a part
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
from mapmeld.index.views import REACHES, SIZE, Views, wall_views
from mapmeld.matching.correlative.wall_map import Doubles, Floats
from mapmeld.matching.per_map import PerMap

VOCABULARY = ("near_words.bin", "wide_words.bin")
"""Files of the words (k, SIZE) of each reach, a byte for each number, by `benchmarks/train_words.py`."""

_METHOD = 2  # changes with the code of this module and of `views`


@dataclass(frozen=True, slots=True, eq=False)
class Signature:
    """How much of a map looks like each word.

    Attributes
    ----------
    weights
        uint8 (`word_count()`,): square roots of the shares of wall, 255 being all of it (a place that
        repeats itself counts for less, after Jegou, Douze, Schmid 2009), for the words of one reach
        after the other; all 0 without walls.
    """

    weights: NDArray[np.uint8]


@PerMap
def signature_of(grid: OccupancyGrid) -> Signature:
    """Describe a map; one without walls has no words."""
    return describe(wall_views(grid), vocabulary())


def describe(views_: Views, words: tuple[Floats, ...]) -> Signature:
    """Count views for the nearest of the words (k, SIZE) of their reach."""
    parts = [_shares(seen, views_.metres, some) for seen, some in zip(views_.seen, words, strict=True)]
    return Signature(np.rint(255 * np.sqrt(np.concatenate(parts))).astype(np.uint8))


def _shares(seen: Floats, metres: Floats, words: Floats) -> Doubles:
    nearest = nearest_word(seen, words)
    # Without anything in reach a view has no length, and no word.
    lengths = np.bincount(nearest, metres * seen.any(axis=1), len(words))
    return np.asarray(lengths / (lengths.sum() or 1.0))


def nearest_word(seen: Floats, words: Floats) -> NDArray[np.intp]:
    """Return which of the words (k, SIZE) is nearest to each view (n, SIZE)."""
    # Less the squared length of the view, which is the same for all words.
    return np.asarray(np.argmax(seen @ words.T * 2 - np.square(words).sum(axis=1), axis=1))


@cache
def vocabulary() -> tuple[Floats, ...]:
    """Return for each reach the words (k, SIZE), views that stand for all that look like them."""
    return tuple(words_from(packed) for packed in _packed())


@cache
def word_count() -> int:
    """Return how many words there are."""
    return sum(map(len, _packed())) // SIZE


def words_from(packed: bytes) -> Floats:
    """Undo `packed_words`."""
    return np.frombuffer(packed, np.uint8).reshape(-1, SIZE).astype(np.float32) / np.float32(255)


def packed_words(words: Floats) -> bytes:
    """Return words (k, SIZE), all of 0..1, as they are stored: a byte for each number."""
    return np.rint(words * 255).astype(np.uint8).tobytes()


@cache
def _packed() -> tuple[bytes, ...]:
    return tuple((files("mapmeld.index") / name).read_bytes() for name in VOCABULARY)


@cache
def signature_version() -> str:
    """Return a text that differs as soon as signatures would: those of two versions do not compare."""
    how = (_METHOD, REACHES, views.SECTORS, views.MOST)
    return hashlib.blake2b(repr(how).encode() + b"".join(_packed()), digest_size=8).hexdigest()
