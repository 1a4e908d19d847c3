"""Maps and patches of maps as ROS sends them, made into what mapmeld works with."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from mapmeld.errors import MapmeldError
from mapmeld.extras import required
from mapmeld.grid import OCCUPIED, UNKNOWN, Cells, OccupancyGrid
from mapmeld.io import MapFileError
from mapmeld.io.images import MAX_CELLS
from mapmeld.io.map_server import problem_of_origin
from mapmeld.se2 import Pose2

EXTRA = "bags"
GRID = "nav_msgs/msg/OccupancyGrid"
UPDATE = "map_msgs/msg/OccupancyGridUpdate"

CDR, ROS1 = "cdr", "ros1"
ENCODINGS = (CDR, ROS1)
"""The ways of writing messages that are read: those of ROS 2 and of ROS 1."""

# What the type stores of rosbags lack, one or both; the same in ROS 1 and ROS 2.
_UPDATE_DEFINITION = "std_msgs/Header header\nint32 x\nint32 y\nuint32 width\nuint32 height\nint8[] data\n"


_FRAMES_DEFINITION = "geometry_msgs/TransformStamped[] transforms\n"
TF = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")


class RecordingError(MapFileError):
    """A recording that cannot be read as asked; the message names it."""


class BadMessageError(MapmeldError):
    """A message that is no map, or no patch of one; says what is wrong, but not where."""


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """New values for a rectangle of a map.

    Attributes
    ----------
    row, col
        Of its lower left cell; may lie outside of the map.
    cells
        (rows, cols)
    stamp
        [s]
    stamped
        Whether the stamp is the message's own; else it is when that was received.
    """

    row: int
    col: int
    cells: Cells
    stamp: float
    stamped: bool = True


def grid_of(data: bytes, encoding: str, received: int) -> OccupancyGrid | None:
    """Return the map in an OccupancyGrid message; None for one without cells, which is not yet a map.

    The resolution, a 32-bit number in the message, becomes the shortest decimal that stands for it
    (0.05, not 0.05000000074505806). Values that mean nothing (below -1 or above 100) become unknown, as
    nav2's map_saver has it. An orientation that is not upright is projected onto the ground; one of all
    zeros, which is what an unset one looks like, is none.

    Parameters
    ----------
    data, encoding
        The message as it was recorded, and how it is written.
    received
        When [ns]; the stamp of a map whose header has none.

    Raises
    ------
    BadMessageError
        It cannot be decoded, or it is no map.
    """
    return grid_from_message(decoded(data, GRID, encoding), received)


def grid_from_message(message: Any, received: int) -> OccupancyGrid | None:
    """Return the map in an OccupancyGrid message that is decoded already, by whatever library; as `grid_of`.

    Raises
    ------
    BadMessageError
        It is no map.
    """
    info = message.info
    rows, cols = int(info.height), int(info.width)
    cells = _cells_of(message.data, rows, cols)
    if not cells.size:
        return None
    resolution = float(str(np.float32(info.resolution)))
    if not (math.isfinite(resolution) and resolution > 0):
        raise BadMessageError(f"a map with cells of {resolution} m")
    at = info.origin.position
    origin = Pose2(float(at.x), float(at.y), _yaw_of(info.origin.orientation))
    if not (math.isfinite(origin.x) and math.isfinite(origin.y)):
        raise BadMessageError(f"a map with its origin at ({origin.x}, {origin.y})")
    problem = problem_of_origin(origin, resolution)
    if problem is not None:
        raise BadMessageError(f"a map whose {problem}")
    return OccupancyGrid(
        cells, resolution, origin, stamp_of(message.header, received), str(message.header.frame_id)
    )


def patch_of(data: bytes, encoding: str, received: int) -> Patch:
    """Return the patch in an OccupancyGridUpdate message; parameters and errors as of `grid_of`."""
    return patch_from_message(decoded(data, UPDATE, encoding), received)


def patch_from_message(message: Any, received: int) -> Patch:
    """Return the patch in an OccupancyGridUpdate message that is decoded already; as `patch_of`."""
    cells = _cells_of(message.data, int(message.height), int(message.width))
    stamped = bool(message.header.stamp.sec or message.header.stamp.nanosec)
    return Patch(int(message.y), int(message.x), cells, stamp_of(message.header, received), stamped)


def own_stamp(grid: OccupancyGrid, received: int) -> float | None:
    """Return the stamp [s] of a map that was received then [ns]; None if its header had none."""
    return None if grid.stamp == seconds(received) else grid.stamp


def is_of_an_earlier_map(patch: Patch, since: float | None) -> bool:
    """Whether a patch is older than the whole map before it, whose own stamp is `since` [s].

    It is meant for the cells of a map before that one, which may have lain elsewhere.
    """
    return since is not None and patch.stamped and patch.stamp < since


def patched(grid: OccupancyGrid, patch: Patch) -> OccupancyGrid | None:
    """Return the map with a patch laid on, never older; None if it does not lie wholly within the map."""
    rows, cols = patch.cells.shape
    height, width = grid.shape
    if not (0 <= patch.row <= height - rows and 0 <= patch.col <= width - cols):
        return None
    cells = grid.cells.copy()
    cells[patch.row : patch.row + rows, patch.col : patch.col + cols] = patch.cells
    cells.flags.writeable = False
    stamp = patch.stamp if grid.stamp is None else max(grid.stamp, patch.stamp)
    return replace(grid, cells=cells, stamp=stamp)


def _cells_of(values: Any, rows: int, cols: int) -> Cells:
    if rows * cols > MAX_CELLS:
        raise BadMessageError(f"a map of {cols} x {rows} cells, more than the {MAX_CELLS:,} that are read")
    if rows * cols != len(values):
        raise BadMessageError(f"a map of {cols} x {rows} cells with {len(values)} values")
    cells = np.array(values, np.int8).reshape(rows, cols)
    cells[(cells < UNKNOWN) | (cells > OCCUPIED)] = UNKNOWN
    cells.flags.writeable = False
    return cells


def _yaw_of(turn: Any) -> float:
    """Return the heading [rad] of the x axis that a quaternion turns, seen from above."""
    x, y, z, w = (float(part) for part in (turn.x, turn.y, turn.z, turn.w))
    length = math.hypot(x, y, z, w)
    if not math.isfinite(length):
        raise BadMessageError(f"a map with the orientation ({x}, {y}, {z}, {w})")
    if length == 0:
        return 0.0
    x, y, z, w = x / length, y / length, z / length, w / length
    if x * x + y * y >= 0.5:
        raise BadMessageError("a map that stands upright or lies on its face")
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def stamp_of(header: Any, received: int) -> float:
    """Return the stamp of a header [s]; where that is zero, when the message was received [ns]."""
    nanoseconds = int(header.stamp.sec) * 10**9 + int(header.stamp.nanosec)
    return seconds(nanoseconds or received)


def seconds(nanoseconds: int) -> float:
    """Return the nearest number of seconds: whole numbers divide without a rounding in between."""
    return nanoseconds / 10**9


# ---------------------------------------------------------------------- decoding
def decoded(data: bytes, kind: str, encoding: str, what: str = "map") -> Any:
    """Return a message of one of the types that ROS brings along, as the library rosbags has it.

    Raises
    ------
    BadMessageError
        It cannot be decoded; the message names `what` it should have been.
    """
    store = _store(encoding)
    decode = store.deserialize_cdr if encoding == CDR else store.deserialize_ros1
    try:
        return decode(data, kind)
    except Exception as error:  # whatever the library trips over: the bytes are to blame
        raise BadMessageError(f"bytes that are no {what}") from error


@cache
def _store(encoding: str) -> Any:
    """Return what knows the types that are read; their definitions in the recording are not looked at.

    They have hardly ever changed, and a recording's other types shall not get in the way.
    """
    typesys = required("rosbags.typesys", EXTRA)
    stores = typesys.Stores
    store = typesys.get_typestore(stores.ROS1_NOETIC if encoding == ROS1 else stores.ROS2_HUMBLE)
    store.register(typesys.get_types_from_msg(_UPDATE_DEFINITION, UPDATE))
    for name in TF:
        if name not in store.types:
            store.register(typesys.get_types_from_msg(_FRAMES_DEFINITION, name))
    return store
