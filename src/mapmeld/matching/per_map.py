"""What is computed from a map, computed once."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import Generic, TypeVar

from mapmeld.grid import OccupancyGrid

T = TypeVar("T")


class PerMap(Generic[T]):
    """A function of a map that remembers its value for as long as the map itself lives.

    A map that meets many others is prepared once. Grids never change, so what is remembered
    stays true; an equal grid that is another object is computed anew.
    """

    def __init__(self, function: Callable[[OccupancyGrid], T]) -> None:
        self._function = function
        self._known: dict[int, tuple[weakref.ref[OccupancyGrid], T]] = {}

    def __call__(self, grid: OccupancyGrid) -> T:
        """Return the function's value for this grid."""
        key = id(grid)
        found = self._known.get(key)
        if found is not None and found[0]() is grid:
            return found[1]
        value = self._function(grid)
        self._known[key] = (weakref.ref(grid, lambda _: self._known.pop(key, None) and None), value)
        return value
