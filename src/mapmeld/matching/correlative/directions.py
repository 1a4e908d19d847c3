"""Which way the walls run: the rotation between two maps, up to right angles, from their walls' directions.

Most buildings have two main directions. The histogram of the walls' normals (the idea of Carpin 2008,
on gradients instead of a Hough transform) of one map, turned, is that of the other; the lag at which
they agree best is the rotation, modulo a right angle.
"""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

BINS = 360
"""Bins of a direction spectrum over 180 degrees."""

SPECTRUM_BLUR = 0.3
"""[m] Hides the stair steps of walls that cross the lattice."""

# What repeats at every right angle is in the even frequencies: these, smoothed, without the mean.
_SMOOTHED = np.exp(-2 * (np.arange(0, BINS // 2 + 1, 2) * math.radians(3.0)) ** 2)
_SMOOTHED[0] = 0

Spectrum = NDArray[np.float64]


def direction_spectrum(wall: NDArray[Any], cell: float) -> Spectrum:
    """Histogram of the walls' normals, weighted by their contrast (BINS over 180 degrees)."""
    blurred = cv2.GaussianBlur(wall.astype(np.float32), (0, 0), SPECTRUM_BLUR / cell)
    at = np.flatnonzero(blurred.ravel() > 5)
    x = cv2.Scharr(blurred, cv2.CV_32F, 1, 0).ravel()[at]
    y = cv2.Scharr(blurred, cv2.CV_32F, 0, 1).ravel()[at]
    bins = np.floor(np.arctan2(y, x) * (BINS / math.pi)).astype(np.int32) % BINS
    return np.bincount(bins, np.hypot(x, y), BINS).astype(np.float64)


def relative_directions(a: Spectrum, b: Spectrum) -> list[tuple[float, float]]:
    """Rotations [rad, modulo a right angle] that lay b's wall directions on a's, best first, with weight."""
    half = BINS // 2
    c = np.fft.irfft(_smooth(a) * np.conj(_smooth(b)), half)
    peaks = np.flatnonzero((c >= np.roll(c, 1)) & (c > np.roll(c, -1)))
    peaks = peaks[np.argsort(-c[peaks], kind="stable")]
    out = []
    for k in peaks:
        before, at, after = c[k - 1], c[k], c[(k + 1) % half]
        bend = before - 2 * at + after
        shift = 0.5 * (before - after) / bend if bend else 0.0
        out.append((float(k + shift) * math.pi / BINS, float(at)))
    return out or [(0.0, 0.0)]


def main_direction(spectrum: Spectrum) -> float:
    """Return the direction [rad, modulo a right angle] in which most wall runs or is crossed."""
    return float(np.argmax(np.fft.irfft(_smooth(spectrum), BINS // 2))) * math.pi / BINS


def _smooth(spectrum: Spectrum) -> NDArray[np.complex128]:
    """Fourier coefficients of the spectrum modulo a right angle, smoothed, without mean."""
    return np.asarray(np.fft.rfft(spectrum)[::2] * _SMOOTHED)
