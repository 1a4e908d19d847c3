"""The settings of `slam_gmapping`, under its names and with its defaults."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Literal

MAX_KERNEL = 15
"""Largest `kernelSize`: a row of what it looks at has to fit into one word."""


@dataclass(frozen=True, slots=True)
class GMappingParameters:
    """Settings, called as in the ROS node ``slam_gmapping`` so that its files can be used.

    Attributes
    ----------
    maxUrange
        Up to where beams are used [m]; of longer ones the way up to there is free, and no more is
        known. None: as `maxRange`.
    maxRange
        Beams longer than this [m] are left out altogether. None: the laser's maximum less 1 cm. Larger than
        the laser's maximum (``.inf``), beams that meet nothing free their way up to `maxUrange`.
    sigma, kernelSize
        Scan matching: width of the score of a beam (see `score_gain`), and how many cells around the
        end of a beam it looks for a wall.
    lstep, astep, iterations
        Scan matching: its first steps [m, rad], and how often they are halved.
    lsigma, ogain, lskip
        Likelihood: width for a single beam, gain by which the weights are smoothed, and how many beams are
        left out after each that is used.
    minimumScore
        A scan that scores no more than this at its best leaves the particle where odometry says.
    srr, srt, str, stt
        Odometry's noise: of translation by translation and by rotation (srr, str), of rotation by
        translation and by rotation (srt, stt); standard deviations in proportion to the motion.
    linearUpdate, angularUpdate, temporalUpdate
        A scan is used when the robot has gone so far [m] or turned so far [rad] since the last one that
        was, or so much time has passed [s]; negative: never for time alone.
    resampleThreshold
        Resample when the effective number of particles falls below this part of all.
    particles
        How many.
    xmin, ymin, xmax, ymax
        What the maps reach at first [m]; they grow as needed.
    delta
        Side of a cell [m].
    occ_thresh
        From which share of hits on a cell of the finished map is occupied.
    llsamplerange, llsamplestep, lasamplerange, lasamplestep
        Where ``proposal="sampled"`` asks for the likelihood around the best pose [m, m, rad, rad].
    proposal
        "matched": a particle goes to where the scan fits best, as in the released program. "sampled": it
        is drawn from the Gaussian of the likelihood around there, as in the paper.
    """

    maxUrange: float | None = None
    maxRange: float | None = None
    sigma: float = 0.05
    kernelSize: int = 1
    lstep: float = 0.05
    astep: float = 0.05
    iterations: int = 5
    lsigma: float = 0.075
    ogain: float = 3.0
    lskip: int = 0
    minimumScore: float = 0.0
    srr: float = 0.1
    srt: float = 0.2
    str: float = 0.1
    stt: float = 0.2
    linearUpdate: float = 1.0
    angularUpdate: float = 0.5
    temporalUpdate: float = -1.0
    resampleThreshold: float = 0.5
    particles: int = 30
    xmin: float = -100.0
    ymin: float = -100.0
    xmax: float = 100.0
    ymax: float = 100.0
    delta: float = 0.05
    occ_thresh: float = 0.25
    llsamplerange: float = 0.01
    llsamplestep: float = 0.01
    lasamplerange: float = 0.005
    lasamplestep: float = 0.005
    proposal: Literal["matched", "sampled"] = "matched"

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, float) and math.isnan(value):
                raise ValueError(f"{field.name} must be a number, not {value}")
        for name in _POSITIVE:
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise ValueError(f"{name} must be more than 0, not {value:g}")
        for name in _NOT_NEGATIVE:
            value = getattr(self, name)
            if not value >= 0:
                raise ValueError(f"{name} must not be negative, but is {value:g}")
        for name in _FINITE:
            if not math.isfinite(getattr(self, name)):
                raise ValueError(f"{name} must be finite, not {getattr(self, name):g}")
        if self.kernelSize > MAX_KERNEL:
            raise ValueError(f"kernelSize must be at most {MAX_KERNEL}, not {self.kernelSize}")
        if not (self.xmin < self.xmax and self.ymin < self.ymax):
            raise ValueError("xmin must be less than xmax, and ymin less than ymax")
        if not self.occ_thresh < 1:
            raise ValueError(f"occ_thresh must be less than 1, not {self.occ_thresh:g}")
        if self.proposal not in ("matched", "sampled"):
            raise ValueError(f"proposal must be 'matched' or 'sampled', not {self.proposal!r}")
        if self.maxUrange is not None and math.isinf(self.maxUrange):
            raise ValueError("maxUrange must be finite: it is how far beams are drawn")
        if self.maxUrange is None and self.maxRange is not None and math.isinf(self.maxRange):
            raise ValueError(
                "maxUrange has to be set where maxRange is infinite: it is how far beams are drawn"
            )


_POSITIVE = (
    "maxUrange", "maxRange", "sigma", "lsigma", "ogain", "lstep", "astep", "particles", "delta",
    "llsamplestep", "lasamplestep",
)  # fmt: skip
_NOT_NEGATIVE = (
    "kernelSize", "iterations", "lskip", "srr", "srt", "str", "stt", "linearUpdate", "angularUpdate",
    "resampleThreshold", "occ_thresh", "llsamplerange", "lasamplerange",
)  # fmt: skip
_FINITE = (
    "sigma", "lsigma", "ogain", "lstep", "astep", "delta", "minimumScore", "srr", "srt", "str", "stt",
    "xmin", "ymin", "xmax", "ymax", "llsamplerange", "llsamplestep", "lasamplerange", "lasamplestep",
)  # fmt: skip
