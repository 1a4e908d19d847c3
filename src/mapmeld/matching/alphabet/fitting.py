"""Step 6, the best matching points (paper, section 2.1.6): try every candidate on the maps."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from mapmeld.matching.alphabet.candidates import Candidate
from mapmeld.matching.alphabet.corners import Points
from mapmeld.matching.drawn_walls import Image, black_pixels, jaccard_similarity
from mapmeld.se2 import Pose2, rigid_through


@dataclass(frozen=True, slots=True)
class Fitting:
    """One candidate tried on the maps.

    Attributes
    ----------
    T_1_2_px
        Takes lattice positions (col, row) [px] of map 2 to those of map 1.
    similarity
        Jaccard similarity sigma of the black pixels under it, 0..1.
    candidate
        The matching points that it came from.
    """

    T_1_2_px: Pose2
    similarity: float
    candidate: Candidate


def align(candidate: Candidate, corners_1_px: Points, corners_2_px: Points) -> Pose2:
    """Return the rotation and translation that lay the candidate's two corners on one another [px].

    The two distances may differ by epsilon; the difference is shared between both ends.
    """
    (i, z), (j, k) = candidate.first, candidate.second
    return rigid_through(corners_2_px[z], corners_2_px[k], corners_1_px[i], corners_1_px[j])


def best_matching_points(
    candidates: Iterable[Candidate],
    image_1: Image,
    image_2: Image,
    corners_1_px: Points,
    corners_2_px: Points,
) -> tuple[Fitting, ...]:
    """Return every distinct fitting of the candidates, the greatest similarity first.

    The first of them is the paper's answer, Phi and Sigma in Algorithm 2.
    """
    black_2 = black_pixels(image_2)
    fittings: dict[Pose2, Fitting] = {}
    for candidate in candidates:
        T_1_2_px = align(candidate, corners_1_px, corners_2_px)
        if T_1_2_px not in fittings:
            similarity = jaccard_similarity(image_1, black_2, T_1_2_px)
            fittings[T_1_2_px] = Fitting(T_1_2_px, similarity, candidate)
    return tuple(sorted(fittings.values(), key=lambda fitting: -fitting.similarity))
