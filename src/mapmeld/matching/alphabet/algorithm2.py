"""The paper's Algorithm 2 on one page, and its answer as a `MatchResult`.

Source: "Map Matching for SLAM with Multiple Robots in Different Moments", section 2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmeld.grid import OccupancyGrid, at_resolution, overlap_share
from mapmeld.matching.alphabet.candidates import Candidate, select_candidates
from mapmeld.matching.alphabet.comparison import compare_alphabets
from mapmeld.matching.alphabet.corners import extract_corners
from mapmeld.matching.alphabet.fitting import Fitting, best_matching_points
from mapmeld.matching.alphabet.letters import Alphabet, generate_alphabet, greatest_distance
from mapmeld.matching.alphabet.parameters import AlphabetParameters
from mapmeld.matching.alphabet.preprocessing import preprocess
from mapmeld.matching.drawn_walls import Image
from mapmeld.matching.lattices import in_metres
from mapmeld.matching.modes import distinct_modes
from mapmeld.matching.result import Alternative, MatchResult, Verdict


@dataclass(frozen=True, slots=True)
class MapMatching:
    """Everything that Algorithm 2 computes, step by step, under the names of its steps."""

    maps: tuple[OccupancyGrid, OccupancyGrid]
    preprocessed: tuple[Image, Image]
    alphabets: tuple[Alphabet, Alphabet]
    gamma: NDArray[np.int64]
    candidates: tuple[Candidate, ...]
    fittings: tuple[Fitting, ...]


def map_matching(a: OccupancyGrid, b: OccupancyGrid, parameters: AlphabetParameters) -> MapMatching:
    """Run Algorithm 2 on two maps, up to its line 11.

    Its last line, the merged map (section 2.1.7), is `mapmeld.merging.merge_aligned`.
    Maps of different resolution are both taken at the coarser one: the finer map's detail
    has no partner in the other.
    """
    p = parameters
    coarser = max(a.resolution, b.resolution)
    map_1, map_2 = at_resolution(a, coarser), at_resolution(b, coarser)

    alpha_1 = preprocess(map_1, p.median_px)
    alpha_2 = preprocess(map_2, p.median_px)
    beta_1 = extract_corners(alpha_1, p)
    beta_2 = extract_corners(alpha_2, p)
    farthest = p.relation_max_share * max(greatest_distance(beta_1), greatest_distance(beta_2))
    letters_1 = generate_alphabet(beta_1, p.relation_min_px, farthest)
    letters_2 = generate_alphabet(beta_2, p.relation_min_px, farthest)
    gamma = compare_alphabets(
        letters_1, letters_2, p.distance_tolerance_px, math.radians(p.angle_tolerance_deg)
    )
    phi = select_candidates(gamma, letters_1, letters_2, p.candidates, p.distance_tolerance_px)
    fittings = best_matching_points(phi, alpha_1, alpha_2, beta_1, beta_2)

    return MapMatching((map_1, map_2), (alpha_1, alpha_2), (letters_1, letters_2), gamma, phi, fittings)


def match_alphabet(
    a: OccupancyGrid, b: OccupancyGrid, parameters: AlphabetParameters | None = None
) -> MatchResult:
    """Match two maps by the paper's method.

    The verdict is an honest threshold on the Jaccard similarity, not a probability
    (`AlphabetParameters.accept_similarity`); the paper itself accepts every best fit.
    """
    parameters = parameters or AlphabetParameters()
    matching = map_matching(a, b, parameters)
    if not matching.fittings:
        return MatchResult(T_a_b=None, verdict=Verdict.REJECTED, reason=_nothing_to_match_on(matching))
    best, *others = matching.fittings
    T_a_b = in_metres(best.T_1_2_px, *matching.maps)
    alternatives = distinct_modes(
        T_a_b, (Alternative(in_metres(f.T_1_2_px, *matching.maps), f.similarity) for f in others), b
    )
    verdict, reason = _verdict(best.similarity, alternatives, parameters)
    return MatchResult(
        T_a_b=T_a_b,
        verdict=verdict,
        reason=f"{reason} (best of {len(matching.fittings)} fittings)",
        similarity=best.similarity,
        overlap=overlap_share(a, b, T_a_b),
        alternatives=alternatives,
    )


def _verdict(
    similarity: float, alternatives: tuple[Alternative, ...], parameters: AlphabetParameters
) -> tuple[Verdict, str]:
    found = f"Jaccard similarity {similarity:.3f} of the walls is"
    if similarity < parameters.accept_similarity:
        return Verdict.REJECTED, f"{found} below the threshold {parameters.accept_similarity:g}"
    rival = alternatives[0].similarity if alternatives else 0.0
    if rival >= parameters.ambiguous_share * similarity:
        return Verdict.AMBIGUOUS, f"{found} hardly above the {rival:.3f} of a different fitting"
    return Verdict.ACCEPTED, f"{found} at least the threshold {parameters.accept_similarity:g}"


def _nothing_to_match_on(matching: MapMatching) -> str:
    for name, grid in zip("ab", matching.maps, strict=True):
        if not grid.occupied.any():
            return f"nothing to match on: map {name} has no obstacle"
    for name, alphabet in zip("ab", matching.alphabets, strict=True):
        if not len(alphabet.letter):
            return (
                f"nothing to match on: the {len(alphabet.corners_px)} corners of map {name} have no relations"
            )
    return "nothing to match on: no letter of map a has a partner in map b"
