"""Stage 5: maps of different environments, which no method may accept."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from mapmeld.experiment.rows import ElsewhereRow
from mapmeld.experiment.settings import ExperimentSettings
from mapmeld.experiment.stages.mapped import mapped
from mapmeld.matching import Verdict, match

Pair = tuple[int, int, int, int]
"""Environment and mapping of the first map, environment and mapping of the second."""


def pairs_of_different_environments(settings: ExperimentSettings) -> list[Pair]:
    """Draw as many pairs as there are matchings of one environment; fewer if there are not so many."""
    e, m = settings.environments, settings.mappings
    every = [
        (first, i, second, j)
        for first in range(1, e + 1)
        for second in range(first + 1, e + 1)
        for i in range(1, m + 1)
        for j in range(1, m + 1)
    ]
    wanted = min(len(every), e * m * (m - 1) // 2)
    chosen = np.random.default_rng(settings.seed).choice(len(every), wanted, replace=False) if every else ()
    return [every[int(index)] for index in sorted(chosen)]


def match_elsewhere(root: Path, pair: Pair, method: str) -> ElsewhereRow:
    """Match two finished maps of different environments."""
    began = time.process_time()
    environment_1, mapping_1, environment_2, mapping_2 = pair
    a, b = mapped(root, environment_1, mapping_1), mapped(root, environment_2, mapping_2)
    result = match(a.grid, b.grid, method)
    return ElsewhereRow(
        environment_1=environment_1,
        mapping_1=mapping_1,
        environment_2=environment_2,
        mapping_2=mapping_2,
        method=method,
        accepted=result.verdict is Verdict.ACCEPTED,
        probability=result.probability,
        similarity=result.similarity,
        seconds=time.process_time() - began,
    )
