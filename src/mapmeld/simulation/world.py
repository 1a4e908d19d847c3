"""The world that robots drive in: an environment, robots, and time that passes in steps (MuJoCo)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapmeld.extras import required
from mapmeld.recording import Scan
from mapmeld.se2 import Pose2
from mapmeld.simulation.environment import Environment
from mapmeld.simulation.errors import SimulationError
from mapmeld.simulation.grip import Grip
from mapmeld.simulation.mjcf import TIMESTEP, mjcf
from mapmeld.simulation.odometry import WheelOdometry
from mapmeld.simulation.robot import MECABOT, Robot

CONTROL_PERIOD = 0.025
"""How often [s] the robots' motor controllers set wheel speeds and read the encoders."""


class World:
    """Robots of one build in an environment.

    Parameters
    ----------
    environment
        What they drive in.
    robots
        Where their base frames are at first, in the environment's frame.
    seed
        Of the lasers' noise.
    build
        Of all robots.

    Raises
    ------
    SimulationError
        A robot would start outside the ground, or inside something.
    MissingExtraError
        MuJoCo is not installed.
    """

    def __init__(
        self, environment: Environment, robots: Sequence[Pose2], seed: int = 0, build: Robot = MECABOT
    ) -> None:
        self._mj: Any = required("mujoco", "sim")
        self.environment = environment
        self.starts = tuple(robots)
        self.build = build
        self.time = 0.0
        self._model: Any = self._mj.MjModel.from_xml_string(mjcf(environment, self.starts, build))
        self._data: Any = self._mj.MjData(self._model)
        self._rngs = [np.random.default_rng((seed, index)) for index in range(len(self.starts))]
        self._wanted = np.zeros((len(self.starts), 2))
        self._set = np.zeros((len(self.starts), 2))
        self._bodies = [self._model.body(f"robot_{i}").id for i in range(len(self.starts))]
        self._lasers = [self._model.site(f"robot_{i}_laser").id for i in range(len(self.starts))]
        self._poses_at = [int(self._model.joint(f"robot_{i}").qposadr[0]) for i in range(len(self.starts))]
        self._wheels_at = np.array(
            [
                [int(self._model.joint(f"robot_{i}_{side}").qposadr[0]) for side in ("left", "right")]
                for i in range(len(self.starts))
            ],
            np.int64,
        ).reshape(-1, 2)
        self._motors = np.array(
            [
                [self._model.actuator(f"robot_{i}_{side}").id for side in ("left", "right")]
                for i in range(len(self.starts))
            ],
            np.int64,
        ).reshape(-1, 2)
        self._tyres = [
            (self._model.body(name).id, self._model.geom(name).id)
            for i in range(len(self.starts))
            for name in (f"robot_{i}_left", f"robot_{i}_right")
        ]
        self._grip = Grip(environment)
        self._odometry = [WheelOdometry(build) for _ in self.starts]
        bearings = build.laser.bearings()
        self._beams = np.stack([np.cos(bearings), np.sin(bearings), np.zeros_like(bearings)])
        self._met = np.empty(build.laser.beams, np.int32)
        self._distances = np.empty(build.laser.beams)
        self._settle()

    def _settle(self) -> None:
        """Let the robots sink onto their wheels before anything counts."""
        self._mj.mj_forward(self._model, self._data)
        for index, start in enumerate(self.starts):
            width, height = self.environment.size
            if not (0 <= start.x <= width and 0 <= start.y <= height):
                raise SimulationError(f"robot {index + 1} would start outside the ground, at {start}")
        obstacles = {self._model.geom(f"robot_{i}").id: i for i in range(len(self.starts))}
        for contact in self._data.contact:
            for geom in contact.geom:
                if int(geom) in obstacles and contact.dist < 0:
                    robot = obstacles[int(geom)]
                    raise SimulationError(
                        f"robot {robot + 1} would start inside something, at {self.starts[robot]}"
                    )
        self._mj.mj_step(self._model, self._data, nstep=round(0.5 / TIMESTEP))
        # The first readings of the encoders are where odometry begins.
        for index, odometry in enumerate(self._odometry):
            odometry.begin(*self._data.qpos[self._wheels_at[index]])
        self._start_poses = [self.true_pose(i) for i in range(len(self.starts))]

    # ------------------------------------------------------------------ to drive
    def command(self, robot: int, v: float, w: float) -> None:
        """Ask a robot for a speed [m/s] and a turn rate [rad/s]; cut to what it can do."""
        if not (math.isfinite(v) and math.isfinite(w)):
            raise ValueError(f"speeds must be finite, not {v}, {w}")
        build = self.build
        self._wanted[robot] = np.clip((v, w), (-build.max_v, -build.max_w), (build.max_v, build.max_w))

    def step(self, dt: float) -> None:
        """Let `dt` seconds pass: whole periods of the motor controllers of 0.025 s."""
        periods = round(dt / CONTROL_PERIOD)
        if periods < 1 or not math.isclose(periods * CONTROL_PERIOD, dt, rel_tol=1e-6):
            raise ValueError(f"time passes in steps of {CONTROL_PERIOD} s, not {dt}")
        build = self.build
        most = np.array((build.acceleration, build.turn_acceleration)) * CONTROL_PERIOD
        for _ in range(periods):
            self._set += np.clip(self._wanted - self._set, -most, most)
            half = self._set[:, 1] * build.track / 2
            self._data.ctrl[self._motors[:, 0]] = (self._set[:, 0] - half) / build.wheel_radius
            self._data.ctrl[self._motors[:, 1]] = (self._set[:, 0] + half) / build.wheel_radius
            self._feel_floor()
            self._mj.mj_step(self._model, self._data, nstep=round(CONTROL_PERIOD / TIMESTEP))
            for odometry, at in zip(self._odometry, self._wheels_at, strict=True):
                odometry.read(*self._data.qpos[at])
        self.time += periods * CONTROL_PERIOD

    def _feel_floor(self) -> None:
        """Give each tyre the friction of the place that it stands on."""
        for body, geom in self._tyres:
            x, y, _ = self._data.xpos[body]
            self._model.geom_friction[geom, 0] = self.build.wheel_friction * self._grip.at(float(x), float(y))

    # ------------------------------------------------------------------ to look
    def true_pose(self, robot: int) -> Pose2:
        """Return where a robot's base frame is in the environment's frame."""
        at = self._poses_at[robot]
        x, y, _, qw, qx, qy, qz = self._data.qpos[at : at + 7]
        return Pose2(float(x), float(y), math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz)))

    def odometry(self, robot: int) -> Pose2:
        """Return where a robot believes itself to be from its wheels; it starts at (0, 0, 0)."""
        return self._odometry[robot].pose

    def scan(self, robot: int) -> Scan:
        """Return what a robot's laser sees now: furniture, walls and other robots; inf for nothing."""
        site = self._lasers[robot]
        beams: NDArray[np.float64] = (self._data.site_xmat[site].reshape(3, 3) @ self._beams).T
        self._mj.mj_multiRay(
            self._model, self._data, self._data.site_xpos[site], beams.reshape(-1), None, True,
            self._bodies[robot], self._met, self._distances, None, len(beams),
            self.build.laser.max_range + 1.0,
        )  # fmt: skip
        ranges = self._distances + self._rngs[robot].normal(0.0, self.build.range_sigma, len(beams))
        ranges[self._met < 0] = np.inf
        ranges[ranges > self.build.laser.max_range] = np.inf
        ranges[ranges < self.build.min_range] = 0.0
        return Scan(self.time, self.odometry(robot), ranges.astype(np.float32))
