"""What ``--json`` prints; documented in docs/json.md, where every change must be noted."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from mapmeld import __version__
from mapmeld.cli.schemas import (
    BAG_INFO_SCHEMA,
    DIFF_SCHEMA,
    FIND_SCHEMA,
    FOLLOW_SCHEMA,
    GRAPH_SCHEMA,
    MATCH_SCHEMA,
    MERGE_SCHEMA,
    NAVIGABILITY_SCHEMA,
    REBASE_SCHEMA,
    STEP_SCHEMA,
    TRANSFORM_POINTS_SCHEMA,
)

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from mapmeld.changes import MapDiff
    from mapmeld.cli.placement import Placement
    from mapmeld.evaluation import Navigability, Reach
    from mapmeld.grid import OccupancyGrid
    from mapmeld.history import Step
    from mapmeld.index import Candidate, MapIndex
    from mapmeld.io.recordings import RecordingInfo
    from mapmeld.matching import MatchResult
    from mapmeld.merging import MergeResult, PairMatch
    from mapmeld.merging.graph import MapGraph
    from mapmeld.se2 import Pose2

Fields = dict[str, Any]


def as_json(content: Fields) -> str:
    """Return a text that every JSON parser takes: ASCII, no NaN."""
    return json.dumps(content, indent=2, allow_nan=False)


def as_json_line(content: Fields) -> str:
    """Return the same on one line, for outputs of many objects (JSON Lines)."""
    return json.dumps(content, allow_nan=False)


def pose_fields(pose: Pose2 | None) -> Fields | None:
    """Return {x, y, theta} [m, m, rad]; None stays None."""
    return None if pose is None else {"x": pose.x, "y": pose.y, "theta": pose.theta}


def match_fields(result: MatchResult, parameters: Any, paths: Sequence[str]) -> Fields:
    """Return the fields of schema mapmeld.match/1."""
    return {
        "schema": MATCH_SCHEMA,
        "mapmeld": __version__,
        "maps": {"a": paths[0], "b": paths[1]},
        "method": result.method,
        "parameters": asdict(parameters),
        **_evidence(result),
        "covariance": None if result.covariance is None else result.covariance.tolist(),
        "alternatives": [
            {
                "T_a_b": pose_fields(other.T_a_b),
                "similarity": other.similarity,
                "probability": other.probability,
            }
            for other in result.alternatives
        ],
        "seconds": result.seconds,
    }


def merge_fields(
    result: MergeResult,
    method: str,
    parameters: Any,
    fusion: str,
    paths: Sequence[str],
    files: Sequence[Path],
    seconds: float,
) -> Fields:
    """Return the fields of schema mapmeld.merge/1."""
    return {
        "schema": MERGE_SCHEMA,
        "mapmeld": __version__,
        "method": method,
        "parameters": asdict(parameters),
        "fusion": fusion,
        "complete": result.complete,
        "maps": [
            {
                "path": path,
                "T_1_i": pose_fields(pose),
                "covariance": None if covariance is None else covariance.tolist(),
                "start": pose_fields(start),
            }
            for path, pose, covariance, start in zip(
                paths, result.poses, result.covariances, result.starts, strict=True
            )
        ],
        "components": [list(component) for component in result.components],
        "joints": [
            {"reference": list(joint.reference), "index": joint.index, **_evidence(joint.result)}
            for joint in result.joints
        ],
        "refused": [
            {"index": index, **_evidence(refused)} for index, refused in sorted(result.refused.items())
        ],
        "pairs": [_pair_fields(pair) for pair in result.pairs],
        "files": [str(file) for file in files],
        "seconds": seconds,
    }


def graph_fields(
    graph: MapGraph, method: str, parameters: Any, paths: Sequence[str], seconds: float
) -> Fields:
    """Return the fields of schema mapmeld.graph/1."""
    component = {i: number for number, members in enumerate(graph.components) for i in members}
    return {
        "schema": GRAPH_SCHEMA,
        "mapmeld": __version__,
        "method": method,
        "parameters": asdict(parameters),
        "complete": len(graph.components) == 1,
        "components": [list(members) for members in graph.components],
        "maps": [
            {
                "path": path,
                "component": component[i],
                "T_c_i": pose_fields(graph.poses[i]),
                "covariance": graph.covariances[i].tolist(),
                "T_w_i": pose_fields(graph.T_w_i[i]),
                "known": i in graph.known,
            }
            for i, path in enumerate(paths)
        ],
        "pairs": [_pair_fields(pair) for pair in graph.pairs],
        "seconds": seconds,
    }


def find_fields(
    found: Sequence[Candidate],
    index: MapIndex,
    method: str,
    parameters: Any,
    paths: Sequence[str],
    seconds: float,
) -> Fields:
    """Return the fields of schema mapmeld.find/1."""
    return {
        "schema": FIND_SCHEMA,
        "mapmeld": __version__,
        "map": paths[0],
        "index": paths[1],
        "indexed": len(index.maps),
        "method": method,
        "parameters": asdict(parameters),
        "candidates": [
            {
                "path": str(candidate.path),
                "score": candidate.score,
                "problem": candidate.problem or None,
                "match": None if candidate.result is None else _found_fields(candidate.result),
            }
            for candidate in found
        ],
        "seconds": seconds,
    }


def _found_fields(result: MatchResult) -> Fields:
    return {
        **_evidence(result),
        "covariance": None if result.covariance is None else result.covariance.tolist(),
        "seconds": result.seconds,
    }


def bag_info_fields(info: RecordingInfo, path: str) -> Fields:
    """Return the fields of schema mapmeld.bag.info/1."""
    return {
        "schema": BAG_INFO_SCHEMA,
        "mapmeld": __version__,
        "path": path,
        "start": info.start,
        "topics": [
            {
                "name": topic.name,
                "type": topic.type,
                "encoding": topic.encoding,
                "maps": topic.maps,
                "updates": topic.updates,
                "first": topic.first,
                "last": topic.last,
                "first_stamp": topic.first_stamp,
                "last_stamp": topic.last_stamp,
                "frame_id": topic.frame_id,
                "resolution": topic.resolution,
                "rows": topic.shape[0] if topic.shape else None,
                "cols": topic.shape[1] if topic.shape else None,
                "problem": topic.problem,
            }
            for topic in info.topics
        ],
        "left_out": info.left_out,
    }


def diff_fields(
    diff: MapDiff | None,
    match: MatchResult | None,
    parameters: Any,
    paths: Sequence[str],
    files: Sequence[Path],
    seconds: float,
) -> Fields:
    """Return the fields of schema mapmeld.diff/1; without a diff those of maps that do not match."""
    from mapmeld.changes import Change

    return {
        "schema": DIFF_SCHEMA,
        "mapmeld": __version__,
        "maps": {"old": paths[0], "new": paths[1]},
        "T_old_new": None if diff is None else pose_fields(diff.T_old_new),
        "match": how_matched(match, parameters),
        "bend": None if diff is None else diff.bend,
        "areas": None
        if diff is None
        else {change.name.lower(): diff.area(change) for change in Change if change is not Change.UNKNOWN},
        "regions": []
        if diff is None
        else [
            {
                "kind": region.kind,
                "area": region.area_m2,
                "centroid": list(region.centroid),
                "bounds": list(region.bounds),
            }
            for region in diff.regions
        ],
        "summary": None if diff is None else diff.summary,
        "files": [str(file) for file in files],
        "seconds": seconds,
    }


def step_fields(step: Step) -> Fields:
    """Return the fields of schema mapmeld.follow.step/1."""
    return {
        "schema": STEP_SCHEMA,
        "number": step.number,
        "process": step.which,
        "states": list(step.states),
        "stamp": step.stamp,
        "standing": str(step.standing),
        "change": str(step.change),
        "why": step.why,
        "work": str(step.work),
        "best": None if step.best is None else {**_evidence(step.best), "seconds": step.best.seconds},
    }


def follow_fields(
    last: Step | None,
    changes: Sequence[Step],
    names: Sequence[str],
    method: str,
    parameters: Any,
    strategy: str,
    files: Sequence[Path],
    seconds: float,
) -> Fields:
    """Return the fields of schema mapmeld.follow/1."""
    best = None if last is None else last.best
    return {
        "schema": FOLLOW_SCHEMA,
        "mapmeld": __version__,
        "processes": {"1": names[0], "2": names[1]},
        "method": method,
        "parameters": asdict(parameters),
        "strategy": strategy,
        "states": [0, 0] if last is None else list(last.states),
        "standing": "undecided" if last is None else str(last.standing),
        "T_1_2": pose_fields(None if last is None else last.T_1_2),
        "covariance": None if best is None or best.covariance is None else best.covariance.tolist(),
        "best": None if best is None else _evidence(best),
        "changes": [
            {
                "number": step.number,
                "stamp": step.stamp,
                "change": str(step.change),
                "why": step.why,
                "T_1_2": pose_fields(step.T_1_2),
            }
            for step in changes
        ],
        "files": [str(file) for file in files],
        "seconds": seconds,
    }


def rebase_fields(
    placed: Placement,
    parameters: Any,
    paths: Sequence[str],
    moved: OccupancyGrid,
    lattice: bool,
    files: Sequence[Path],
) -> Fields:
    """Return the fields of schema mapmeld.rebase/1."""
    return {
        "schema": REBASE_SCHEMA,
        "mapmeld": __version__,
        "maps": {"old": paths[0], "new": paths[1]},
        "T_old_new": pose_fields(placed.T_a_b),
        "match": how_matched(placed.match, parameters),
        "lattice": lattice,
        "origin": pose_fields(moved.origin),
        "files": [str(file) for file in files],
    }


def transform_points_fields(
    placed: Placement,
    parameters: Any,
    maps: tuple[str | None, str | None],
    count: Mapping[str, int],
    files: Sequence[Path],
) -> Fields:
    """Return the fields of schema mapmeld.transform-points/1."""
    return {
        "schema": TRANSFORM_POINTS_SCHEMA,
        "mapmeld": __version__,
        "maps": {"from": maps[0], "to": maps[1]},
        "T_to_from": pose_fields(placed.T_a_b),
        "match": how_matched(placed.match, parameters),
        "count": dict(count),
        "files": [str(file) for file in files],
    }


def navigability_fields(
    paths: tuple[str, str | None],
    T_truth_map: Pose2 | None,
    match: Fields | None,
    settings: Mapping[str, Any],
    reached: Reach,
    found: Navigability | None,
    seconds: float,
) -> Fields:
    """Return the fields of schema mapmeld.navigability/1."""
    return {
        "schema": NAVIGABILITY_SCHEMA,
        "mapmeld": __version__,
        "map": paths[0],
        "truth": paths[1],
        "T_truth_map": pose_fields(T_truth_map),
        "match": match,
        "settings": dict(settings),
        "reach": asdict(reached),
        "compared": None if found is None else _compared_fields(found),
        "seconds": seconds,
    }


def _compared_fields(found: Navigability) -> Fields:
    ratios = found.length_ratios
    return {
        "pairs": found.pairs,
        "reachable_map": found.reachable_map,
        "reachable_truth": found.reachable_truth,
        "reachable_both": found.reachable_both,
        "false_passages": found.false_passages,
        "false_blocks": found.false_blocks,
        "length_ratio": {
            "median": found.length_ratio,
            "mean": sum(ratios) / len(ratios) if ratios else None,
            "least": min(ratios, default=None),
            "greatest": max(ratios, default=None),
        },
        "ways": [
            {
                "start": list(way.start),
                "goal": list(way.goal),
                "length": way.length,
                "true_length": way.true_length,
                "drivable": way.drivable,
                "false_passage": way.false_passage,
                "false_block": way.false_block,
            }
            for way in found.ways
        ],
    }


def how_matched(match: MatchResult | None, parameters: Any) -> Fields | None:
    """Return how maps were matched and what came of it; None for a transform that was given."""
    if match is None:
        return None
    return {"method": match.method, "parameters": asdict(parameters), **_evidence(match)}


def _pair_fields(pair: PairMatch) -> Fields:
    return {
        "i": pair.i,
        "j": pair.j,
        "state": str(pair.state),
        "why": pair.why,
        "T_i_j": pose_fields(pair.T_i_j),
        "covariance": None if pair.covariance is None else pair.covariance.tolist(),
        "bridge": pair.bridge,
        "against_known": pair.against_known,
        "off": None if pair.off is None else {"metres": pair.off[0], "radians": pair.off[1]},
        "match": _evidence(pair.result),
    }


def _evidence(result: MatchResult) -> Fields:
    return {
        "T_a_b": pose_fields(result.T_a_b),
        "verdict": str(result.verdict),
        "reason": result.reason,
        "probability": result.probability,
        "similarity": result.similarity,
        "overlap": result.overlap,
    }
