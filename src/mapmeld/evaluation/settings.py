"""What a benchmark was run with, as the file that is saved beside its results."""

from __future__ import annotations

import json
import math
import platform
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

import cv2
import numpy as np
import scipy

from mapmeld.evaluation.pairs import Dataset
from mapmeld.evaluation.plan import Trial
from mapmeld.evaluation.score import Tolerance
from mapmeld.fingerprint import code_version


def settings_of(
    datasets: Sequence[Dataset],
    trials: Sequence[Trial],
    *,
    turn: int,
    seed: int,
    limit: int | None,
    workers: int,
    tolerances: Mapping[str, Tolerance],
) -> dict[str, object]:
    """Return the effective settings of a run in plain types, degrees where people read them."""
    methods = {trial.method: json.loads(trial.parameters) for trial in trials}
    return {
        "mapmeld": code_version(),
        "when": datetime.now(UTC).isoformat(timespec="seconds"),
        "datasets": [
            {
                "name": dataset.name,
                "file": str(dataset.file),
                "pairs": len({trial.pair.id for trial in trials if trial.dataset == dataset.name}),
                "tolerance": _tolerance(tolerances.get(dataset.name, dataset.tolerance)),
            }
            for dataset in datasets
        ],
        "methods": methods,
        "turn": turn,
        "seed": seed,
        "limit": limit,
        "swap": trials[0].swapped if trials else False,
        "time_against": trials[0].time_against if trials else None,
        "workers": workers,
        "machine": {
            "system": platform.platform(),
            "processor": _processor(),
            "python": platform.python_version(),
            "numpy": np.__version__,
            "scipy": scipy.__version__,
            "opencv": cv2.__version__,
        },
    }


def _tolerance(tolerance: Tolerance) -> list[float]:
    return [tolerance.translation, round(math.degrees(tolerance.rotation), 9)]


def _processor() -> str:
    """Return the processor's name; platform.processor() gives only its family on Linux."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.processor() or platform.machine()
