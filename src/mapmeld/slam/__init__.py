"""Simultaneous localisation and mapping with a laser: GMapping's method; extra "sim".

`GMapping` takes scans and has the map, the pose and the trajectory; `map_history` gives the map as it
grows.
"""

from mapmeld.slam.gmapping import GMapping, ScanError, Trajectory, prepare
from mapmeld.slam.history import map_history, states
from mapmeld.slam.parameter_file import ParameterFile, ParameterFileError, read_parameters
from mapmeld.slam.parameters import GMappingParameters
from mapmeld.slam.shared_maps import MapTooLargeError
from mapmeld.slam.tum import write_trajectory

__all__ = [
    "GMapping",
    "GMappingParameters",
    "MapTooLargeError",
    "ParameterFile",
    "ParameterFileError",
    "ScanError",
    "Trajectory",
    "map_history",
    "prepare",
    "read_parameters",
    "states",
    "write_trajectory",
]
