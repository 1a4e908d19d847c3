from __future__ import annotations
import math
from dataclasses import dataclass
import numpy as np
from mapmeld.merging.graph.edges import Doubles
from mapmeld.se2 import Pose2


@dataclass(frozen=True, slots=True)
class KnownPose:
    T_w_i: Pose2
    sigma_metres: float = 0.0
    sigma_theta: float = 0.0

    def covariance(self) -> Doubles:
        xy, theta = max(self.sigma_metres, 1e-6), max(self.sigma_theta, 1e-6)
        return np.diag([xy**2, xy**2, theta**2])
