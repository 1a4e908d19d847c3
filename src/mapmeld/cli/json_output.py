"""What ``--json`` prints; documented in docs/json.md, where every change must be noted.

A schema's number grows when a field changes its meaning or goes away; fields may be added without.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from mapmeld import __version__

if TYPE_CHECKING:
    from pathlib import Path

    from mapmeld.matching import MatchResult
    from mapmeld.merging import MergeResult, PairMatch
    from mapmeld.merging.graph import MapGraph
    from mapmeld.se2 import Pose2

MATCH_SCHEMA = "mapmeld.match/1"
MERGE_SCHEMA = "mapmeld.merge/1"
GRAPH_SCHEMA = "mapmeld.graph/1"

Fields = dict[str, Any]


def as_json(content: Fields) -> str:
    """Return a text that every JSON parser takes: ASCII, no NaN."""
    return json.dumps(content, indent=2, allow_nan=False)


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


def _pair_fields(pair: PairMatch) -> Fields:
    return {
        "i": pair.i,
        "j": pair.j,
        "state": str(pair.state),
        "why": pair.why,
        "T_i_j": pose_fields(pair.T_i_j),
        "covariance": None if pair.covariance is None else pair.covariance.tolist(),
        "bridge": pair.bridge,
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
