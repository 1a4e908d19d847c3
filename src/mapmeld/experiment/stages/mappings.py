"""Stage 2: a robot drives through an environment, and its scans become the history of a map."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np

from mapmeld.evaluation.score import accuracy
from mapmeld.experiment.folder import environment_folder, mapping_folder, write_row
from mapmeld.experiment.rows import MappingRow
from mapmeld.experiment.settings import LONGEST_TOUR, SAMPLE_SECONDS, ExperimentSettings
from mapmeld.grid import OccupancyGrid
from mapmeld.io import load, save
from mapmeld.io.folders import whole_folder
from mapmeld.io.history_writer import write_history
from mapmeld.recording import Scan
from mapmeld.se2 import Pose2
from mapmeld.simulation import (
    MECABOT,
    Environment,
    FloorPlan,
    Tour,
    TourDriver,
    World,
    drive,
    generate,
    plan_tours,
)
from mapmeld.slam import GMapping, Trajectory, states, write_trajectory

ROW = "mapping.json"
HISTORY = "history"
MAP = "map.yaml"


def make_mapping(root: Path, settings: ExperimentSettings, environment: int, mapping: int) -> None:
    """Simulate a tour, map its scans, and write the mapping's folder.

    The history (one state for each second in which the map changed), the finished map, SLAM's trajectory
    and the true one at the same times, and its row.
    """
    began = time.process_time()
    seed = settings.mapping_seed(environment, mapping)
    place, plan, tours = _place(settings, environment)
    tour = tours[mapping - 1]
    scans, true_poses = _driven(place, plan, tour, mapping, seed)
    driven = time.process_time()
    slam = GMapping(MECABOT.laser, settings.slam, seed)
    history = list(states(slam, scans))
    mapped = time.process_time()
    truth = load(environment_folder(root, environment) / "map.yaml")
    found, true = slam.trajectory(), _at(slam.trajectory(), scans, true_poses)
    errors = np.hypot(*(found.poses - true.poses)[:, :2].T)
    # Odometry begins at (0, 0, 0) where the map does.
    off = scans[-1].T_odom_base.distance_to(true_poses[-1])[0]
    with whole_folder(mapping_folder(root, environment, mapping), force=False, ours=()) as folder:
        write_history(history, folder / HISTORY)
        save(history[-1], folder / MAP)
        write_trajectory(found, folder / "trajectory.txt")
        write_trajectory(true, folder / "truth.txt")
        row = MappingRow(
            environment=environment,
            mapping=mapping,
            seed=seed,
            start=(tour.start.x, tour.start.y, tour.start.theta),
            duration=scans[-1].stamp - scans[0].stamp,
            driven=float(sum(a.distance_to(b)[0] for a, b in pairwise(true_poses))),
            scans=len(scans),
            used=len(found.stamps),
            states=len(history),
            known_area=history[-1].known_area,
            position_error=float(np.sqrt(np.mean(errors**2))),
            position_error_end=float(errors[-1]),
            odometry_error_end=off,
            accuracy=accuracy(history[-1], truth, tour.start),
            accuracy_over_time=tuple(
                (_stamp(grid), accuracy(grid, truth, tour.start)) for grid in sampled(history)
            ),
            simulation_seconds=driven - began,
            slam_seconds=mapped - driven,
            seconds=time.process_time() - began,
        )
        write_row(folder / ROW, row)


@lru_cache(maxsize=1)
def _place(settings: ExperimentSettings, environment: int) -> tuple[Environment, FloorPlan, list[Tour]]:
    """Return an environment with all its tours: those of its mappings follow one after the other."""
    seed = settings.environment_seed(environment)
    place = generate(settings.place, seed)
    plan = FloorPlan(place)
    return (
        place,
        plan,
        list(
            plan_tours(
                place, settings.mappings, seed, common=settings.common, share=settings.share, plan=plan
            )
        ),
    )


def _driven(
    place: Environment, plan: FloorPlan, tour: Tour, mapping: int, seed: int
) -> tuple[list[Scan], list[Pose2]]:
    """Return the scans of a tour, and where the robot truly was at each, in the frame of its start."""
    world = World(place, [tour.start], seed=seed)
    T_map_world = tour.start.inverse()
    scans, true_poses = [], []
    for moment in drive(world, [TourDriver(plan, tour.stops, seed=mapping)], LONGEST_TOUR):
        if moment.scan is not None:
            scans.append(moment.scan)
            true_poses.append(T_map_world @ moment.T_world_base)
    return scans, true_poses


def _at(found: Trajectory, scans: Sequence[Scan], true_poses: Sequence[Pose2]) -> Trajectory:
    """Return the true trajectory at the times of the found one."""
    at = np.searchsorted([scan.stamp for scan in scans], found.stamps)
    poses = np.array([(true_poses[i].x, true_poses[i].y, true_poses[i].theta) for i in at])
    return Trajectory(found.stamps, poses)


def sampled(history: Sequence[OccupancyGrid]) -> list[OccupancyGrid]:
    """Return the first state in every few seconds (`SAMPLE_SECONDS`), and the last of all."""
    chosen: dict[int, OccupancyGrid] = {}
    for grid in history[:-1]:
        chosen.setdefault(math.floor(_stamp(grid) / SAMPLE_SECONDS), grid)
    return [*chosen.values(), history[-1]]


def _stamp(grid: OccupancyGrid) -> float:
    assert grid.stamp is not None
    return grid.stamp
