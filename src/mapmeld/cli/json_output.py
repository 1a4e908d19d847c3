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

    from mapmeld.io.recordings import RecordingInfo
    from mapmeld.matching import MatchResult
    from mapmeld.merging import MergeResult
    from mapmeld.se2 import Pose2

MATCH_SCHEMA = "mapmeld.match/1"
MERGE_SCHEMA = "mapmeld.merge/1"
BAG_INFO_SCHEMA = "mapmeld.bag.info/1"

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
            {"path": path, "T_1_i": pose_fields(pose), "start": pose_fields(start)}
            for path, pose, start in zip(paths, result.poses, result.starts, strict=True)
        ],
        "components": [list(component) for component in result.components],
        "joints": [
            {"reference": list(joint.reference), "index": joint.index, **_evidence(joint.result)}
            for joint in result.joints
        ],
        "refused": [
            {"index": index, **_evidence(refused)} for index, refused in sorted(result.refused.items())
        ],
        "files": [str(file) for file in files],
        "seconds": seconds,
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


def _evidence(result: MatchResult) -> Fields:
    return {
        "T_a_b": pose_fields(result.T_a_b),
        "verdict": str(result.verdict),
        "reason": result.reason,
        "probability": result.probability,
        "similarity": result.similarity,
        "overlap": result.overlap,
    }
