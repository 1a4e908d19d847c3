"""One signature for every matcher."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from mapmeld.errors import MapmeldError
from mapmeld.grid import OccupancyGrid, check_resolutions
from mapmeld.matching.alphabet import AlphabetParameters, match_alphabet
from mapmeld.matching.alphabet.rescoring import similarity_at as of_preprocessed_walls
from mapmeld.matching.baselines import (
    FeatureAkazeParameters,
    FeatureOrbParameters,
    FourierMellinParameters,
    HoughSpectrumParameters,
    match_feature_akaze,
    match_feature_orb,
    match_fourier_mellin,
    match_hough_spectrum,
)
from mapmeld.matching.baselines.evidence import similarity_at as of_drawn_walls
from mapmeld.matching.correlative import CorrelativeParameters, match_correlative
from mapmeld.matching.correlative.assess import similarity_at as of_wall_lengths
from mapmeld.matching.result import MatchResult
from mapmeld.se2 import Pose2


class UnknownMethodError(MapmeldError):
    """There is no matcher of that name."""


@dataclass(frozen=True, slots=True)
class Method:
    """A matcher.

    Attributes
    ----------
    run
        Matches two maps.
    parameters
        The class of its settings (all of whose fields have defaults).
    summary
        What it is, in a few words.
    similarity_at
        Measures `MatchResult.similarity` as the matcher does, under a given T_a_b as it is.
    """

    run: Callable[[OccupancyGrid, OccupancyGrid, Any], MatchResult]
    parameters: type[Any]
    summary: str
    similarity_at: Callable[[OccupancyGrid, OccupancyGrid, Pose2, Any], float]


DEFAULT_METHOD = "correlative"

METHODS: Mapping[str, Method] = {
    "correlative": Method(
        match_correlative,
        CorrelativeParameters,
        "walls and floor correlated, aligned and weighed (the default)",
        of_wall_lengths,
    ),
    "alphabet": Method(
        match_alphabet,
        AlphabetParameters,
        "the paper's alphabet of corner relations",
        of_preprocessed_walls,
    ),
    "feature_orb": Method(
        match_feature_orb, FeatureOrbParameters, "ORB features, as multirobot_map_merge", of_drawn_walls
    ),
    "feature_akaze": Method(
        match_feature_akaze, FeatureAkazeParameters, "AKAZE features, as multirobot_map_merge", of_drawn_walls
    ),
    "hough_spectrum": Method(
        match_hough_spectrum,
        HoughSpectrumParameters,
        "Hough spectra and projections (Carpin 2008)",
        of_drawn_walls,
    ),
    "fourier_mellin": Method(
        match_fourier_mellin,
        FourierMellinParameters,
        "Fourier magnitudes, phase correlation (Reddy 1996)",
        of_drawn_walls,
    ),
}


def method_named(name: str) -> Method:
    """Return a matcher by its name.

    Raises
    ------
    UnknownMethodError
        The message lists the names that exist.
    """
    if name not in METHODS:
        raise UnknownMethodError(f"unknown method {name!r}: choose from {', '.join(METHODS)}")
    return METHODS[name]


def checked_parameters(method: str, parameters: object | None) -> Any:
    """Return the settings to run a method with: those given, or its defaults.

    Raises
    ------
    UnknownMethodError
        `method` is not known.
    TypeError
        `parameters` is of another method's class.
    """
    chosen = method_named(method)
    if parameters is None:
        return chosen.parameters()
    if not isinstance(parameters, chosen.parameters):
        raise TypeError(
            f"method {method!r} takes {chosen.parameters.__name__}, not {type(parameters).__name__}"
        )
    return parameters


def match(
    a: OccupancyGrid, b: OccupancyGrid, method: str = DEFAULT_METHOD, parameters: object | None = None
) -> MatchResult:
    """Find how map b fits on map a.

    Parameters
    ----------
    a, b
        The maps; resolution, size, origin and yaw may all differ.
    method
        A key of `METHODS`.
    parameters
        Settings of the method, an instance of its parameter class; None for the defaults.

    Returns
    -------
    MatchResult
        `T_a_b` takes a point of b's metric frame into a's. Maps with nothing to match on
        (no obstacle, nothing known) are rejected, never an error.

    Raises
    ------
    UnknownMethodError
        `method` is not known.
    ResolutionError
        The maps' cell sizes differ by more than a factor of 100.
    TypeError
        `a` or `b` is not a map, or `parameters` is of another method's class.
    """
    for name, grid in (("a", a), ("b", b)):
        if not isinstance(grid, OccupancyGrid):
            raise TypeError(
                f"map {name} is a {type(grid).__name__}; mapmeld.load(path) reads a map from a file"
            )
    chosen = method_named(method)
    parameters = checked_parameters(method, parameters)
    check_resolutions(a, b)
    started = time.perf_counter()
    result = chosen.run(a, b, parameters)
    return replace(result, method=method, seconds=time.perf_counter() - started)
