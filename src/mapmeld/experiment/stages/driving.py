"""Stage 6: can a robot drive by the merged maps? The question that the paper leaves open."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from mapmeld.evaluation.navigability import NavigabilityError, navigability
from mapmeld.experiment.rows import NavigabilityRow, Numbers
from mapmeld.experiment.settings import PLANNED_PAIRS, ROBOT_RADIUS
from mapmeld.experiment.stages.mapped import mapped, true_environment
from mapmeld.merging import merge_aligned
from mapmeld.se2 import Pose2


def plan_ways(
    root: Path, environment: int, members: Sequence[int], poses: Sequence[Numbers], method: str, seed: int
) -> NavigabilityRow:
    """Plan ways on mappings merged as a method matched them, between places that the robots reach."""
    began = time.process_time()
    maps = [mapped(root, environment, number) for number in members]
    placed = [Pose2(*pose) for pose in poses]
    merged = merge_aligned([m.grid for m in maps], placed)
    problem, found = "", None
    try:
        found = navigability(
            merged,
            true_environment(root, environment),
            maps[0].T_world_map,
            radius=ROBOT_RADIUS,
            starts=placed,  # a map's origin is where its robot began
            pairs=PLANNED_PAIRS,
            seed=seed,
        )
    except NavigabilityError as error:
        problem = str(error)
    return NavigabilityRow(
        environment=environment,
        members=tuple(members),
        method=method,
        problem=problem,
        pairs=found.pairs if found else 0,
        reachable_map=found.reachable_map if found else 0,
        reachable_truth=found.reachable_truth if found else 0,
        false_passages=found.false_passages if found else 0,
        false_blocks=found.false_blocks if found else 0,
        length_ratios=tuple(float(ratio) for ratio in found.length_ratios) if found else (),
        seconds=time.process_time() - began,
    )
