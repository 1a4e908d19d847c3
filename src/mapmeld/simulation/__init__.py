"""Random indoor environments, and robots that drive in them (extra ``sim``).

Environments need no extra; `World` needs MuJoCo, recordings need mcap and rosbags.
"""

from mapmeld.simulation.boxes import Box
from mapmeld.simulation.commanded import CommandedDriver
from mapmeld.simulation.driving import STOP, TICK, Command, Driver, Moment, Sight, drive
from mapmeld.simulation.environment import Environment, Furniture, Kind
from mapmeld.simulation.errors import SimulationError
from mapmeld.simulation.frontier import FrontierDriver, Mapper
from mapmeld.simulation.furnishing import furnish
from mapmeld.simulation.generator import Settings, generate
from mapmeld.simulation.keyboard import KeyboardDriver
from mapmeld.simulation.known_poses import KnownPoseMapper
from mapmeld.simulation.mjcf import mjcf
from mapmeld.simulation.robot import MECABOT, PAPER_LASER, Robot
from mapmeld.simulation.route import CommandLogDriver, Route, read_route
from mapmeld.simulation.tour import FloorPlan, Tour, TourDriver, plan_tours
from mapmeld.simulation.true_map import true_map
from mapmeld.simulation.vrep_files import (
    Configuration,
    read_configuration,
    read_map_text,
    write_configuration,
    write_map_text,
)
from mapmeld.simulation.world import World

__all__ = [
    "MECABOT",
    "PAPER_LASER",
    "STOP",
    "TICK",
    "Box",
    "Command",
    "CommandLogDriver",
    "CommandedDriver",
    "Configuration",
    "Driver",
    "Environment",
    "FloorPlan",
    "FrontierDriver",
    "Furniture",
    "KeyboardDriver",
    "Kind",
    "KnownPoseMapper",
    "Mapper",
    "Moment",
    "Robot",
    "Route",
    "Settings",
    "Sight",
    "SimulationError",
    "Tour",
    "TourDriver",
    "World",
    "drive",
    "furnish",
    "generate",
    "mjcf",
    "plan_tours",
    "read_configuration",
    "read_map_text",
    "read_route",
    "true_map",
    "write_configuration",
    "write_map_text",
]
