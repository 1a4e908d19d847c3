"""Trains the words of the map index on simulated maps, and writes them into the package.

    python benchmarks/train_words.py [--maps 400] [--words 3072 1024] [--seed 7]

The maps are drawn by `synthetic_maps.py`; no map that figures are measured on has a part in it. The
words are the centres of k-means (Lloyd 1982) of the views of their walls.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np
from scipy.sparse import coo_matrix
from synthetic_maps import synthetic_maps

import mapmeld.index
from mapmeld.index.signature import VOCABULARY, nearest_word, packed_words
from mapmeld.index.views import wall_views
from mapmeld.matching.correlative.wall_map import Floats

VIEWS_OF_A_MAP = 150
ROUNDS = 10
AT_ONCE = 4000


def main() -> None:
    """Train and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--maps", type=int, default=400)
    parser.add_argument("--words", type=int, nargs=2, default=(3072, 1024), help="of near and of wide views")
    parser.add_argument("--seed", type=int, default=7)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    views = [wall_views(grid).seen for _, grid in synthetic_maps(options.maps, options.seed)]
    for name, of_reach, count in zip(VOCABULARY, zip(*views, strict=True), options.words, strict=True):
        seen = np.concatenate([some[:VIEWS_OF_A_MAP] for some in of_reach])
        words = centres(seen, count, options.seed)
        target = Path(mapmeld.index.__file__).parent / name
        target.write_bytes(packed_words(words))
        print(f"{len(words)} words from {len(seen)} views of {options.maps} maps: {target}", flush=True)


def centres(seen: Floats, count: int, seed: int) -> Floats:
    """Return the centres of k-means, begun at views drawn at random."""
    rng = np.random.default_rng(seed)
    words = seen[rng.permutation(len(seen))[:count]].copy()
    for _ in range(ROUNDS):
        sums, members = np.zeros(words.shape), np.zeros(count)
        for first in range(0, len(seen), AT_ONCE):
            some = seen[first : first + AT_ONCE]
            nearest = nearest_word(some, words)
            sums += (
                coo_matrix((np.ones(len(some)), (nearest, np.arange(len(some)))), (count, len(some))) @ some
            )
            members += np.bincount(nearest, minlength=count)
        words[members > 0] = (sums[members > 0] / members[members > 0, None]).astype(np.float32)
    return words


if __name__ == "__main__":
    main()
