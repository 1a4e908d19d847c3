"""Simulate two robots that map one office floor, and record their maps as they grow.

    python examples/make_recording.py --out somewhere

The robots, the floor and the noise are those of ``make_maps.py``, so that the last state on each topic
is the map that it writes. Robot 2 sets out later, and each publishes at a pace of its own. The
recording is an MCAP file as ``ros2 bag record`` writes it; it takes the extra "bags" to write it.
"""

from __future__ import annotations

import argparse
import io
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from make_maps import grow, map_jobs

from mapmeld.errors import MapmeldError
from mapmeld.extras import required
from mapmeld.grid import OccupancyGrid
from mapmeld.io.atomic import check_targets, write_files

GRID = "nav_msgs/msg/OccupancyGrid"
NAME = "two_robots.mcap"
BEGINNING = 1_767_225_600  # of the recording [s since the epoch]: 2026 in UTC
SCAN_PERIOD = 0.25  # [s]
DELAY = 80_000_000  # from the stamp of a map until it is received [ns]


class Mapping(NamedTuple):
    """When a robot sets out [s after the beginning], and after how many scans it publishes its map."""

    departure: float
    every: int


MAPPINGS = {"robot_1": Mapping(0.5, 45), "robot_2": Mapping(9.7, 33)}


def states(seed: int) -> Iterator[tuple[str, float, OccupancyGrid]]:
    """Give robot, stamp [s after the beginning] and map of every state, in time order."""
    jobs = map_jobs(seed)
    found = [
        (robot, mapping.departure + scans * SCAN_PERIOD, grid)
        for robot, mapping in MAPPINGS.items()
        for scans, grid in grow(*jobs[robot], every=mapping.every)
    ]
    yield from sorted(found, key=lambda state: state[1])


def grid_message(store: Any, stamp: int, frame_id: str, grid: OccupancyGrid) -> Any:
    """Return a map as the message that robots publish; `stamp` in nanoseconds."""
    kinds = store.types
    time = kinds["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
    rows, cols = grid.shape
    half = grid.origin.theta / 2
    pose = kinds["geometry_msgs/msg/Pose"](
        position=kinds["geometry_msgs/msg/Point"](x=grid.origin.x, y=grid.origin.y, z=0.0),
        orientation=kinds["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=math.sin(half), w=math.cos(half)),
    )
    info = kinds["nav_msgs/msg/MapMetaData"](
        map_load_time=time, resolution=grid.resolution, width=cols, height=rows, origin=pose
    )
    header = kinds["std_msgs/msg/Header"](stamp=time, frame_id=frame_id)
    return kinds[GRID](header=header, info=info, data=grid.cells.reshape(-1))


def recording(seed: int) -> bytes:
    """Return the contents of the MCAP file."""
    typesys, writing = required("rosbags.typesys", "bags"), required("mcap.writer", "bags")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    definition, _ = store.generate_msgdef(GRID, ros_version=2)
    file = io.BytesIO()
    # Some chunks, as of a recorder, but large ones: a state repeats most of the one before it.
    writer = writing.Writer(file, chunk_size=1 << 20, compression=writing.CompressionType.ZSTD)
    writer.start(profile="ros2", library="mapmeld examples")
    schema = writer.register_schema(GRID, "ros2msg", definition.encode())
    channels = {robot: writer.register_channel(f"/{robot}/map", "cdr", schema) for robot in MAPPINGS}
    for robot, after, grid in states(seed):
        stamp = BEGINNING * 10**9 + round(after * 1e9)
        message = grid_message(store, stamp, f"{robot}/map", grid)
        received = stamp + DELAY
        data = bytes(store.serialize_cdr(message, GRID))
        writer.add_message(channels[robot], log_time=received, publish_time=received, data=data)
    writer.finish()
    return file.getvalue()


def main(arguments: list[str] | None = None) -> int:
    """Run from the command line; return the exit code."""
    parser = argparse.ArgumentParser(description="Simulate two robots and record their maps as they grow.")
    default = Path(__file__).parent / "recording"
    parser.add_argument("--out", type=Path, default=default, help="folder to write to")
    parser.add_argument("--seed", type=int, default=1, help="of all randomness (default 1)")
    parser.add_argument("--force", action="store_true", help="overwrite a recording that is there")
    options = parser.parse_args(arguments)
    if options.seed < 0:
        parser.error(f"--seed must be 0 or more, not {options.seed}")
    try:
        options.out.mkdir(parents=True, exist_ok=True)
        check_targets([options.out / NAME], force=options.force)  # before the work, not after it
        write_files([(options.out / NAME, [recording(options.seed)])], force=options.force)
    except (MapmeldError, OSError) as problem:
        print(f"make_recording: {problem}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
