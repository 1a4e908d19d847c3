"""The methods in use today, to compare with: written from their publications or their OpenCV calls.

One module per method: `feature_orb`, `feature_akaze`, `hough_spectrum`, `fourier_mellin`. All answer with
the same evidence (`evidence.py`); docs/methods.md says what is the publications' and what is ours.
"""

from mapmeld.matching.baselines.feature_akaze import (
    AkazeMissingError,
    FeatureAkazeParameters,
    match_feature_akaze,
)
from mapmeld.matching.baselines.feature_orb import FeatureOrbParameters, match_feature_orb
from mapmeld.matching.baselines.fourier_mellin import FourierMellinParameters, match_fourier_mellin
from mapmeld.matching.baselines.hough_spectrum import HoughSpectrumParameters, match_hough_spectrum

__all__ = [
    "AkazeMissingError",
    "FeatureAkazeParameters",
    "FeatureOrbParameters",
    "FourierMellinParameters",
    "HoughSpectrumParameters",
    "match_feature_akaze",
    "match_feature_orb",
    "match_fourier_mellin",
    "match_hough_spectrum",
]
