"""Stage 4: a successful matching, matched further with a third, fourth and fifth mapping (Figure 9)."""

from __future__ import annotations

import time
from pathlib import Path

from mapmeld.evaluation.score import accuracy
from mapmeld.experiment.rows import JoinRow, MatchingRow
from mapmeld.experiment.stages.mapped import errors_of, is_right, mapped, numbers, true_environment
from mapmeld.matching import match
from mapmeld.merging import merge_aligned
from mapmeld.se2 import Pose2


def join_further(root: Path, matching: MatchingRow, mappings: int) -> JoinRow:
    """Match the merged result two by two with each of the other mappings, until none is a success any more.

    As in the paper, a result that is not successful goes no further.
    """
    began = time.process_time()
    assert matching.T_1_2 is not None
    environment = matching.environment
    truth = true_environment(root, environment)
    first = mapped(root, environment, matching.mapping_1)
    members = [matching.mapping_1, matching.mapping_2]
    poses = [Pose2(), Pose2(*matching.T_1_2)]
    waiting = [n for n in range(1, mappings + 1) if n not in members]
    tried = right = 0
    merged = merge_aligned([mapped(root, environment, n).grid for n in members], poses)
    accuracies = [accuracy(merged, truth, first.T_world_map)]
    joined = True
    while waiting and joined:
        joined = False
        for number in list(waiting):
            other = mapped(root, environment, number)
            tried += 1
            found = match(merged, other.grid, matching.method).T_a_b
            truly = first.T_world_map.inverse() @ other.T_world_map
            if found is None or not is_right(errors_of(found, truly, merged, other.grid)):
                continue
            joined = True
            right += 1
            members.append(number)
            poses.append(found)
            waiting.remove(number)
            merged = merge_aligned([mapped(root, environment, n).grid for n in members], poses)
            accuracies.append(accuracy(merged, truth, first.T_world_map))
    return JoinRow(
        environment=environment,
        mapping_1=matching.mapping_1,
        mapping_2=matching.mapping_2,
        method=matching.method,
        members=tuple(members),
        poses=tuple(numbers(pose) for pose in poses),
        tried=tried,
        right=right,
        accuracies=tuple(accuracies),
        seconds=time.process_time() - began,
    )
