"""Fusing grids that lie on one lattice: what a cell becomes when several maps know it.

Every rule takes a stack of shape (maps, rows, cols), int8, -1 unknown or 0..100 percent,
and returns (rows, cols) likewise. A cell that one map alone knows keeps that map's value;
a cell that none knows stays unknown.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from mapmeld.errors import MapmeldError
from mapmeld.grid import FREE, FREE_UP_TO, OCCUPIED, OCCUPIED_FROM, UNKNOWN, Cells

# A cell of 0 or 100 percent is a strong belief, not a certainty: with the log odds of certainty
# (infinite) one map could never be outvoted. 0.12 and 0.97 are the clamps of OctoMap
# (Hornung et al. 2013).
_SUREST_FREE, _SUREST_OCCUPIED = 0.12, 0.97
_PERCENT = np.clip(np.arange(OCCUPIED + 1) / 100.0, _SUREST_FREE, _SUREST_OCCUPIED)
# Indexed by the cell itself: -1, the last entry, has no say.
_LOG_ODDS = np.append(np.log(_PERCENT / (1.0 - _PERCENT)), 0.0).astype(np.float32)

# Cells that are fused at a time, in whole rows: bounds memory whatever the maps' size.
_BLOCK_CELLS = 1 << 20


class UnknownFusionError(MapmeldError):
    """There is no fusion rule of that name."""


def colour_rule(stack: Cells) -> Cells:
    """Paint grey, then white over it, then black over both (paper, section 2.1.7).

    An obstacle in any map wins, then floor in any map, then what is known but neither.
    """
    highest = stack.max(axis=0)
    floor = np.where((stack >= FREE) & (stack <= FREE_UP_TO), stack, UNKNOWN).max(axis=0)
    return np.asarray(np.where((highest >= OCCUPIED_FROM) | (floor < 0), highest, floor))


def average(stack: Cells) -> Cells:
    """Return the mean of the maps that know the cell, rounded to a percent."""
    known = stack >= 0
    count = known.sum(axis=0, dtype=np.int32)
    total = np.where(known, stack, 0).sum(axis=0, dtype=np.int32)
    return np.where(count > 0, np.rint(total / np.maximum(count, 1)), UNKNOWN).astype(np.int8)


def log_odds(stack: Cells) -> Cells:
    """Add up the log odds of the maps that know the cell (Moravec 1988; Elfes 1989).

    Maps count as independent measurements: two that agree make the cell surer than either.
    """
    total = _LOG_ODDS[stack].sum(axis=0)
    fused = np.rint(100.0 / (1.0 + np.exp(-total))).astype(np.int8)
    # One witness alone is taken at its word, not at the clamp.
    witnesses = (stack >= 0).sum(axis=0, dtype=np.int32)
    return np.asarray(np.where(witnesses > 1, fused, stack.max(axis=0)))


def newest(stack: Cells) -> Cells:
    """Return what the last map of the stack that knows the cell says."""
    fused = np.full(stack.shape[1:], UNKNOWN, np.int8)
    for cells in stack:
        np.copyto(fused, cells, where=cells >= 0)
    return fused


def vote(stack: Cells) -> Cells:
    """Return what most maps say, obstacle or floor; a tie is an obstacle.

    Cells between the two thresholds have no vote; where nobody votes but somebody knows, the
    highest occupancy stays.
    """
    occupied = (stack >= OCCUPIED_FROM).sum(axis=0, dtype=np.int32)
    free = ((stack >= FREE) & (stack <= FREE_UP_TO)).sum(axis=0, dtype=np.int32)
    fused = np.where(occupied >= free, OCCUPIED, FREE)
    return np.where(occupied + free > 0, fused, stack.max(axis=0)).astype(np.int8)


FUSIONS: Mapping[str, Callable[[Cells], Cells]] = {
    "colour": colour_rule,
    "log-odds": log_odds,
    "average": average,
    "newest": newest,
    "vote": vote,
}


def check_fusion(fusion: str) -> None:
    """Find out early that there is no rule of that name.

    Raises
    ------
    UnknownFusionError
        The message lists the names that exist.
    """
    if fusion not in FUSIONS:
        raise UnknownFusionError(f"unknown fusion {fusion!r}: choose from {', '.join(FUSIONS)}")


def fuse(layers: Sequence[Cells], fusion: str = "colour") -> Cells:
    """Fuse aligned layers, each int8 (rows, cols), by a rule named in `FUSIONS`.

    Raises
    ------
    UnknownFusionError
        The message lists the names that exist.
    """
    check_fusion(fusion)
    rows, cols = layers[0].shape
    fused = np.empty((rows, cols), np.int8)
    step = max(1, _BLOCK_CELLS // max(cols, 1))
    for start in range(0, rows, step):
        block = np.s_[start : start + step]
        fused[block] = FUSIONS[fusion](np.stack([layer[block] for layer in layers]))
    return fused
