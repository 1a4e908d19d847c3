"""The paper's map matching, every step of section 2.1 as a public function.

preprocess -> corners -> alphabet -> compare -> candidates -> best; `algorithm2` is the page
that runs them.
"""

from mapmeld.matching.alphabet.algorithm2 import MapMatching, map_matching, match_alphabet
from mapmeld.matching.alphabet.candidates import Candidate, select_candidates
from mapmeld.matching.alphabet.comparison import compare_alphabets
from mapmeld.matching.alphabet.corners import extract_corners
from mapmeld.matching.alphabet.fitting import (
    Fitting,
    align,
    best_matching_points,
)
from mapmeld.matching.alphabet.letters import Alphabet, generate_alphabet, greatest_distance
from mapmeld.matching.alphabet.parameters import AlphabetParameters
from mapmeld.matching.alphabet.preprocessing import (
    blur_clutter,
    preprocess,
    thicken_walls,
    thin_walls,
)
from mapmeld.matching.drawn_walls import binarise, black_pixels, jaccard_similarity
from mapmeld.matching.lattices import in_metres

__all__ = [
    "Alphabet",
    "AlphabetParameters",
    "Candidate",
    "Fitting",
    "MapMatching",
    "align",
    "best_matching_points",
    "binarise",
    "black_pixels",
    "blur_clutter",
    "compare_alphabets",
    "extract_corners",
    "generate_alphabet",
    "greatest_distance",
    "in_metres",
    "jaccard_similarity",
    "map_matching",
    "match_alphabet",
    "preprocess",
    "select_candidates",
    "thicken_walls",
    "thin_walls",
]
