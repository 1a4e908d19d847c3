"""Write what robot 1 of make_maps.py records on its tour as a log for SLAM.

    python examples/make_slam_log.py --out somewhere

The log has the form of CARMEN: a ROBOTLASER1 line for every scan that is kept, with the odometry beside it,
which drifts as the wheels slip. Every third scan and every fifth beam are kept, so that the file is small.
``truth.txt`` has the true poses. The same seed gives the same files. It takes the extra "sim".
"""

from __future__ import annotations

import argparse
import gzip
import sys
from pathlib import Path

import make_maps
import numpy as np
from numpy.typing import NDArray

from mapmeld.errors import MapmeldError
from mapmeld.io.atomic import check_targets, write_files
from mapmeld.se2 import Pose2
from mapmeld.simulation import MECABOT, FloorPlan, TourDriver, World, drive

EVERY_SCAN, EVERY_BEAM = 3, 5
ROBOT = "robot_1"


def log_line(stamp: float, ranges: NDArray[np.float32], pose: Pose2) -> str:
    """Return one scan and odometry's pose of the robot as CARMEN writes them."""
    laser = MECABOT.laser
    kept = ranges[::EVERY_BEAM]
    step = laser.step * EVERY_BEAM
    head = f"0 {laser.first_angle:.6f} {step * (len(kept) - 1):.6f} {step:.6f} {laser.max_range:.1f} 0.01 0"
    # CARMEN has no infinity: what meets nothing is beyond the range.
    values = " ".join(f"{value:.2f}" for value in np.minimum(kept, laser.max_range + 1.0))
    base = f"{pose.x:.4f} {pose.y:.4f} {pose.theta:.5f}"
    there = pose @ laser.T_base_laser
    at = f"{there.x:.4f} {there.y:.4f} {there.theta:.5f}"
    return f"ROBOTLASER1 {head} {len(kept)} {values} 0 {at} {base} 0 0 0 0 0 {stamp:.2f} robot {stamp:.2f}\n"


def simulate(seed: int, longest: float = make_maps.LONGEST) -> tuple[str, str]:
    """Return the log and the true poses as text; of a drive of at most `longest` [s]."""
    mapping = make_maps.mappings(seed)[ROBOT]
    world = World(mapping.place, [mapping.tour.start], seed=mapping.seed)
    driver = TourDriver(FloorPlan(mapping.place), mapping.tour.stops, seed=mapping.seed)
    lines = ["# Robot 1 in the office of examples/make_maps.py; odometry drifts.\n"]
    truth = ["# t x y theta (in the frame of examples/maps/floor.yaml)\n"]
    moments = (moment for moment in drive(world, [driver], longest) if moment.scan is not None)
    for number, moment in enumerate(moments):
        if number % EVERY_SCAN or moment.scan is None:
            continue
        pose = moment.T_world_base
        lines.append(log_line(moment.stamp, moment.scan.ranges, moment.T_odom_base))
        truth.append(f"{moment.stamp:.2f} {pose.x:.4f} {pose.y:.4f} {pose.theta:.5f}\n")
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
    parser.add_argument(
        "--seed", type=int, default=make_maps.SEED, help=f"of all randomness (default {make_maps.SEED})"
    )
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
