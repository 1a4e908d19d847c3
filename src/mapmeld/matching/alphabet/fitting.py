"""Step 6, the best matching points (paper, section 2.1.6): try every candidate on the maps."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np

from mapmeld.matching.alphabet.candidates import Candidate
from mapmeld.matching.alphabet.corners import Points
from mapmeld.matching.alphabet.preprocessing import BLACK, Image
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


def black_pixels(image: Image) -> Points:
    """Return the centres (col, row) + 0.5 of an image's black pixels, shape (n, 2) [px]."""
    rows, cols = np.divmod(np.flatnonzero(image == BLACK), max(image.shape[1], 1))
    return np.stack([cols, rows]).T + 0.5


def jaccard_similarity(image_1: Image, black_2_px: Points, T_1_2_px: Pose2) -> float:
    """Return the black pixels that both maps share / the black pixels of either (Jaccard 1912).

    Each black pixel of map 2 is carried to the pixel of map 1 in which its centre falls. This counts
    what a rotation of the whole image would, to about 0.01, at the cost of the walls only.
    Pixels that fall outside map 1 belong to the union.
    """
    x, y = black_2_px.T
    c, s = math.cos(T_1_2_px.theta), math.sin(T_1_2_px.theta)
    height, width = image_1.shape
    col, row = c * x - s * y + T_1_2_px.x, s * x + c * y + T_1_2_px.y
    inside = (col >= 0) & (col < width) & (row >= 0) & (row < height)
    pixel = row[inside].astype(np.intp) * width + col[inside].astype(np.intp)
    black_1 = image_1.size - cv2.countNonZero(image_1) if image_1.size else 0
    shared = min(int(np.count_nonzero(image_1.ravel()[pixel] == BLACK)), black_1)
    union = black_1 + len(black_2_px) - shared
    return shared / union if union else 0.0


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
