"""`fourier_mellin`: rotation from the magnitudes of the Fourier transform, translation by phase correlation.

Source: B. S. Reddy and B. N. Chatterji, "An FFT-based technique for translation, rotation, and
scale-invariant image registration", IEEE Transactions on Image Processing 5 (1996). The magnitude of
a picture's Fourier transform does not change when the picture is moved, and turns with it. On a polar
lattice the turn becomes a shift, which phase correlation finds, as it finds the translation once both
pictures are turned alike. Maps have a scale, so radii stay plain: the logarithm, by which the publication
makes a change of scale a shift too, is left out.
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

Plane = NDArray[np.float32]

# Radii of the polar lattice as shares of the sampling rate: below, only the outline of the known
# area speaks; above, the stairs of slanted walls (this is the publication's high pass, made a ring).
_RING = (0.02, 0.4)
# The picture is this much larger than the map: Fourier transforms of maps that fill the picture change
# from sample to sample, and the polar lattice between the samples repeats in both maps, at no rotation.
_PADDING = 2
# Blur of the translation's correlation [px]: walls of two maps never meet to the cell.
_BLUR_PX = 1.0
# Largest picture [px]: larger maps are compared on larger cells, which bounds memory at about 1 GB.
_MOST_PX = 8192
# Rotations nearer than this to a better one are the same peak.
_PEAKS_APART_DEG = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FourierMellinParameters:
    """Settings of the Fourier-Mellin method.

    Attributes
    ----------
    rotation_peaks
        How many of the best rotations are tried, each twice (1: as published).
    directions
        Directions into which half a turn is divided (720: a quarter of a degree each).
    cell
        Side of the cells [m] on which the walls are compared; coarser maps keep theirs.
    accept_response
        Height of the translation's peak from which a match is accepted; docs/methods.md says
        how it was set.
    accept_index
        Acceptance index (see `evidence`) that it needs besides: a small patch of clutter correlates
        with anything.
    """

    rotation_peaks: int = 4
    directions: int = 720
    cell: float = 0.1
    accept_response: float = 0.1
    accept_index: float = 0.9

    def __post_init__(self) -> None:
        if not 1 <= self.rotation_peaks <= 90:
            raise ValueError(f"rotation_peaks must be in 1..90, not {self.rotation_peaks}")
        if not 8 <= self.directions <= 7200:
            raise ValueError(f"directions must be in 8..7200, not {self.directions}")
        if not (math.isfinite(self.cell) and self.cell >= 0):
            raise ValueError(f"cell must be a length of at least 0 m, not {self.cell}")
        for name in ("accept_response", "accept_index"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"{name} must be in 0..1, not {getattr(self, name)}")


def magnitudes_by_direction(walls_px: Points, size: int, directions: int) -> Plane:
    """Return the logarithm of the Fourier magnitudes of the walls on a polar lattice.

    Parameters
    ----------
    walls_px
        (n, 2) walls about the middle of the picture [px].
    size
        Side of the square picture [px], the same for both maps: it sets the unit of frequency.
    directions
        Rows of the lattice; half a turn, as the magnitudes of a real picture are symmetric.

    Returns
    -------
    (directions, radii) array, the mean of every radius taken out.
    """
    size *= _PADDING
    magnitude = np.log1p(np.abs(np.fft.fftshift(np.fft.fft2(drawn_walls(walls_px, size)))))
    theta = np.arange(directions)[:, None] * (np.pi / directions)
    radius = np.arange(max(1, round(_RING[0] * size)), max(3, round(_RING[1] * size)), _PADDING)[None, :]
    middle = size // 2
    polar = cv2.remap(
        magnitude,
        (middle + np.cos(theta) * radius).astype(np.float32),
        (middle + np.sin(theta) * radius).astype(np.float32),
        cv2.INTER_LINEAR,
    )
    return np.asarray(polar - polar.mean(axis=0), dtype=np.float32)


def rotations(polar_1: Plane, polar_2: Plane, peaks: int) -> list[float]:
    """Return the rotations [rad] of map 2, in [0, pi), at the best peaks of the phase correlation.

    Every radius (column) is correlated over direction alone and all are added: a shift along the radius
    would be a scale.
    """
    n = len(polar_1)
    cross = np.fft.rfft(polar_1, axis=0) * np.conj(np.fft.rfft(polar_2, axis=0))
    correlation = np.fft.irfft((cross / (np.abs(cross) + 1e-9)).sum(axis=1), n)
    apart = max(1, round(n * _PEAKS_APART_DEG / 180))
    return [
        refined_peak(correlation, k) * math.pi / n % math.pi
        for k in separate_peaks(correlation, peaks, apart)
    ]


def drawn_walls(walls_px: Points, size: int) -> Plane:
    """Return walls (n, 2) about the middle of a square picture (size, size), 0..1.

    A wall between the centres of pixels is shared by the four around it, which keeps slanted walls free
    of stairs and places finer than a pixel.
    """
    wide = size + 3  # with a frame that catches what lies outside: one pixel before, two after
    place = np.clip(walls_px + (size / 2 + 0.5), 0.0, size + 1.0)
    col, row = place.astype(np.intp).T
    right, up = (place % 1.0).T
    picture = np.zeros(wide * wide)
    for step, weight in (
        (0, (1 - right) * (1 - up)),
        (1, right * (1 - up)),
        (wide, (1 - right) * up),
        (wide + 1, right * up),
    ):
        picture += np.bincount(row * wide + col + step, weight, wide * wide)[: wide * wide]
    return np.minimum(picture.reshape(wide, wide)[1 : size + 1, 1 : size + 1], 1.0, dtype=np.float32)


class Translations:
    """Phase correlation of map 1's walls with map 2's, turned in different ways."""

    def __init__(self, walls_1_px: Points, size: int) -> None:
        """Transform map 1; `size` [px], even, must hold both maps side by side: nothing wraps around."""
        self._size = size
        self._transform_1 = np.fft.rfft2(drawn_walls(walls_1_px, size))
        blur = np.exp(-2 * (np.pi * _BLUR_PX * np.fft.fftfreq(size)) ** 2).astype(np.float32)
        self._blur = blur[:, None] * blur[None, : size // 2 + 1]
        self._full_height = float(blur.mean()) ** 2

    def best(self, walls_2_px: Points) -> tuple[float, float, float]:
        """Return (x, y) [px] of the highest peak for these walls (n, 2), and its height.

        The height is 1 for two pictures that are equal but for a translation by whole pixels.
        """
        n = self._size
        cross = self._transform_1 * np.conj(np.fft.rfft2(drawn_walls(walls_2_px, n)))
        cross *= self._blur / (np.abs(cross) + np.float32(1e-6))
        correlation = np.fft.irfft2(cross, (n, n))
        row, col = divmod(int(np.argmax(correlation)), n)
        x, y = refined_peak(correlation[row], col), refined_peak(correlation[:, col], row)
        height = float(correlation[row, col]) / self._full_height
        return (x - n if x > n / 2 else x), (y - n if y > n / 2 else y), height


def match_fourier_mellin(
    a: OccupancyGrid, b: OccupancyGrid, parameters: FourierMellinParameters | None = None
) -> MatchResult:
    """Match two maps by the Fourier transforms of their walls; the highest peak of a translation wins."""
    p = parameters or FourierMellinParameters()
    evidence = Evidence.of(a, b)
    if nothing := evidence.nothing_to_match_on():
        return rejected(nothing)
    resolution = evidence.maps[0].resolution
    # Walls about the middle of their bounding box, so that the smallest picture holds them in any turn.
    middles, walls, diagonals = [], [], []
    for walls_px in (evidence.walls_1_px, evidence.walls_2_px):
        low, high = walls_px.min(axis=0), walls_px.max(axis=0)
        middles.append((low + high) / 2)
        walls.append(walls_px - middles[-1])
        diagonals.append(float(np.hypot(*(high - low))))
    cell_px = max(1.0, p.cell / resolution, sum(diagonals) / _MOST_PX)
    walls_1_px, walls_2_px = (w / cell_px for w in walls)

    size = _even_fast_length(max(diagonals) / cell_px + 2)
    polar_1, polar_2 = (magnitudes_by_direction(w, size, p.directions) for w in (walls_1_px, walls_2_px))
    translations = Translations(walls_1_px, _even_fast_length(sum(diagonals) / cell_px + 4))
    hypotheses: list[tuple[float, Pose2]] = []
    for rotation in rotations(polar_1, polar_2, p.rotation_peaks):
        # Magnitudes cannot tell a turn from the same and half a turn more; the translation's peak can.
        for turn in (Pose2(theta=rotation), Pose2(theta=rotation + math.pi)):
            x, y, height = translations.best(turn.apply(walls_2_px))
            shift = middles[0] + np.array((x, y)) * cell_px - turn.apply(middles[1])
            hypotheses.append((height, Pose2(float(shift[0]), float(shift[1]), turn.theta)))
    hypotheses.sort(key=lambda hypothesis: -hypothesis[0])
    (height, best), *others = hypotheses
    index = evidence.acceptance_index(best)
    accepted = height >= p.accept_response and index >= p.accept_index
    return MatchResult(
        T_a_b=evidence.in_metres(best),
        verdict=Verdict.ACCEPTED if accepted else Verdict.REJECTED,
        reason=(
            f"response {height:.3f} of the phase correlation (threshold {p.accept_response:g}) and "
            f"acceptance index {index:.3f} (threshold {p.accept_index:g}) "
            f"{'both suffice' if accepted else 'do not both suffice'} (best of {len(hypotheses)} rotations)"
        ),
        similarity=evidence.similarity(best),
        overlap=evidence.overlap(best),
        alternatives=tuple(Alternative(evidence.in_metres(T), evidence.similarity(T)) for _, T in others),
    )


def _even_fast_length(least_px: float) -> int:
    """Return an even length that the fast Fourier transform likes, at least `least_px`."""
    return 2 * int(cv2.getOptimalDFTSize(math.ceil(least_px / 2)))
