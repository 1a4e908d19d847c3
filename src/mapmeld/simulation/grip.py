"""How well tyres grip: better here, worse there, as on any real floor."""

from __future__ import annotations

import math
import zlib

import numpy as np

from mapmeld.simulation.environment import Environment

_PATCH = 0.7  # size of a patch [m]
_LEAST, _MOST = 0.4, 1.6  # grip of patches, of the tyre's own


class Grip:
    """The grip of a floor as a factor for the tyres' friction, smooth between patches.

    It belongs to the environment: every mapping of it meets the same slippery places.
    """

    def __init__(self, environment: Environment) -> None:
        rng = np.random.default_rng(zlib.crc32(environment.fields.tobytes()))
        rows, cols = (math.ceil(side / _PATCH) + 2 for side in environment.fields.shape)
        self._patches: list[list[float]] = [
            [float(p) for p in row] for row in rng.uniform(_LEAST, _MOST, (rows, cols))
        ]
        self._last = float(cols - 2), float(rows - 2)

    def at(self, x: float, y: float) -> float:
        """Return the factor at a place [m]; beyond the ground that at its edge."""
        right, top = self._last
        u = min(max(x / _PATCH, 0.0), right + 0.999)
        v = min(max(y / _PATCH, 0.0), top + 0.999)
        col, row = int(u), int(v)
        u, v = u - col, v - row
        low, high = self._patches[row], self._patches[row + 1]
        below = low[col] * (1 - u) + low[col + 1] * u
        above = high[col] * (1 - u) + high[col + 1] * u
        return below * (1 - v) + above * v
