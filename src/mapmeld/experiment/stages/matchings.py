"""Stage 3: two histories matched state by state, and the outcome judged by the truth."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from mapmeld.evaluation.score import Tolerance, accuracy, overlap_centroid, pose_errors
from mapmeld.experiment.folder import mapping_folder
from mapmeld.experiment.rows import MatchingRow
from mapmeld.experiment.settings import SAMPLE_SECONDS, TOLERANCE, strategy_of
from mapmeld.experiment.stages.mapped import Mapped, errors_of, is_right, mapped, numbers, true_environment
from mapmeld.experiment.stages.mappings import HISTORY
from mapmeld.grid import OccupancyGrid, overlap_share
from mapmeld.history import Standing, Step, follow
from mapmeld.io.history import read_history
from mapmeld.matching.match import checked_parameters, method_named
from mapmeld.matching.result import MatchResult
from mapmeld.merging import merge_aligned
from mapmeld.se2 import Pose2

_NEAR_MISS = Tolerance(2 * TOLERANCE.translation, 2 * TOLERANCE.rotation)


def match_histories(root: Path, environment: int, mapping_1: int, mapping_2: int, method: str) -> MatchingRow:
    """Follow two mapping processes to their end, as if both robots mapped at the same time."""
    began = time.process_time()
    one, two = (mapped(root, environment, number) for number in (mapping_1, mapping_2))
    truth = one.T_world_map.inverse() @ two.T_world_map
    # The middle of what both will have seen in the end, so that errors at all times are of one point.
    centroid = overlap_centroid(one.grid, two.grid, truth)
    steps = 0
    due = 0.0
    over_time: list[tuple[float, bool, float | None]] = []
    right_since: float | None = None
    step: Step | None = None
    first, second = (_states(root, environment, number) for number in (mapping_1, mapping_2))
    for step in follow(first, second, method=method, strategy=strategy_of(method)):
        steps += 1
        if step.best is None or step.best.T_a_b is None or step.stamp is None or centroid is None:
            continue
        right = pose_errors(step.best.T_a_b, truth, centroid).within(TOLERANCE)
        right_since = (step.stamp if right_since is None else right_since) if right else None
        if step.stamp >= due:
            over_time.append((step.stamp, right, _accuracy_now(root, environment, one, step)))
            due = (math.floor(step.stamp / SAMPLE_SECONDS) + 1) * SAMPLE_SECONDS
    assert step is not None
    best = step.best
    T_1_2 = best.T_a_b if best else None
    errors = errors_of(T_1_2, truth, one.grid, two.grid)
    success = is_right(errors)
    of_truth = method_named(method).similarity_at(one.grid, two.grid, truth, checked_parameters(method, None))
    return MatchingRow(
        environment=environment,
        mapping_1=mapping_1,
        mapping_2=mapping_2,
        method=method,
        strategy=strategy_of(method),
        steps=steps,
        truth=numbers(truth),
        T_1_2=numbers(T_1_2) if T_1_2 else None,
        true_overlap=overlap_share(one.grid, two.grid, truth),
        right=success,
        accepted=step.standing is Standing.ACCEPTED,
        translation_error=errors.translation if errors else None,
        rotation_error=errors.rotation if errors else None,
        probability=best.probability if best else None,
        similarity=best.similarity if best else 0.0,
        similarity_of_truth=of_truth,
        cause="" if success else cause_of_failure(best, truth, one, two, of_truth),
        accuracy=_accuracy_now(root, environment, one, step) if success else None,
        first_right=right_since,
        over_time=tuple(over_time),
        seconds=time.process_time() - began,
    )


def _states(root: Path, environment: int, mapping: int) -> Iterator[OccupancyGrid]:
    # Copies: what is computed of a map is kept as long as the map, and that is much for all of a history.
    return (replace(state) for state in _history(root, environment, mapping))


@lru_cache(maxsize=5)
def _history(root: Path, environment: int, mapping: int) -> tuple[OccupancyGrid, ...]:
    """Read a history, which all matchings of its environment need."""
    return tuple(read_history(mapping_folder(root, environment, mapping) / HISTORY))


def _accuracy_now(root: Path, environment: int, one: Mapped, step: Step) -> float | None:
    """Return the accuracy of the newest maps merged by the best match; None if there is none."""
    map_1, map_2 = step.maps
    if map_1 is None or map_2 is None or step.best is None or step.best.T_a_b is None:
        return None
    merged = merge_aligned([map_1, map_2], [Pose2(), step.best.T_a_b])
    return accuracy(merged, true_environment(root, environment), one.T_world_map)


def cause_of_failure(
    best: MatchResult | None, truth: Pose2, one: Mapped, two: Mapped, similarity_of_truth: float
) -> str:
    """Say why a matching failed, as far as the truth can tell.

    Either nothing was found; or it is nearly right, and the maps themselves are off by as much; or the true
    transform was not among what was tried; or it was, and something wrong looks more alike.
    """
    if best is None or best.T_a_b is None:
        return f"nothing found: {best.reason if best else 'no states'}"
    errors = errors_of(best.T_a_b, truth, one.grid, two.grid)
    if errors is None:
        return "no common area"
    bent = max(one.row.position_error_end, two.row.position_error_end)
    if errors.within(_NEAR_MISS):
        return (
            f"near miss: {errors.translation:.2f} m and {math.degrees(errors.rotation):.1f} degrees off; "
            f"SLAM itself ended up to {bent:.2f} m off"
        )
    if similarity_of_truth > best.similarity:
        return (
            f"not found: the true transform would be more alike "
            f"({similarity_of_truth:.2f}) than what was found ({best.similarity:.2f})"
        )
    return (
        f"misled: a wrong transform is more alike ({best.similarity:.2f}) than the true one "
        f"({similarity_of_truth:.2f})"
    )
