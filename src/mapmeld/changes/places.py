"""Points, poses and polygons that were drawn on a map, in a YAML file, and the same in another map's frame.

.. code-block:: yaml

    points:
      - {name: charger, x: 1.2, y: 3.4}
    poses:
      - {name: dock, x: 0.5, y: -1.0, yaw: 1.5708}
    polygons:
      - {name: kitchen, points: [[0, 0], [4, 0], [4, 3]]}

Metres and radians; names may be left out. What this form does not know is refused, as it could be
something that has to be carried over too.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NoReturn

from mapmeld.io import AnyPath, MapFileError
from mapmeld.io.plain_yaml import Scalar, Tree, read_tree, short
from mapmeld.se2 import Pose2, wrap_angle

MAX_BYTES = 1 << 20
"""Largest YAML file that is read, about 20,000 points; GeoJSON takes more."""

DIGITS = 9
"""Digits after the point that are written: nanometres, nanoradians."""

GREATEST = 1e9
"""Greatest coordinate [m] that is taken; beyond it, nanometres are not told apart any more."""

_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?", re.ASCII)
_SHAPES: Mapping[str, tuple[str, ...]] = {
    "points": ("x", "y"),
    "poses": ("x", "y", "yaw"),
    "polygons": ("points",),
}


@dataclass(frozen=True, slots=True)
class Place:
    """A point, a pose or a polygon.

    Attributes
    ----------
    name
        What it is called; None if it has no name.
    corners
        (x, y) [m]: one of a point or pose, three or more of a polygon.
    yaw
        Heading of a pose [rad].
    """

    name: str | None
    corners: tuple[tuple[float, float], ...]
    yaw: float | None = None

    def moved(self, T: Pose2) -> Place:
        """Return the same place in the frame that `T` takes points to."""
        corners = tuple((float(x), float(y)) for x, y in T.apply(self.corners))
        return Place(self.name, corners, None if self.yaw is None else wrap_angle(self.yaw + T.theta))


Places = dict[str, list[Place]]
"""The lists of the file, "points", "poses" and "polygons", as far as it has them."""


def read_places(path: AnyPath) -> Places:
    """Read a YAML file of points, poses and polygons.

    Raises
    ------
    MapFileError
        It cannot be read or is not of this form.
    """
    tree = read_tree(path, "a file of points", depth=5, max_bytes=MAX_BYTES)
    places: Places = {}
    for kind, items in tree.items():
        if kind not in _SHAPES:
            _fail(path, f"has {short(kind)}, which is none of points, poses, polygons")
        if not isinstance(items, list):
            _fail(path, f"its '{kind}' is not a list")
        places[kind] = [_place(path, kind, number, item) for number, item in enumerate(items, start=1)]
    return places


def moved_places(places: Places, T: Pose2) -> Places:
    """Return all places in the frame that `T` takes points to."""
    return {kind: [place.moved(T) for place in items] for kind, items in places.items()}


def places_text(places: Places) -> str:
    """Return the YAML file of points, poses and polygons, one to a line."""
    lines: list[str] = []
    for kind, items in places.items():
        lines.append(f"{kind}:" if items else f"{kind}: []")
        for place in items:
            fields = [] if place.name is None else [f"name: {_quoted(place.name)}"]
            corners = [(_written(x), _written(y)) for x, y in place.corners]
            if kind == "polygons":
                fields.append(f"points: [{', '.join(f'[{x}, {y}]' for x, y in corners)}]")
            else:
                fields += [f"x: {corners[0][0]}", f"y: {corners[0][1]}"]
            if place.yaw is not None:
                fields.append(f"yaw: {_written(place.yaw)}")
            lines.append(f"  - {{{', '.join(fields)}}}")
    return "\n".join(lines) + "\n"


def rounded(value: float) -> float:
    """Return a coordinate with the digits that are written, never -0."""
    return round(value, DIGITS) + 0.0


def _written(value: float) -> str:
    # YAML 1.1 takes 1e-07 and 1e+22 for words; they want a dot.
    text = repr(rounded(value))
    return text if "." in text or "e" not in text else text.replace("e", ".0e")


def _quoted(name: str) -> str:
    plain = re.fullmatch(r"[A-Za-z][\w-]*", name, re.ASCII) is not None
    word = name.lower() in ("null", "true", "false", "yes", "no", "on", "off", "y", "n")
    if plain and not word:
        return name
    text = json.dumps(name, ensure_ascii=False)
    return "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in text)


def _place(path: AnyPath, kind: str, number: int, item: Tree) -> Place:
    where = f"entry {number} of its '{kind}'"
    needed = _SHAPES[kind]
    if not isinstance(item, dict):
        _fail(path, f"{where} is not of the form {{name: ..., {', '.join(f'{key}: ...' for key in needed)}}}")
    for key in item:
        if key not in ("name", *needed):
            _fail(path, f"{where} has {short(key)}, which is none of name, {', '.join(needed)}")
    for key in needed:
        if key not in item:
            _fail(path, f"{where} has no '{key}'")
    called = item.get("name")
    if called is not None and not isinstance(called, Scalar):
        _fail(path, f"{where} has a name that is not a text")
    name = None if called is None else called.value
    if name is not None and any("\ud800" <= c <= "\udfff" for c in name):
        _fail(path, f"{where} has a name that is not Unicode text")
    if kind == "polygons":
        corners = item["points"]
        if not isinstance(corners, list) or len(corners) < 3:
            _fail(path, f"{where} is not a list of three points or more")
        return Place(name, tuple(_corner(path, where, corner) for corner in corners))
    values = [_number(path, where, item[key]) for key in needed]
    return Place(name, ((values[0], values[1]),), values[2] if kind == "poses" else None)


def _corner(path: AnyPath, where: str, corner: Tree) -> tuple[float, float]:
    if not isinstance(corner, list) or len(corner) != 2:
        _fail(path, f"{where} has a point that is not of the form [x, y]")
    return _number(path, where, corner[0]), _number(path, where, corner[1])


def _number(path: AnyPath, where: str, value: Tree) -> float:
    if not isinstance(value, Scalar) or value.quoted or not _NUMBER.fullmatch(value.value):
        said = short(value.value) if isinstance(value, Scalar) else "a list or mapping"
        _fail(path, f"{where} has {said} in place of a number")
    number = float(value.value)
    if not abs(number) <= GREATEST:
        _fail(path, f"{where} has {short(value.value)}, which is too large")
    return number


def _fail(path: AnyPath, problem: str) -> NoReturn:
    raise MapFileError.of(path, problem)
