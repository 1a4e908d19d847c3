"""Poses of maps that are known beforehand, and the file in which a user writes them down.

::

    # where each map's frame lies in one common frame: metres, and degrees or radians as the key says
    ground_floor.yaml: {x: 0, y: 0, theta_deg: 0}
    garage.yaml: {x: 12.5, y: -3, theta_rad: 1.5708, sigma_m: 0.5, sigma_deg: 5}
    matching: off
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mapmeld.errors import MapmeldError
from mapmeld.io import MapFileError, printable
from mapmeld.io.plain_yaml import Fields, Scalar, Value, read_fields, short
from mapmeld.merging.graph.edges import Doubles
from mapmeld.se2 import Pose2

EXACT = 1e-6
"""Deviation [m, rad] of a pose that is known exactly; 0 would be no covariance."""

MOST_TURNS = 2
"""An angle beyond that many turns is taken for degrees that were meant as radians."""

_ANGLES = ("theta_deg", "theta_rad", "yaw_deg", "yaw_rad")
_SIGMA_ANGLES = ("sigma_deg", "sigma_rad")
_KEYS = ("x", "y", *_ANGLES, "sigma_m", *_SIGMA_ANGLES)


class KnownPosesError(MapmeldError):
    """Known poses that cannot be read or do not belong to the maps."""


@dataclass(frozen=True, slots=True)
class KnownPose:
    """Where a map's frame lies in a frame that all known poses share.

    A SLAM map's frame usually starts where its robot started, so this is the robot's start pose.

    Attributes
    ----------
    T_w_i
        Takes a point of the map's frame into the common frame.
    sigma_metres, sigma_theta
        Standard deviations [m, rad] of x and y, and of the angle; 0: exact.
    """

    T_w_i: Pose2
    sigma_metres: float = 0.0
    sigma_theta: float = 0.0

    def __post_init__(self) -> None:
        numbers = (self.T_w_i.x, self.T_w_i.y, self.T_w_i.theta, self.sigma_metres, self.sigma_theta)
        if not all(map(math.isfinite, numbers)):
            raise ValueError("a known pose must be finite")
        if abs(self.T_w_i.theta) > MOST_TURNS * math.tau:
            raise ValueError(
                f"an angle of {self.T_w_i.theta:g} rad is more than {MOST_TURNS} turns: degrees?"
            )
        if self.sigma_metres < 0 or self.sigma_theta < 0:
            raise ValueError("a standard deviation cannot be negative")

    def covariance(self) -> Doubles:
        """Return the covariance (3, 3) of (x, y, theta)."""
        xy, theta = max(self.sigma_metres, EXACT), max(self.sigma_theta, EXACT)
        return np.diag([xy**2, xy**2, theta**2])


def read_known_poses(path: Path, maps: Sequence[str]) -> tuple[dict[int, KnownPose], bool]:
    """Read the known poses of maps from a YAML file.

    Parameters
    ----------
    path
        A file as in the head of this module: an entry for each map whose pose is known, named as in `maps`
        or by an end of its path that no other map shares; `matching: off` to use nothing else.
    maps
        The maps' paths, in order.

    Returns
    -------
    tuple
        Known poses by the maps' indices, and whether maps are to be matched.

    Raises
    ------
    KnownPosesError
        The file cannot be read, names no map or one that is not there, or a pose is not complete.
    """
    try:
        found = read_fields(path, "a file of known poses", depth=2)
    except MapFileError as error:
        raise KnownPosesError(str(error)) from error
    matching = True
    known: dict[int, KnownPose] = {}
    for name, value in found.items():
        if name == "matching":
            matching = _switch(path, value)
            continue
        index = _index(path, name, maps)
        if index in known:
            raise KnownPosesError(printable(f"{path}: gives the pose of {maps[index]} twice"))
        known[index] = _pose(f"{path}: {name}", value)
    if not known:
        raise KnownPosesError(
            printable(f"{path}: holds no pose; write an entry such as map.yaml: {_EXAMPLE}")
        )
    return known, matching


_EXAMPLE = "{x: 1.5, y: 0, theta_deg: 90}"


def _switch(path: Path, value: Value) -> bool:
    words = {"on": True, "true": True, "yes": True, "off": False, "false": False, "no": False}
    word = value.value.lower() if isinstance(value, Scalar) else ""
    if word not in words:
        raise KnownPosesError(printable(f"{path}: matching must be on or off"))
    return words[word]


def _index(path: Path, name: str, maps: Sequence[str]) -> int:
    exact = [i for i, text in enumerate(maps) if text == name]
    ends = Path(name).parts
    near = exact or [i for i, text in enumerate(maps) if ends and Path(text).parts[-len(ends) :] == ends]
    if len(near) != 1:
        problem = "names no map of this call" if not near else "fits several maps; write more of the path"
        raise KnownPosesError(
            printable(f"{path}: {short(name)} {problem} (there are: {', '.join(map(str, maps))})")
        )
    return near[0]


def _pose(where: str, value: Value) -> KnownPose:
    if not isinstance(value, Fields):
        raise KnownPosesError(printable(f"{where}: a pose is needed, as {_EXAMPLE}"))
    for key in value.of:
        if key not in _KEYS:
            raise KnownPosesError(printable(f"{where}: no key {short(key)} (there are: {', '.join(_KEYS)})"))
    numbers = {key: _number(where, key, text) for key, text in value.of.items()}
    angle = _one_of(where, numbers, _ANGLES)
    sigmas = [key for key in numbers if key.startswith("sigma")]
    sigma_metres = sigma_theta = 0.0
    if sigmas:
        if "sigma_m" not in numbers:
            raise KnownPosesError(printable(f"{where}: sigma_m is missing beside {sigmas[0]}"))
        sigma_metres, sigma_theta = numbers["sigma_m"], _one_of(where, numbers, _SIGMA_ANGLES)
    for key in ("x", "y"):
        if key not in numbers:
            raise KnownPosesError(printable(f"{where}: {key} is missing [m]"))
    try:
        return KnownPose(Pose2(numbers["x"], numbers["y"], angle), sigma_metres, sigma_theta)
    except ValueError as error:
        raise KnownPosesError(printable(f"{where}: {error}")) from error


def _one_of(where: str, numbers: Mapping[str, float], keys: Sequence[str]) -> float:
    """Return the angle [rad] that one of the keys gives in its unit."""
    given = [key for key in keys if key in numbers]
    if len(given) != 1:
        raise KnownPosesError(printable(f"{where}: exactly one of {', '.join(keys)} is needed"))
    value = numbers[given[0]]
    return math.radians(value) if given[0].endswith("_deg") else value


def _number(where: str, key: str, value: object) -> float:
    try:
        number = float(value.value) if isinstance(value, Scalar) else math.nan
    except ValueError:
        number = math.nan
    # Beyond that it is no place on Earth; nan is not below it.
    if not abs(number) < 1e9:
        raise KnownPosesError(printable(f"{where}: {key} must be a number"))
    return number
