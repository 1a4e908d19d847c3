"""Step 2, features (paper, section 2.1.2): the corners of the walls."""

from __future__ import annotations

from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmeld.matching.alphabet.parameters import AlphabetParameters
from mapmeld.matching.alphabet.preprocessing import Image

Points = NDArray[np.float64]


def extract_corners(image: Image, parameters: AlphabetParameters) -> Points:
    """Return the strongest corners of a preprocessed map, the list L_m of Expression 1.

    Good features to track (Shi and Tomasi 1994): at most N corners, none weaker than q times
    the strongest, spread out over the image.

    Returns
    -------
    (n, 2) array of (col, row) lattice positions [px]: cell corners are whole numbers, so the
    centre of the pixel in which a corner was found is at + 0.5.
    """
    if not image.size:
        return np.empty((0, 2))
    found = cast(
        "NDArray[np.float32] | None",  # None for an image of one colour; OpenCV's stubs leave that out
        cv2.goodFeaturesToTrack(
            image, parameters.corners, parameters.corner_quality, parameters.corner_spacing_px
        ),
    )
    if found is None:
        return np.empty((0, 2))
    return found.reshape(-1, 2).astype(np.float64) + 0.5
