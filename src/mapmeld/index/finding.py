"""Which maps of an index show the same place as a map, and where."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from mapmeld.errors import MapmeldError
from mapmeld.grid import OccupancyGrid
from mapmeld.index.entries import MapIndex
from mapmeld.index.signature import signature_of
from mapmeld.io import load
from mapmeld.matching import DEFAULT_METHOD, MatchResult, Verdict, match, method_named

MATCHED = 10
"""Candidates that are matched unless more are asked for."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A map of an index that may show the place that is looked for.

    Attributes
    ----------
    path
        Where it is.
    score
        How much its signature looks like that of the map, 0..1.
    result
        The match: ``T_a_b`` with a = the candidate and b = the map that is looked for; None if it was not
        tried.
    problem
        Why it could not be tried; empty if nothing is wrong.
    """

    path: Path
    score: float
    result: MatchResult | None = None
    problem: str = ""


def candidates_for(
    grid: OccupancyGrid, index: MapIndex, top: int = MATCHED, but: Path | None = None
) -> tuple[Candidate, ...]:
    """Return the maps of an index that look most like a map, best first, by signatures alone.

    Parameters
    ----------
    grid
        The map.
    index
        Where to look.
    top
        How many at most.
    but
        The map's own file, which is left out if it is in the index.
    """
    order, scores = index.ranking.best(signature_of(grid))
    own = None if but is None else but.resolve()
    found: list[Candidate] = []
    for number, score in zip(order, scores, strict=True):
        if len(found) == top:
            break
        path = index.maps[number].path(index.root)
        if own is None or path.resolve() != own:
            found.append(Candidate(path, float(score)))
    return tuple(found)


def find(
    grid: OccupancyGrid,
    index: MapIndex,
    top: int = MATCHED,
    but: Path | None = None,
    *,
    method: str = DEFAULT_METHOD,
    parameters: object | None = None,
    on_candidate: Callable[[], object] | None = None,
) -> tuple[Candidate, ...]:
    """Find the maps of an index that show the same place as a map, and where in them it lies.

    The `top` maps that look most like it are matched with it; accepted ones come first, the surest at the
    top. A candidate that cannot be read any more is there with its problem.

    Parameters
    ----------
    grid, index, top, but
        As for `candidates_for`.
    method, parameters
        As for `mapmeld.match`.
    on_candidate
        Called after each match.

    Raises
    ------
    UnknownMethodError
        No such method.
    """
    method_named(method)  # not a problem of each candidate
    tried = []
    for candidate in candidates_for(grid, index, top, but):
        tried.append(_matched(candidate, grid, method, parameters))
        if on_candidate:
            on_candidate()
    return tuple(sorted(tried, key=_rank))


def _matched(candidate: Candidate, grid: OccupancyGrid, method: str, parameters: object) -> Candidate:
    try:
        other = load(candidate.path)
        result = match(other, grid, method, parameters)
    except MapmeldError as error:
        return Candidate(candidate.path, candidate.score, None, str(error))
    return Candidate(candidate.path, candidate.score, result)


def _rank(candidate: Candidate) -> tuple[int, float, float]:
    result = candidate.result
    if result is None:
        return 3, 0.0, -candidate.score
    place = {Verdict.ACCEPTED: 0, Verdict.AMBIGUOUS: 1, Verdict.REJECTED: 2}[result.verdict]
    # What is as sure as the other to all that matters is told apart by looks.
    return place, -round(result.probability or 0.0, 3), -candidate.score
