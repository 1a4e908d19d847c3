"""The simulated robot: a differential drive with a laser, of the paper's kind (section 3.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mapmeld.recording import Laser
from mapmeld.se2 import Pose2

PAPER_LASER = Laser(
    beams=684,
    first_angle=-math.radians(120.0),
    step=math.radians(240.0) / 683,
    max_range=5.0,
    T_base_laser=Pose2(0.08, 0.0, 0.0),
)
"""240 degrees and 5 m as in the paper, with the beams of V-REP's fast Hokuyo."""


@dataclass(frozen=True, slots=True)
class Robot:
    """A robot's build; base frame: between the driven wheels, x ahead.

    Attributes
    ----------
    max_v, max_w
        Fastest drive [m/s] and turn [rad/s]; the paper's.
    acceleration, turn_acceleration
        What its motor controller allows [m/s^2], [rad/s^2].
    radius
        Of its round body [m].
    height
        Of the body [m]; other robots' lasers see it.
    mass
        [kg]
    wheel_radius, wheel_width, track
        Of the driven wheels, and the distance of their middles [m].
    wheel_friction
        Coefficient of friction of tyre on floor, on average: see `Grip`.
    motor_torque
        Most that a motor gives [N m].
    encoder_ticks
        Of a wheel's full turn.
    laser
        The scanner.
    laser_height
        Of its plane above the floor [m].
    range_sigma
        Standard deviation of a range [m].
    min_range
        Shortest range measured [m].
    scan_rate
        Scans in a second [Hz].
    """

    max_v: float = 0.8
    max_w: float = 1.61
    acceleration: float = 2.5
    turn_acceleration: float = 8.0
    radius: float = 0.2
    height: float = 0.3
    mass: float = 9.0
    wheel_radius: float = 0.06
    wheel_width: float = 0.03
    track: float = 0.3
    wheel_friction: float = 0.5
    motor_torque: float = 1.0
    encoder_ticks: int = 4096
    laser: Laser = PAPER_LASER
    laser_height: float = 0.22
    range_sigma: float = 0.01
    min_range: float = 0.02
    scan_rate: float = 10.0


MECABOT = Robot()
"""After the paper's robot; its build is our own, as the paper gives the laser and the speeds only."""
