"""What the walls say of transforms that are given: the matcher without its search."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mapmeld.grid import OccupancyGrid, check_resolutions
from mapmeld.matching.correlative.alignment import refine, to_local
from mapmeld.matching.correlative.evidence import weigh
from mapmeld.matching.correlative.matcher import (
    FINE_POINTS,
    FINE_SCALES,
    _answer,
    _comes_first,
    _distinct,
    _inverted,
    _rejected,
    _similarity,
    _weighed,
    mode_probabilities,
)
from mapmeld.matching.correlative.parameters import CorrelativeParameters
from mapmeld.matching.correlative.prepared_map import PreparedMap, prepare
from mapmeld.matching.correlative.probability import fitted_model
from mapmeld.matching.correlative.wall_map import BORDER, Doubles, WallMap
from mapmeld.matching.result import MatchResult
from mapmeld.se2 import Pose2


def assess(
    a: OccupancyGrid,
    b: OccupancyGrid,
    transforms: Sequence[Pose2],
    parameters: CorrelativeParameters | None = None,
) -> MatchResult:
    """Weigh the evidence for given transforms, each first aligned to the walls near it.

    The answer is what `match_correlative` would say if its search had listed these transforms
    and no others, at a fraction of the cost: the best of them, how probable it is, the others as
    alternatives. What it cannot know of are rivals that are not given.

    Parameters
    ----------
    a, b
        The maps.
    transforms
        T_a_b, each within about 0.3 m and a few degrees of where the walls want it. Those that align
        to the same place count once, those that lay the maps side by side do not count.
    parameters
        As for the method; only `accept_probability` matters here.

    Raises
    ------
    ResolutionError
        The maps' cell sizes differ by more than a factor of 100.
    """
    parameters = parameters or CorrelativeParameters()
    check_resolutions(a, b)
    prepared_a, prepared_b = prepare(a), prepare(b)
    if prepared_a is None or prepared_b is None:
        return _rejected(f"nothing to match on: map {'a' if prepared_a is None else 'b'} has no obstacle")
    if not transforms:
        return _rejected("no transform was given")
    if _comes_first(prepared_b.walls, prepared_a.walls):
        inverses = [T.inverse() for T in transforms]
        return _inverted(_assess(prepared_b, prepared_a, inverses, parameters))
    return _assess(prepared_a, prepared_b, transforms, parameters)


def _assess(
    a: PreparedMap, b: PreparedMap, transforms: Sequence[Pose2], parameters: CorrelativeParameters
) -> MatchResult:
    model = fitted_model()
    local = np.array([to_local(a.walls, b.walls, T) for T in transforms])
    local = local[_meet(a.walls, b.walls, local)]
    if not len(local):
        return _rejected("the maps do not meet where they are laid")
    local = refine(a.walls, b.walls, local, FINE_SCALES, FINE_POINTS)
    modes = _distinct(b.walls, _weighed(a.walls, b.walls, local, model))
    probabilities = mode_probabilities(modes, model)
    return _answer(a.walls, b.walls, modes, probabilities, parameters.accept_probability)


def similarity_at(
    a: OccupancyGrid, b: OccupancyGrid, T_a_b: Pose2, parameters: CorrelativeParameters
) -> float:
    """Return the similarity of `match_correlative`, Jaccard by length of wall, under a transform as it is."""
    prepared_a, prepared_b = prepare(a), prepare(b)
    if prepared_a is None or prepared_b is None:
        return 0.0
    if _comes_first(prepared_b.walls, prepared_a.walls):
        prepared_a, prepared_b, T_a_b = prepared_b, prepared_a, T_a_b.inverse()
    walls_a, walls_b = prepared_a.walls, prepared_b.walls
    local = to_local(walls_a, walls_b, T_a_b)[None]
    if not _meet(walls_a, walls_b, local).all():
        return 0.0
    (evidence,) = weigh(walls_a, walls_b, local)
    return _similarity(walls_a, walls_b, evidence)


def _meet(walls_a: WallMap, walls_b: WallMap, t: Doubles) -> NDArray[np.bool_]:
    """Whether the known rectangles of both maps meet, axis by axis of a, under each t (k, 3).

    Evidence is gathered in patches all over what the maps cover together, kilometres if they are that
    far apart, as after a mapping that began anew in another frame.
    """
    (height_a, width_a), (height_b, width_b) = (
        [(cells - 2 * BORDER) * walls.cell for cells in walls.shape] for walls in (walls_a, walls_b)
    )
    corners = np.array([0, width_b, 1j * height_b, width_b + 1j * height_b])
    laid = np.exp(1j * t[:, 2:]) * corners + t[:, :1] + 1j * t[:, 1:2]
    x, y = laid.real, laid.imag
    across = (x.max(axis=1) >= 0) & (x.min(axis=1) <= width_a)
    return np.asarray(across & (y.max(axis=1) >= 0) & (y.min(axis=1) <= height_a))
