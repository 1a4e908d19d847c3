"""`hough_spectrum`: rotation from Hough spectra, translation from the projections of the walls.

Source: S. Carpin, "Fast and accurate map merging for multi-robot systems", Autonomous Robots 25 (2008).
A map's Hough spectrum says how much wall runs in each direction. It does not change when the map is moved,
and turns with it, so correlating two spectra gives the rotation; once two maps are turned alike, the same
is done with the walls' projections on the x and y axes for the translation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmeld.grid import OccupancyGrid
from mapmeld.matching.baselines.evidence import Evidence, Points, rejected
from mapmeld.matching.baselines.peaks import refined_peak, separate_peaks
from mapmeld.matching.result import Alternative, MatchResult, Verdict
from mapmeld.se2 import Pose2

Spectrum = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class HoughSpectrumParameters:
    """Settings of the Hough spectrum method.

    Attributes
    ----------
    directions
        Directions into which half a turn is divided (180: one degree each).
    rotation_peaks
        How many of the best rotations are tried; each twice, as a wall has no front.
    accept_index
        Acceptance index from which a match is accepted; docs/methods.md says how it was set.
    """

    directions: int = 180
    rotation_peaks: int = 4
    accept_index: float = 0.95

    def __post_init__(self) -> None:
        if not 8 <= self.directions <= 7200:
            raise ValueError(f"directions must be in 8..7200, not {self.directions}")
        if not 1 <= self.rotation_peaks <= 90:
            raise ValueError(f"rotation_peaks must be in 1..90, not {self.rotation_peaks}")
        if not 0 <= self.accept_index <= 1:
            raise ValueError(f"accept_index must be in 0..1, not {self.accept_index}")


def hough_spectrum(walls_px: Points, directions: int) -> Spectrum:
    """Return the sum of the squared entries of each row of the Hough transform, shape (directions,).

    Row k holds the lines whose normal points to k * 180 degrees / directions, one pixel apart. Half a turn is
    enough: the other half holds the same lines from behind.
    """
    theta = np.arange(directions) * (np.pi / directions)
    reach = math.ceil(float(np.hypot(*walls_px.T).max())) + 1
    spectrum = np.empty(directions)
    for k in range(directions):
        rho = walls_px[:, 0] * math.cos(theta[k]) + walls_px[:, 1] * math.sin(theta[k]) + reach
        votes = np.bincount(rho.astype(np.intp), minlength=2 * reach)
        spectrum[k] = float((votes.astype(np.float64) ** 2).sum())
    return spectrum


def rotations(spectrum_1: Spectrum, spectrum_2: Spectrum, peaks: int) -> list[float]:
    """Return the rotations [rad] of map 2 in [0, pi) at the best local maxima of the circular correlation.

    Both spectra (directions,) are correlated about their means.
    """
    n = len(spectrum_1)
    one, two = (np.fft.rfft(s - s.mean()) for s in (spectrum_1, spectrum_2))
    correlation = np.fft.irfft(one * np.conj(two), n)
    apart = max(1, round(n * _PEAKS_APART_DEG / 180))
    return [
        refined_peak(correlation, k) * math.pi / n % math.pi
        for k in separate_peaks(correlation, peaks, apart)
    ]


# Rotations nearer than this to a better one are the same peak.
_PEAKS_APART_DEG = 5.0


def offset_along(positions_1: NDArray[np.float64], positions_2: NDArray[np.float64]) -> float:
    """Return the shift [px] that makes two sets of coordinates (n,), (m,) lie most on one another."""
    low_1, low_2 = math.floor(positions_1.min()), math.floor(positions_2.min())
    one = np.bincount((positions_1 - low_1).astype(np.intp)).astype(np.float64)
    two = np.bincount((positions_2 - low_2).astype(np.intp)).astype(np.float64)
    size = cv2.getOptimalDFTSize(len(one) + len(two))
    correlation = np.fft.irfft(np.fft.rfft(one, size) * np.conj(np.fft.rfft(two, size)), size)
    shift = refined_peak(correlation, int(np.argmax(correlation)))
    if shift > len(one):
        shift -= size
    return float(shift + low_1 - low_2)


def match_hough_spectrum(
    a: OccupancyGrid, b: OccupancyGrid, parameters: HoughSpectrumParameters | None = None
) -> MatchResult:
    """Match two maps by their Hough spectra; the hypothesis with the best acceptance index wins."""
    parameters = parameters or HoughSpectrumParameters()
    evidence = Evidence.of(a, b)
    if nothing := evidence.nothing_to_match_on():
        return rejected(nothing)
    walls_1_px, walls_2_px = evidence.walls_1_px, evidence.walls_2_px
    middle_1, middle_2 = walls_1_px.mean(axis=0), walls_2_px.mean(axis=0)
    walls_1_px, walls_2_px = walls_1_px - middle_1, walls_2_px - middle_2
    spectrum_1 = hough_spectrum(walls_1_px, parameters.directions)
    spectrum_2 = hough_spectrum(walls_2_px, parameters.directions)
    # Projections are the sharpest along the walls: lay map 1's main direction on the axes.
    main = Pose2(
        theta=-refined_peak(spectrum_1, int(np.argmax(spectrum_1))) * math.pi / parameters.directions
    )
    x_1, y_1 = main.apply(walls_1_px).T

    hypotheses: list[tuple[float, Pose2]] = []
    for rotation in rotations(spectrum_1, spectrum_2, parameters.rotation_peaks):
        for turn in (Pose2(theta=rotation), Pose2(theta=rotation + math.pi)):
            x_2, y_2 = (main @ turn).apply(walls_2_px).T
            shift = main.inverse().apply((offset_along(x_1, x_2), offset_along(y_1, y_2)))
            x, y = middle_1 + shift - turn.apply(middle_2)
            T_1_2_px = Pose2(float(x), float(y), turn.theta)
            hypotheses.append((evidence.acceptance_index(T_1_2_px), T_1_2_px))
    hypotheses.sort(key=lambda hypothesis: -hypothesis[0])
    (index, best), *others = hypotheses
    accepted = index >= parameters.accept_index
    return MatchResult(
        T_a_b=evidence.in_metres(best),
        verdict=Verdict.ACCEPTED if accepted else Verdict.REJECTED,
        reason=(
            f"acceptance index {index:.3f} is {'at least' if accepted else 'below'} "
            f"the threshold {parameters.accept_index:g} (best of {len(hypotheses)} hypotheses)"
        ),
        similarity=evidence.similarity(best),
        overlap=evidence.overlap(best),
        alternatives=tuple(Alternative(evidence.in_metres(T), evidence.similarity(T)) for _, T in others),
    )
