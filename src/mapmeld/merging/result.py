"""What merging answers: the merged map, and where every map lies in it."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mapmeld.grid import OccupancyGrid
from mapmeld.io import save
from mapmeld.matching import MatchResult
from mapmeld.merging.aligned import MergeError
from mapmeld.merging.graph import PairMatch
from mapmeld.se2 import Pose2


@dataclass(frozen=True, slots=True)
class Joint:
    """One accepted match that holds a merged map together.

    Attributes
    ----------
    reference
        Indices of the maps on which the match was made: one of those that had been joined by then, or
        (sequential) all of them; the frame is that of the first of these indices.
    index
        The map that was joined to them.
    result
        The match itself: ``T_a_b`` with a the reference and b the joined map.
    """

    reference: tuple[int, ...]
    index: int
    result: MatchResult


@dataclass(frozen=True, slots=True)
class MergeResult:
    """The merged map and where everything lies in it.

    Attributes
    ----------
    grid
        The merged map of the first component, in the frame and on the lattice of the first map.
    poses
        Per input map ``T_1_i``, which takes its metric frame into the first map's; None for
        maps that could not be joined to the first.
    starts
        Per input map the start pose of its robot in the first map's frame (the paper's global
        reference, section 2.1.7); None as in `poses`.
    components
        Which maps belong together, as indices; the first component holds map 0. Maps that
        fit nowhere are components of their own, never dropped and never drawn at identity.
    joints
        The accepted matches of all components, in the order in which maps were joined.
    refused
        For every map that was not joined to map 0, by index: why. Sequential: the last match of it with
        all that was merged around map 0; graph: the most probable one with a map around map 0.
    covariances
        Per input map the covariance (3, 3) of (x, y, theta) of ``T_1_i`` [m, m, rad]; None as in `poses`,
        and for all of them where maps were merged one after the other.
    pairs
        Every pair of maps, its match, and whether it is used or false, and why; empty where maps
        were merged one after the other.
    """

    grid: OccupancyGrid
    poses: tuple[Pose2 | None, ...]
    starts: tuple[Pose2 | None, ...]
    components: tuple[tuple[int, ...], ...]
    joints: tuple[Joint, ...]
    refused: dict[int, MatchResult]
    covariances: tuple[NDArray[np.float64] | None, ...]
    pairs: tuple[PairMatch, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether all maps were joined."""
        return len(self.components) == 1

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> tuple[Path, ...]:
        """Write the merged map as a map_server YAML + image; return the paths written.

        Raises
        ------
        MergeError
            Some maps could not be joined: a file with a part of the maps would look like all of
            them. Save `grid` itself with `mapmeld.save` where a part is what you want.
        MapFileError
            The files exist (and `force` is not set) or cannot be written.
        """
        if not self.complete:
            left_out = [i for component in self.components[1:] for i in component]
            raise MergeError(
                f"not saved: {len(left_out)} of {len(self.poses)} maps could not be joined to the first "
                f"(indices {', '.join(map(str, left_out))}); save .grid to keep the part that was"
            )
        return save(self.grid, path, force=force)


@dataclass(frozen=True, slots=True)
class Placement:
    """Where maps lie, before they are drawn into one; the fields are those of `MergeResult`."""

    poses: tuple[Pose2 | None, ...]
    components: tuple[tuple[int, ...], ...]
    joints: tuple[Joint, ...]
    refused: dict[int, MatchResult]
    covariances: tuple[NDArray[np.float64] | None, ...]
    pairs: tuple[PairMatch, ...] = ()
