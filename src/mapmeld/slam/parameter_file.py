"""Parameter files of the ROS node, as they are."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple, get_type_hints

from mapmeld.errors import MapmeldError
from mapmeld.io import AnyPath, MapFileError
from mapmeld.io.plain_yaml import read_fields, short
from mapmeld.slam.parameters import GMappingParameters

NODE_ONLY = frozenset(
    {
        "base_frame", "map_frame", "odom_frame", "scan_topic", "throttle_scans", "map_update_interval",
        "transform_publish_period", "tf_delay", "inverted_laser", "use_sim_time",
    }
)  # fmt: skip
"""Parameters of the node that do not concern the mapping itself."""

_DEPTH = 4


class ParameterFileError(MapmeldError):
    """A parameter file that cannot be used; the message names it."""


class ParameterFile(NamedTuple):
    """What a file sets: `GMappingParameters` by name, and those of the node alone, which are passed over."""

    settings: dict[str, Any]
    passed_over: tuple[str, ...]

    def parameters(self) -> GMappingParameters:
        """Return the parameters, those that the file does not name at their defaults.

        Raises
        ------
        ValueError
            They contradict one another or are out of range.
        """
        return GMappingParameters(**self.settings)


def read_parameters(path: AnyPath) -> ParameterFile:
    """Read a YAML file with parameters of ``slam_gmapping``.

    Both forms: ``name: value`` lines as in ROS 1, and below a node's name (and ``ros__parameters``, ROS 2).

    Raises
    ------
    ParameterFileError
        The file cannot be read, or has a name that the node has not, or a value of another kind.
    """
    try:
        found = read_fields(path, "a file of parameters", depth=_DEPTH, may_be_empty=True)
    except MapFileError as error:
        raise ParameterFileError(str(error)) from error
    values: Mapping[Any, Any] = {}
    if found:
        import yaml

        # Known by now to be small, without aliases and tags, and not to be nested deep.
        values = next(yaml.safe_load_all(Path(path).read_text(encoding="utf-8")))
    known = get_type_hints(GMappingParameters)
    names = [field.name for field in fields(GMappingParameters)]
    while len(values) == 1:
        ((name, inner),) = values.items()
        if name in names or not isinstance(inner, Mapping):
            break
        values = inner
    settings: dict[str, Any] = {}
    for name, value in values.items():
        if name in NODE_ONLY:
            continue
        if name not in names:
            near = difflib.get_close_matches(str(name)[:100], names, n=3, cutoff=0.5)
            hint = f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(names)}"
            raise ParameterFileError(f"{path}: slam_gmapping has no parameter {short(str(name))}; {hint}")
        try:
            settings[name] = _converted(value, known[name])
        except (TypeError, ValueError, OverflowError):
            raise ParameterFileError(
                f"{path}: {name} must be {_KINDS.get(known[name], 'a number')}, not {short(str(value))}"
            ) from None
    return ParameterFile(settings, tuple(name for name in values if name in NODE_ONLY))


_KINDS = {int: "a whole number", GMappingParameters.__annotations__["proposal"]: "matched or sampled"}


def _converted(value: object, kind: object) -> object:
    if kind is int:
        if isinstance(value, bool) or float(str(value)) % 1:
            raise ValueError
        return int(float(str(value)))
    if kind in (float, float | None):
        if value is None and kind is not float:
            return None
        if isinstance(value, bool):
            raise ValueError
        # As text: YAML 1.1 takes 1e-3 for a word.
        number = float(str(value))
        if math.isnan(number):
            raise ValueError
        return number
    return str(value)
