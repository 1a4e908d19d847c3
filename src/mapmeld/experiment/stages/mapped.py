"""What later stages read of the earlier ones: finished maps, where they truly lie, the true environment."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from mapmeld.evaluation.score import PoseErrors, overlap_centroid, pose_errors
from mapmeld.experiment.folder import environment_folder, mapping_folder, read_row
from mapmeld.experiment.rows import MappingRow, Numbers
from mapmeld.experiment.settings import TOLERANCE
from mapmeld.experiment.stages.mappings import MAP, ROW
from mapmeld.grid import OccupancyGrid
from mapmeld.io import load
from mapmeld.se2 import Pose2


@dataclass(frozen=True, eq=False)
class Mapped:
    """A finished map and the truth about it: T_world_map, and its row."""

    grid: OccupancyGrid
    T_world_map: Pose2
    row: MappingRow


@lru_cache(maxsize=20)
def mapped(root: Path, environment: int, mapping: int) -> Mapped:
    """Read a finished mapping."""
    folder = mapping_folder(root, environment, mapping)
    row = read_row(folder / ROW, MappingRow)
    return Mapped(load(folder / MAP), Pose2(*row.start), row)


@lru_cache(maxsize=4)
def true_environment(root: Path, environment: int) -> OccupancyGrid:
    """Read the true map of an environment."""
    return load(environment_folder(root, environment) / "map.yaml")


def errors_of(T_a_b: Pose2 | None, truth_a_b: Pose2, a: OccupancyGrid, b: OccupancyGrid) -> PoseErrors | None:
    """Return an answer's errors at the middle of the true overlap; None if there is nothing to measure."""
    centroid = overlap_centroid(a, b, truth_a_b)
    if T_a_b is None or centroid is None:
        return None
    return pose_errors(T_a_b, truth_a_b, centroid)


def is_right(errors: PoseErrors | None) -> bool:
    """Whether that is a success."""
    return errors is not None and errors.within(TOLERANCE)


def numbers(pose: Pose2) -> Numbers:
    """Return a pose as it is kept in rows."""
    return float(pose.x), float(pose.y), float(pose.theta)
