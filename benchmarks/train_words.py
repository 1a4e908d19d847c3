"""Trains the words of the map index on simulated maps, and writes them into the package.

    python benchmarks/train_words.py [--maps 800] [--words 4096] [--seed 7]

The maps are drawn by `synthetic_maps.py`; no map that figures are measured on has a part in it. The
words are the centres of k-means (Lloyd 1982) of the views of their walls.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np
from synthetic_maps import synthetic_maps

import mapmeld.index
from mapmeld.index.signature import VOCABULARY, packed_words
from mapmeld.index.views import wall_views
from mapmeld.matching.correlative.wall_map import Floats

VIEWS_OF_A_MAP = 150
ROUNDS = 10
AT_ONCE = 4000


def main() -> None:
    """Train and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--maps", type=int, default=800)
    parser.add_argument("--words", type=int, default=4096)
    parser.add_argument("--seed", type=int, default=7)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    seen = np.concatenate(
        [wall_views(grid)[:VIEWS_OF_A_MAP] for _, grid in synthetic_maps(options.maps, options.seed)]
    )
    words = centres(seen, options.words, options.seed)
    target = Path(mapmeld.index.__file__).parent / VOCABULARY
    target.write_bytes(packed_words(words))
    print(f"{len(words)} words from {len(seen)} views of {options.maps} maps: {target}")


def centres(seen: Floats, count: int, seed: int) -> Floats:
    """Return the centres of k-means, begun at views drawn at random."""
    rng = np.random.default_rng(seed)
    words = seen[rng.permutation(len(seen))[:count]].copy()
    for _ in range(ROUNDS):
        sums, members = np.zeros(words.shape), np.zeros(count)
        for first in range(0, len(seen), AT_ONCE):
            some = seen[first : first + AT_ONCE]
            nearest = np.argmax(some @ words.T * 2 - np.square(words).sum(axis=1), axis=1)
            np.add.at(sums, nearest, some)
            members += np.bincount(nearest, minlength=count)
        words[members > 0] = (sums[members > 0] / members[members > 0, None]).astype(np.float32)
    return words


if __name__ == "__main__":
    main()
