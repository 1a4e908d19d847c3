"""A data set of a few small maps with known truth, and rows and methods to score by hand."""

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from drawing import office, seen_from

from mapmeld.evaluation import TrialRow
from mapmeld.grid import FREE, OCCUPIED, OccupancyGrid
from mapmeld.io import save
from mapmeld.matching import METHODS, MatchResult, Method, Verdict
from mapmeld.se2 import Pose2

T_1_2 = Pose2(3.0, -2.0, 0.6)
T_1_3 = Pose2(-8.0, 5.0, -2.0)


def other_place() -> OccupancyGrid:
    cells = np.full((60, 80), FREE, np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = OCCUPIED
    cells[0:40, 25] = cells[20:60, 55] = OCCUPIED
    return OccupancyGrid(cells, 0.1)


def pair(id_: str, map_1: str, map_2: str, truth: Pose2 | None, **more: Any) -> dict[str, Any]:
    return {
        "id": id_,
        "map1": f"maps/{map_1}.yaml",
        "map2": f"maps/{map_2}.yaml",
        "kind": "different" if truth is None else "same",
        "T": None if truth is None else [truth.x, truth.y, truth.theta],
        **more,
    }


def tiny_pairs() -> list[dict[str, Any]]:
    return [
        pair("one-two", "one", "two", T_1_2, env="office", overlap=1.0, centroid=[8.0, 6.0]),
        pair("one-three", "one", "three", T_1_3, env="office", flags=["unknown keys are notes"]),
        pair("one-other", "one", "other", None, overlap=0.0),
    ]


def write_dataset(folder: Path, pairs: list[dict[str, Any]] | None = None) -> Path:
    """Write maps of one office in three frames and of another place, and their pairs."""
    (folder / "maps").mkdir(parents=True)
    one = office(0.1)
    for name, grid in (
        ("one", one),
        ("two", seen_from(one, T_1_2.inverse())),
        ("three", seen_from(one, T_1_3.inverse())),
        ("other", other_place()),
    ):
        save(grid, folder / "maps" / f"{name}.yaml")
    write_pairs(folder, tiny_pairs() if pairs is None else pairs)
    return folder


def write_pairs(folder: Path, pairs: object, name: str = "pairs.json") -> None:
    (folder / name).write_text(json.dumps(pairs), encoding="utf-8")


@dataclass(frozen=True)
class NoSettings:
    """Of a method made for a test."""


Answer = Callable[[OccupancyGrid, OccupancyGrid, Any], MatchResult]


def add_method(monkeypatch: pytest.MonkeyPatch, name: str, answer: Answer) -> None:
    monkeypatch.setitem(
        cast(dict[str, Method], METHODS), name, Method(answer, NoSettings, "for a test", lambda *_: 0.0)
    )


def saying(T_a_b: Pose2 | None, probability: float | None = None) -> Answer:
    def answer(a: OccupancyGrid, b: OccupancyGrid, settings: Any) -> MatchResult:
        return MatchResult(T_a_b, Verdict.ACCEPTED, "says so", probability, similarity=0.5)

    return answer


def row(pair: str = "p", **values: Any) -> TrialRow:
    """Make a row of an accepted and right answer, 0.1 m and 1 degree off, unless it is said otherwise."""
    right = values.pop("right", True)
    return TrialRow(
        **{
            "dataset": "set",
            "pair": pair,
            "inputs": "0",
            "method": "m",
            "parameters": "{}",
            "turn_seed": None,
            "swapped": False,
            "time_against": None,
            "version": "1",
            "kind": "same",
            "env": "",
            "true_overlap": 0.5,
            "true_x": 0.0,
            "true_y": 0.0,
            "true_theta": 0.0,
            "verdict": "accepted",
            "reason": "",
            "x": 0.0,
            "y": 0.0,
            "theta": 0.0,
            "similarity": 0.5,
            "translation_error": 0.1 if right else 3.0,
            "rotation_error": math.radians(1),
            "tolerance_translation": 0.5,
            "tolerance_rotation": math.radians(5),
            "right": right,
            "seconds": 0.1,
            **values,
        }
    )


def wrong(pair: str = "p", **values: Any) -> TrialRow:
    return row(pair, right=False, **values)


def elsewhere(pair: str = "p", **values: Any) -> TrialRow:
    """Make a row of two different places."""
    nowhere = dict.fromkeys(["true_x", "true_y", "true_theta", "translation_error", "rotation_error"])
    return row(pair, right=False, **{"kind": "different", "true_overlap": None, **nowhere, **values})
