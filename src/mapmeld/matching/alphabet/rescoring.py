"""The paper's similarity under a transform that was found earlier, on other states of the maps."""

from __future__ import annotations

from mapmeld.grid import OccupancyGrid, at_resolution
from mapmeld.matching.alphabet.parameters import AlphabetParameters
from mapmeld.matching.alphabet.preprocessing import preprocess
from mapmeld.matching.drawn_walls import black_pixels, jaccard_similarity
from mapmeld.matching.lattices import in_pixels
from mapmeld.se2 import Pose2


def similarity_at(a: OccupancyGrid, b: OccupancyGrid, T_a_b: Pose2, parameters: AlphabetParameters) -> float:
    """Return the Jaccard similarity (paper, section 2.1.6) of the preprocessed maps under a transform.

    Measured as `match_alphabet` does: both maps at the coarser resolution, black on the pixel in
    which the centre falls.
    """
    coarser = max(a.resolution, b.resolution)
    map_1, map_2 = at_resolution(a, coarser), at_resolution(b, coarser)
    alpha_1, alpha_2 = (preprocess(grid, parameters.median_px) for grid in (map_1, map_2))
    return jaccard_similarity(alpha_1, black_pixels(alpha_2), in_pixels(T_a_b, map_1, map_2))
