"""Parameters of the node: typed, described, most of them changeable while it runs.

Names that users of multirobot_map_merge know are theirs, where the meaning is the same.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

from mapmeld.errors import MapmeldError
from mapmeld.live import FleetSettings
from mapmeld.merging.graph import KnownPose
from mapmeld.ros.work import Limits
from mapmeld.se2 import Pose2

AUTO = "auto"
_NAMESPACE = re.compile(r"[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)  # what ROS has for names of topics


class ParameterError(MapmeldError):
    """A parameter that cannot have that value."""


@dataclass(frozen=True, slots=True)
class Described:
    """A parameter: its default, which gives the type, what it means, and its range.

    Attributes
    ----------
    fixed
        Whether it is read once, at the start.
    """

    default: bool | int | float | str | list[str]
    text: str
    low: float | None = None
    high: float | None = None
    fixed: bool = False


PARAMETERS: Mapping[str, Described] = {
    "robots": Described(
        [AUTO], "Namespaces of the robots; [auto]: every namespace with a map is one, as it appears."
    ),
    "robot_map_topic": Described("map", "Name of the maps' topics in the robots' namespaces.", fixed=True),
    "robot_map_updates_topic": Described(
        "map_updates", "Name of the topics of updates in the robots' namespaces.", fixed=True
    ),
    "robot_namespace": Described("", "Part of the namespace that robots found by [auto] must have."),
    "merged_map_topic": Described("merged_map", "Topic of the merged map.", fixed=True),
    "world_frame": Described("world", "Frame of the merged map."),
    "known_init_poses": Described(False, "Nothing is matched: robots lie where their known poses say."),
    "known_poses": Described(
        [""], "Start poses, each 'ROBOT X Y YAW [SIGMA_M SIGMA_RAD]' in metres and radians (or 90deg)."
    ),
    "merging_rate": Described(1.0, "Merged maps per second, at most [Hz].", 0.01, 30.0),
    "estimation_rate": Described(
        2.0, "How often new maps are handed to the matching, at most [Hz].", 0.01, 30.0
    ),
    "discovery_rate": Described(1.0, "How often robots are looked for [Hz].", 0.01, 10.0),
    "cpu_share": Described(1.0, "Share of one processor that matching may use, over time.", 0.01, 1.0),
    "max_cells": Described(64_000_000, "Larger maps are refused [cells].", 1, 400_000_000),
    "max_robots": Described(32, "So many robots are followed at most.", 1, 1000),
    "max_rate": Described(10.0, "A robot with more maps per second is warned of [Hz].", 0.1, 1000.0),
    "stale_after": Described(60.0, "A robot without a map for so long is marked stale [s].", 0.1, 1e6),
    "method": Described("correlative", "How maps are matched (mapmeld match --method)."),
    "fusion": Described(
        "colour", "What a cell becomes that several maps know (docs: colour, log-odds, ...)."
    ),
    "publish_tf": Described(True, "Whether world -> map of each robot is published on /tf_static."),
    "save_path": Described(
        "merged_map", "Where save_map writes: PATH.yaml and PATH.pgm; %Y %m %d %H %M %S are the time."
    ),
    "save_overwrite": Described(False, "Whether save_map replaces files."),
}


def unknown(names: Iterable[str]) -> list[str]:
    """Return a sentence for each of these names of parameters, which the node does not have."""
    sentences = []
    for name in names:
        if not name.startswith("qos_overrides."):  # ROS's own, for the topics that a node lets it change
            near = get_close_matches(name, PARAMETERS, 1, cutoff=0.7)
            hint = f"; did you mean {near[0]}?" if near else ""
            sentences.append(f"there is no parameter {name}, it is not used{hint}")
    return sentences


def fleet_settings(values: Mapping[str, Any]) -> FleetSettings:
    """Return the settings of the fleet.

    Raises
    ------
    ParameterError
        A value is none that is possible.
    """
    try:
        return FleetSettings(
            method=values["method"],
            matching=not values["known_init_poses"],
            fusion=values["fusion"],
            world_frame=values["world_frame"],
        )
    except ValueError as error:
        raise ParameterError(str(error)) from error


def limits(values: Mapping[str, Any]) -> Limits:
    """Return what bounds the work."""
    return Limits(values["max_cells"], values["max_robots"], values["cpu_share"])


def robot_names(values: Mapping[str, Any]) -> list[str] | None:
    """Return the robots that are named, without slashes around; None for those that appear.

    Raises
    ------
    ParameterError
        One is no namespace, or it says both auto and names.
    """
    names = [name.strip().strip("/") for name in values["robots"]]
    names = [name for name in names if name]
    if not names or names == [AUTO]:
        return None
    if AUTO in names:
        raise ParameterError("robots: [auto], or names, not both")
    for name in names:
        if not _NAMESPACE.fullmatch(name) or "__" in name:
            raise ParameterError(
                f"robots: {name[:80]!r} is no namespace, which has letters, digits and single _ only, "
                "and parts with / in between that do not begin with a digit"
            )
    return list(dict.fromkeys(names))


def known_poses(values: Mapping[str, Any]) -> dict[str, KnownPose]:
    """Return the poses in parameter ``known_poses``."""
    return dict(pose_in_words(text) for text in values["known_poses"] if text.strip())


def pose_in_words(text: str) -> tuple[str, KnownPose]:
    """Read ``ROBOT X Y YAW [SIGMA_M SIGMA_RAD]``: metres and radians; angles also as ``90deg``.

    Raises
    ------
    ParameterError
        It is not of this form.
    """
    name, *words = text.split()[:7] or [""]
    try:
        if len(words) not in (3, 5) or len(text.split()) > 6:
            raise ValueError
        numbers = [_number(word, angle=i in (2, 4)) for i, word in enumerate(words)]
        sigmas = numbers[3:] or [0.0, 0.0]
        return name.strip("/"), KnownPose(Pose2(*numbers[:3]), *sigmas)
    except ValueError:
        raise ParameterError(
            f"a known pose is 'ROBOT X Y YAW' or 'ROBOT X Y YAW SIGMA_M SIGMA_RAD', angles in radians or as "
            f"90deg, not {text[:80]!r}"
        ) from None


def _number(word: str, *, angle: bool) -> float:
    degrees = angle and word.endswith("deg")
    number = float(word.removesuffix("deg") if degrees else word)
    if not abs(number) < 1e9:
        raise ValueError
    return math.radians(number) if degrees else number


def two_robots(text: str) -> tuple[str, str]:
    """Read ``ROBOT ROBOT``.

    Raises
    ------
    ParameterError
        They are not two.
    """
    names = [name.strip("/") for name in text.replace(",", " ").split()]
    if len(names) != 2:
        raise ParameterError(f"two robots are needed, as 'robot_1 robot_2', not {text[:80]!r}")
    return names[0], names[1]
