"""GMapping: simultaneous localisation and mapping with a Rao-Blackwellized particle filter.

Source: G. Grisetti, C. Stachniss, W. Burgard, "Improved Techniques for Grid Mapping With
Rao-Blackwellized Particle Filters", IEEE Transactions on Robotics 23 (1), 2007, and what is known of
the program that its authors released. docs/slam.md says where the two differ.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mapmeld.errors import MapmeldError
from mapmeld.grid import OccupancyGrid
from mapmeld.recording import Laser, Scan
from mapmeld.se2 import Pose2, wrap_angle
from mapmeld.slam.kernels import Sensor, climb, likelihoods_around
from mapmeld.slam.motion import motion_noise, moved, sample_motion
from mapmeld.slam.parameters import GMappingParameters
from mapmeld.slam.resampling import effective_size, low_variance, normalised
from mapmeld.slam.shared_maps import SharedMaps

Floats = NDArray[np.float64]

# What a beam that meets no wall counts for in the likelihood, as a squared distance [m^2].
_MISSED = 0.5


class ScanError(MapmeldError):
    """A scan that cannot be one of this laser, or has no pose."""


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Where the robot was.

    Attributes
    ----------
    stamps
        (n,) [s]
    poses
        (n, 3) x, y, theta of T_map_base [m, m, rad].
    """

    stamps: Floats
    poses: Floats


@dataclass(frozen=True, slots=True)
class _Beams:
    """One scan in the robot's frame, in cells: for the matching (n, 2), and for the map (m, 2), (m,)."""

    to_match: Floats
    ends: Floats
    hits: NDArray[np.bool_]
    longest: float


class GMapping:
    """A map and a pose from scans, one after the other.

    The map's frame is odometry's at the first scan.

    Attributes
    ----------
    laser, parameters
        As given.
    """

    def __init__(self, laser: Laser, parameters: GMappingParameters | None = None, seed: int = 0) -> None:
        """Start with nothing known.

        Parameters
        ----------
        laser
            What the scans come from.
        parameters
            Settings; None: the defaults.
        seed
            Of all randomness: the same scans, settings and seed give the same map.

        Raises
        ------
        MissingExtraError
            numba is not installed.
        """
        self.laser = laser
        self.parameters = p = parameters or GMappingParameters()
        self._max_range = laser.max_range - 0.01 if p.maxRange is None else p.maxRange
        self._max_used = self._max_range if p.maxUrange is None else p.maxUrange
        self._rng = np.random.default_rng(seed)
        self._sensor = Sensor(
            int(p.kernelSize),
            p.delta**2 / (2 * p.sigma**2),
            p.delta**2 / p.lsigma,
            -_MISSED / p.lsigma,
        )
        bearings = laser.bearings() + laser.T_base_laser.theta
        self._directions = np.column_stack([np.cos(bearings), np.sin(bearings)])
        self._start = np.array([laser.T_base_laser.x, laser.T_base_laser.y]) / p.delta
        self._maps = SharedMaps(p.particles, p.delta, (p.xmin, p.ymin), (p.xmax, p.ymax))
        self._poses = np.zeros((p.particles, 3))
        self._weights = np.zeros(p.particles)  # logarithms, since the last resampling
        self._totals = np.zeros(p.particles)  # logarithms, over the whole past of a particle
        self._linear = self._angular = 0.0
        self._turned = 0.0  # since the last scan that was used, which may be more than a Pose2 tells
        self._odometry: Pose2 | None = None  # at the last scan
        # At the last scan that was used:
        self._used_odometry = Pose2()
        self._used_stamp = -math.inf
        # Of all scans that were used: when, where the particles were, and which one each came from.
        self._stamps: list[float] = []
        self._past_poses: list[Floats] = []
        self._parents: list[NDArray[np.intp]] = []

    # ------------------------------------------------------------------ input
    def add(self, scan: Scan) -> bool:
        """Take the next scan; return whether it was used, and the map changed.

        Most scans only move the robot: `linearUpdate`, `angularUpdate` and `temporalUpdate` say which are
        used.

        Raises
        ------
        ScanError
            The scan has not the laser's number of beams, or odometry is not finite.
        MapTooLargeError
            Odometry jumps so far that no map reaches there.
        """
        p = self.parameters
        now = scan.T_odom_base
        if scan.ranges.shape != (self.laser.beams,):
            raise ScanError(
                f"the scan at {scan.stamp:.3f} s has {scan.ranges.size} ranges; "
                f"the laser has {self.laser.beams} beams"
            )
        if not all(map(math.isfinite, (now.x, now.y, now.theta, scan.stamp))):
            raise ScanError(f"the scan at {scan.stamp:.3f} s has no finite odometry: {now}")
        first = self._odometry is None
        if self._odometry is None:
            self._poses[:] = now.x, now.y, now.theta
        else:
            motion = self._odometry.inverse() @ now
            self._poses = sample_motion(self._poses, motion, p, self._rng)
            self._linear += math.hypot(motion.x, motion.y)
            self._angular += abs(motion.theta)
            self._turned += motion.theta
        self._odometry = now
        waited = p.temporalUpdate >= 0 and scan.stamp - self._used_stamp > p.temporalUpdate
        if not (first or waited or self._linear >= p.linearUpdate or self._angular >= p.angularUpdate):
            return False

        beams = self._beams(scan)
        low, high = self._poses[:, :2].min(axis=0), self._poses[:, :2].max(axis=0)
        margin = beams.longest * p.delta
        self._maps.reach((low[0] - margin, low[1] - margin), (high[0] + margin, high[1] + margin))
        parents = np.arange(p.particles)
        if not first:
            self._match(beams)
            weights = normalised(self._weights, p.ogain)
            if effective_size(weights) < p.resampleThreshold * p.particles:
                parents = low_variance(weights, self._rng.random())
                self._poses, self._totals = self._poses[parents], self._totals[parents]
                self._weights = np.zeros(p.particles)
                self._maps.keep(parents)
        # The matching may have moved particles beyond what was made room for.
        low, high = self._poses[:, :2].min(axis=0), self._poses[:, :2].max(axis=0)
        self._maps.reach((low[0] - margin, low[1] - margin), (high[0] + margin, high[1] + margin))
        for number in range(p.particles):
            self._maps.enter(number, self._poses[number], self._start, beams.ends, beams.hits)
        self._stamps.append(scan.stamp)
        self._past_poses.append(self._poses.copy())
        self._parents.append(parents)
        self._used_odometry, self._used_stamp = now, scan.stamp
        self._linear = self._angular = self._turned = 0.0
        return True

    def _beams(self, scan: Scan) -> _Beams:
        p = self.parameters
        ranges = scan.ranges.astype(np.float64)
        valid = (ranges > 0) & (ranges <= self._max_range)
        used = np.minimum(ranges, self._max_used, where=valid, out=np.zeros_like(ranges))
        ends = self._start + (used / p.delta)[:, None] * self._directions
        to_match = valid & (ranges <= self._max_used)
        to_match &= np.arange(len(ranges)) % (p.lskip + 1) == p.lskip
        return _Beams(
            ends[to_match],
            ends[valid],
            (ranges < self._max_used)[valid],
            float(used.max(initial=0.0)) / p.delta + float(np.hypot(*self._start)),
        )

    # ------------------------------------------------------------------ the filter
    def _match(self, beams: _Beams) -> None:
        """Put the particles where the scan fits, and weigh them."""
        p, maps = self.parameters, self._maps
        guesses = maps.lattice(self._poses)
        poses = guesses.copy()
        scores, likelihoods = climb(
            maps.cells,
            maps.walls,
            maps.tables,
            poses,
            beams.to_match,
            self._sensor,
            p.lstep / p.delta,
            p.astep,
            p.iterations,
        )
        failed = scores <= p.minimumScore
        poses[failed] = guesses[failed]
        for number in range(p.particles):
            if failed[number]:
                likelihoods[number] = self._likelihoods(number, poses[number][None], beams)[0]
        self._poses = maps.metres(poses)
        if p.proposal == "sampled":
            for number in map(int, np.flatnonzero(~failed)):
                self._poses[number], likelihoods[number] = self._draw(number, beams)
        self._weights += likelihoods
        self._totals += likelihoods

    def _likelihoods(self, number: int, poses: Floats, beams: _Beams) -> Floats:
        maps = self._maps
        return likelihoods_around(
            maps.cells, maps.walls, maps.tables[number], poses, beams.to_match, self._sensor
        )

    def _draw(self, number: int, beams: _Beams) -> tuple[Floats, float]:
        """Draw a particle's pose from the improved proposal (equations 12 to 17 of the paper).

        Returns
        -------
        pose (3,) [m, m, rad], and the logarithm of the mean of scan likelihood times motion probability
        """
        p = self.parameters
        assert self._odometry is not None
        motion = replace(self._used_odometry.inverse() @ self._odometry, theta=self._turned)
        expected = moved(self._past_poses[-1][number][None], np.array([motion.x, motion.y, motion.theta]))[0]
        # Odometry cannot be trusted to less than the distance of the samples.
        spread = np.maximum(motion_noise(motion, p), (p.llsamplestep, p.llsamplestep, p.lasamplestep))
        around = self._poses[number] + _offsets(p)
        difference = around - expected
        c, s = math.cos(self._past_poses[-1][number][2]), math.sin(self._past_poses[-1][number][2])
        along = np.column_stack(
            [
                c * difference[:, 0] + s * difference[:, 1],
                c * difference[:, 1] - s * difference[:, 0],
                difference[:, 2],
            ]
        )
        log = self._likelihoods(number, self._maps.lattice(around), beams)
        log -= 0.5 * np.square(along / spread).sum(axis=1)
        top = log.max()
        weights = np.exp(log - top)
        share = weights / weights.sum()
        mean = share @ around
        away = around - mean
        covariance = (share[:, None] * away).T @ away
        values, axes = np.linalg.eigh(covariance)
        drawn = mean + axes @ (np.sqrt(np.maximum(values, 0.0)) * self._rng.standard_normal(3))
        return drawn, float(top + math.log(weights.mean()))

    # ------------------------------------------------------------------ answers
    @property
    def best(self) -> int:
        """The particle whose whole past explains all scans best."""
        return int(np.argmax(self._totals))

    @property
    def T_map_odom(self) -> Pose2:
        """What takes odometry's frame to the map's; changes with every scan that is used."""
        if not self._stamps:
            return Pose2()
        x, y, theta = self._past_poses[-1][self.best]
        return Pose2(x, y, theta) @ self._used_odometry.inverse()

    @property
    def pose(self) -> Pose2:
        """T_map_base at the last scan, whether it was used or not."""
        return self.T_map_odom @ (self._odometry or Pose2())

    @property
    def has_map(self) -> bool:
        """Whether any scan with a valid beam was used yet."""
        return bool(self._maps.tables[self.best].any())

    def map(self) -> OccupancyGrid:
        """Return the best particle's map, cut to what is known.

        Its cells are 0, 100 and -1, as the node publishes them. Its stamp is that of the last scan in it.

        Raises
        ------
        ValueError
            `has_map` is not true yet.
        """
        stamp = self._stamps[-1] if self._stamps else None
        return self._maps.grid(self.best, self.parameters.occ_thresh, stamp)

    def trajectory(self) -> Trajectory:
        """Return the best particle's whole path: T_map_base at every scan that was used."""
        number = self.best
        poses = np.empty((len(self._stamps), 3))
        for step in reversed(range(len(self._stamps))):
            poses[step] = self._past_poses[step][number]
            number = int(self._parents[step][number])
        poses[:, 2] = [wrap_angle(theta) for theta in poses[:, 2]]
        return Trajectory(np.array(self._stamps), poses)


def _offsets(p: GMappingParameters) -> Floats:
    """Return the offsets (n, 3) [m, m, rad] at which the improved proposal asks for the likelihood."""
    line, turn = (
        np.arange(-round_down, round_down + 1) * step
        for round_down, step in (
            (math.floor(p.llsamplerange / p.llsamplestep + 1e-9), p.llsamplestep),
            (math.floor(p.lasamplerange / p.lasamplestep + 1e-9), p.lasamplestep),
        )
    )
    return np.stack(np.meshgrid(line, line, turn, indexing="ij"), axis=-1).reshape(-1, 3)


def prepare() -> None:
    """Have the inner loops compiled now, which takes a while the first time after an installation.

    Otherwise the first scans wait for it. The outcome is kept on disk for later runs.

    Raises
    ------
    MissingExtraError
        numba is not installed.
    """
    parameters = GMappingParameters(particles=2, linearUpdate=0.0, proposal="sampled")
    slam = GMapping(Laser(8, -1.0, 0.25, 5.0), parameters)
    ranges = np.full(8, 1.0, np.float32)
    for stamp in range(2):
        slam.add(Scan(float(stamp), Pose2(), ranges))
