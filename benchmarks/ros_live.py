"""Load of the live node: how late its callbacks come, processor time and memory, on real middleware.

    python benchmarks/ros_live.py large                 # 4 robots, 2000 x 2000 cells each, 1 Hz, 60 s
    python benchmarks/ros_live.py replay --seconds 180  # 30 minutes of two robots at 10x

Starts the node, a process of robots and listens itself, all on this machine's loopback (extra ``ros``).
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from dataclasses import replace
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT / "tests/ros")]

from live_system import LiveSystem, live_system  # noqa: E402

import mapmeld  # noqa: E402
from mapmeld.grid import OccupancyGrid  # noqa: E402
from mapmeld.se2 import Pose2  # noqa: E402

LARGE = 2000

RIGHT = 0.3
"""[m] A merge within this of the truth is right."""


def padded(grid: OccupancyGrid, shift: int) -> OccupancyGrid:
    """Return the map within 2000 x 2000 cells."""
    rows, cols = grid.shape
    return grid.extended(400 + shift, 300, LARGE - cols - 400 - shift, LARGE - rows - 300)


def tiled(grid: OccupancyGrid) -> OccupancyGrid:
    """Return the map with cells of a fifth the size, so that 2000 x 2000 are full of what is known."""
    import numpy as np

    factor = 5
    cells = np.kron(grid.cells, np.ones((factor, factor), np.int8))
    fine = replace(grid, cells=cells, resolution=grid.resolution / factor)
    rows, cols = fine.shape
    return fine.extended(0, 0, LARGE - cols, LARGE - rows)


def figures(system: LiveSystem, began: float) -> str:
    """Return one line of the node's own figures."""
    f = system.listener.figures
    names = (
        "joined", "callbacks", "callback_ms_99", "callback_ms_max", "callback_cpu_ms_max",
        "callback_ms_max_of", "late_ms_99", "late_ms_max",
        "node_cpu_seconds", "matching_cpu_seconds", "node_memory_mb", "matching_memory_mb", "pairs_waiting",
    )  # fmt: skip
    return f"{time.monotonic() - began:6.1f} s  " + ", ".join(f"{n} {f.get(n, '')}" for n in names)


def large(seconds: float, full: bool) -> None:
    """Four robots with large maps at 1 Hz, one cell of which changes every time."""
    maps = [mapmeld.load(ROOT / f"examples/maps/robot_{i}.yaml") for i in (1, 2, 3)]
    maps.append(mapmeld.load(ROOT / "examples/maps/robot_1_later.yaml"))
    grids = [tiled(grid) if full else padded(grid, 10 * i) for i, grid in enumerate(maps)]
    with live_system() as system:
        robots = [system.robots(f"r{i}") for i in range(4)]
        began = time.monotonic()
        for second in range(int(seconds)):
            for i, grid in enumerate(grids):
                cells = grid.cells.copy()
                cells[second % 200 : second % 200 + 3, :50] = 0
                robots[i].publish(f"r{i}", replace(grid, cells=cells))
            time.sleep(max(0.0, began + second + 1 - time.monotonic()))
            if second % 10 == 9:
                print(figures(system, began), flush=True)


def pair_below_world(transforms: dict[str, tuple[str, Pose2]], a: str, b: str) -> Pose2 | None:
    """Return T_a_b by /tf_static, if both maps' frames hang below the world."""
    poses = {name: T for name, (parent, T) in transforms.items() if parent == "world"}
    if not {f"{a}/map", f"{b}/map"} <= poses.keys():
        return None
    return poses[f"{a}/map"].inverse() @ poses[f"{b}/map"]


def replay(seconds: float) -> None:
    """Replay the example recording again and again, with the restarts of its robots."""
    from mapmeld.io.recordings import map_states

    recording = ROOT / "examples/recording/two_robots.mcap"
    states = {name: list(map_states(recording, f"/{name}/map")) for name in ("robot_1", "robot_2")}
    with live_system() as system:
        robots = system.robots()
        files = {name: [robots.file(g, f"{name}/map") for g in grids] for name, grids in states.items()}
        truth = Pose2(*yaml.safe_load((ROOT / "examples/maps/truth.yaml").read_text())["transforms"]["T_1_2"])
        began, last, looked, first = time.monotonic(), 0.0, 0, None
        worst = (0.0, 0.0)
        step = 0
        while time.monotonic() - began < seconds:
            for name, paths in files.items():
                # Back and forth would be no mapping: to the end, the last map again and again, then anew.
                robots.tell(topic=f"/{name}/map", map=paths[min(step % 60, len(paths) - 1)])
            time.sleep(0.8)
            step += 1
            told = system.listener.transforms
            for transforms in told[looked:]:
                T = pair_below_world(transforms, *states)
                if T is not None:
                    metres, radians = T.distance_to(truth)
                    worst = (max(worst[0], metres), max(worst[1], math.degrees(radians)))
                    if first is None and metres < RIGHT:
                        first = time.monotonic() - began
                        print(f"first right merge after {first:.1f} s, {metres:.2f} m off", flush=True)
            looked = len(told)
            if time.monotonic() - last > 15:
                last = time.monotonic()
                print(figures(system, began), flush=True)
        print(
            f"{looked} times told on /tf_static, at most {worst[0]:.2f} m and {worst[1]:.1f} degrees off; "
            f"{len(system.node.warnings())} warnings",
            flush=True,
        )


def main() -> None:
    """Run one of the two."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("what", choices=("large", "full", "replay"))
    parser.add_argument("--seconds", type=float, default=60)
    given = parser.parse_args()
    if given.what == "replay":
        replay(given.seconds)
    else:
        large(given.seconds, given.what == "full")


if __name__ == "__main__":
    main()
