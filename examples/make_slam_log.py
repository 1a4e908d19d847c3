"""Simulate a robot that drives through the office of make_maps.py, and write its log for SLAM.

    python examples/make_slam_log.py --out somewhere

The log has the form of CARMEN: a ROBOTLASER1 line for every scan, with the odometry beside it, which
drifts as wheels do. ``truth.txt`` has the true poses. The same seed gives the same files.
"""

from __future__ import annotations

import argparse
import gzip
import math
import sys
from itertools import pairwise
from pathlib import Path

import make_maps
import numpy as np
from numpy.typing import NDArray

from mapmeld.errors import MapmeldError
from mapmeld.io.atomic import check_targets, write_files
from mapmeld.se2 import Pose2

Floats = NDArray[np.float64]

TOUR = make_maps.TOURS["robot_1"]
BEARINGS = np.radians(np.arange(-120.0, 121.0, 2.0))
PERIOD = 0.25  # from scan to scan [s]
WHEELS = (0.04, 0.02, 0.05)  # errors of odometry: of lengths, of turns in proportion, [rad] per metre


def odometry(true: Floats, rng: np.random.Generator) -> Floats:
    """Return what wheels make of true poses (n, 3): it starts at the origin and drifts."""
    scale = 1.0 + rng.normal(0.0, WHEELS[0] / 2)
    poses = [Pose2()]
    for before, after in pairwise(true):
        step = Pose2(*before).inverse() @ Pose2(*after)
        length = math.hypot(step.x, step.y)
        slip = scale + rng.normal(0.0, WHEELS[0])
        turn = step.theta * (1 + rng.normal(0.0, WHEELS[1])) + rng.normal(0.0, WHEELS[2]) * length
        poses.append(poses[-1] @ Pose2(step.x * slip, step.y * slip, turn))
    return np.array([(pose.x, pose.y, pose.theta) for pose in poses])


def log_line(stamp: float, ranges: Floats, pose: Floats) -> str:
    """Return one scan as CARMEN writes it."""
    step = BEARINGS[1] - BEARINGS[0]
    span = BEARINGS[-1] - BEARINGS[0]
    laser = f"0 {BEARINGS[0]:.6f} {span:.6f} {step:.6f} {make_maps.RANGE:.1f} 0.01 0"
    # CARMEN has no infinity: what meets nothing is beyond the range.
    values = " ".join(f"{value:.2f}" for value in np.minimum(ranges, make_maps.RANGE + 1.0))
    at = " ".join(f"{value:.4f}" for value in pose)
    return f"ROBOTLASER1 {laser} {len(ranges)} {values} 0 {at} {at} 0 0 0 0 0 {stamp:.2f} robot {stamp:.2f}\n"


def simulate(seed: int) -> tuple[str, str]:
    """Return the log and the true poses as text."""
    rng = np.random.default_rng(seed)
    seen, blocked = make_maps.draw(make_maps.OFFICE)
    true = make_maps.drive(blocked, TOUR)
    believed = odometry(true, rng)
    lines = ["# A simulated robot in the office of examples/make_maps.py; odometry drifts.\n"]
    truth = ["# t x y theta (in the building's frame)\n"]
    for number, (pose, belief) in enumerate(zip(true, believed, strict=True)):
        ranges = make_maps.cast_rays(seen, Pose2(*pose), BEARINGS)
        ranges += rng.normal(0.0, make_maps.RANGE_SIGMA, BEARINGS.size)
        lines.append(log_line(number * PERIOD, ranges, belief))
        truth.append(f"{number * PERIOD:.2f} {pose[0]:.4f} {pose[1]:.4f} {pose[2]:.5f}\n")
    return "".join(lines), "".join(truth)


def write_all(out: Path, seed: int, force: bool) -> None:
    """Write ``office.log.gz`` and ``truth.txt`` into the folder `out`."""
    files = [out / "office.log.gz", out / "truth.txt"]
    out.mkdir(parents=True, exist_ok=True)
    check_targets(files, force=force)
    log, truth = simulate(seed)
    packed = gzip.compress(log.encode(), mtime=0)  # no time in it: the same bytes every time
    write_files(list(zip(files, ([packed], [truth.encode()]), strict=True)), force=force)


def main(arguments: list[str] | None = None) -> int:
    """Run from the command line; return the exit code."""
    parser = argparse.ArgumentParser(description="Simulate a robot's log of scans and odometry for SLAM.")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "slam", help="folder to write to")
    parser.add_argument("--seed", type=int, default=1, help="of all randomness (default 1)")
    parser.add_argument("--force", action="store_true", help="overwrite files that are there")
    options = parser.parse_args(arguments)
    if options.seed < 0:
        parser.error(f"--seed must be 0 or more, not {options.seed}")
    try:
        write_all(options.out, options.seed, options.force)
    except (MapmeldError, OSError) as problem:
        print(f"make_slam_log: {problem}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
