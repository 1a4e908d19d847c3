"""Measure our GMapping against the original's maps and trajectories.

    python benchmarks/slam_reference.py FOLDER

The folder has ``reference.json`` and one folder per run: ``scans.txt.gz`` (first line: beams, first angle,
step [rad], maximum range; then per scan: t, odometry x y theta, ranges), ``true_trajectory.txt``,
``truth.yaml``, and of the original program ``gmapping_map.yaml`` and ``gmapping_trajectory.txt``.

Accuracy is Equation 3 of the paper, the pose error the root mean square over the scans that were used;
for both, the trajectory is laid on the true one as well as a rigid motion can. That is also how the
original is measured, whose figures are computed anew here.
"""

from __future__ import annotations

import argparse
import gzip
import json
import math
import statistics
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapmeld.evaluation.score import accuracy
from mapmeld.grid import OccupancyGrid
from mapmeld.io import load
from mapmeld.recording import Laser, Scan
from mapmeld.se2 import Pose2
from mapmeld.slam import GMapping, GMappingParameters, prepare

Floats = NDArray[np.float64]

# What the original was run with.
SETTINGS = {"particles": 30, "delta": 0.05, "linearUpdate": 0.3, "angularUpdate": 0.25}


class Figures(NamedTuple):
    """How true a run is, and what it took: Equation 3, pose error [m], CPU [s]."""

    accuracy: float
    rms: float
    seconds: float


def read_scans(path: Path) -> tuple[Laser, list[Scan]]:
    """Read laser and scans."""
    with gzip.open(path, "rt") as file:
        beams, first, step, longest = file.readline().split()
        rows = np.loadtxt(file)
    laser = Laser(int(beams), float(first), float(step), float(longest))
    scans = [Scan(float(r[0]), Pose2(*map(float, r[1:4])), r[4:].astype(np.float32)) for r in rows]
    return laser, scans


def fitted(points: Floats, onto: Floats) -> Pose2:
    """Return the rigid motion that lays points (n, 2) on others with the least squared distances."""
    a, b = points - points.mean(axis=0), onto - onto.mean(axis=0)
    theta = math.atan2(float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()), float((a * b).sum()))
    x, y = onto.mean(axis=0) - Pose2(0.0, 0.0, theta).apply(points.mean(axis=0))
    return Pose2(float(x), float(y), theta)


def judged(run: Path, grid: OccupancyGrid, stamps: Floats, places: Floats) -> tuple[float, float]:
    """Return accuracy and pose error [m] of a map and of where the robot was believed to be (n, 2)."""
    true = np.loadtxt(run / "true_trajectory.txt")
    onto = np.column_stack([np.interp(stamps, true[:, 0], true[:, column]) for column in (1, 2)])
    T_world_map = fitted(places, onto)
    error = T_world_map.apply(places) - onto
    rms = math.sqrt(float(np.square(error).sum(axis=1).mean()))
    return accuracy(grid, load(run / "truth.yaml"), T_world_map), rms


def measured(run: Path, parameters: GMappingParameters, seeds: int) -> tuple[list[Figures], float]:
    """Return the figures of each seed, and how long the recording is [s]."""
    laser, scans = read_scans(run / "scans.txt.gz")
    found = []
    for seed in range(seeds):
        begin = time.process_time()
        slam = GMapping(laser, parameters, seed)
        for scan in scans:
            slam.add(scan)
        seconds = time.process_time() - begin
        path = slam.trajectory()
        found.append(Figures(*judged(run, slam.map(), path.stamps, path.poses[:, :2]), seconds))
    return found, scans[-1].stamp - scans[0].stamp


def main(arguments: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seeds", type=int, default=5, help="how many, from 0 on")
    parser.add_argument("--proposal", choices=("matched", "sampled"), default="matched")
    options = parser.parse_args(arguments)
    begin = time.perf_counter()
    prepare()
    print(f"getting ready: {time.perf_counter() - begin:.1f} s\n")
    parameters = GMappingParameters(proposal=options.proposal, **SETTINGS)  # type: ignore[arg-type]
    print(
        "| run | original: Eq. 3 | pose rms m | ours, median: Eq. 3 | pose rms m | worst of all seeds |",
        end="",
    )
    print(" times real time |\n| --- | --: | --: | --: | --: | --: | --: |")
    for name in sorted(json.loads((options.folder / "reference.json").read_text())):
        run = options.folder / name
        theirs = np.loadtxt(run / "gmapping_trajectory.txt")
        original = judged(run, load(run / "gmapping_map.yaml"), theirs[:, 0], theirs[:, 1:3])
        found, length = measured(run, parameters, options.seeds)
        ours = Figures(*(statistics.median(column) for column in zip(*found, strict=True)))
        worst = f"{min(f.accuracy for f in found):.4f}, {max(f.rms for f in found):.3f}"
        print(
            f"| {name} | {original[0]:.4f} | {original[1]:.3f} | {ours.accuracy:.4f} | {ours.rms:.3f} "
            f"| {worst} | {length / ours.seconds:.1f} |",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
