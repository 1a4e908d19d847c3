"""Merging maps whose poses are not known: match, then merge what fits."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mapmeld.errors import MapmeldError
from mapmeld.grid import OccupancyGrid
from mapmeld.io import load, save
from mapmeld.matching import MatchResult, Verdict, match
from mapmeld.merging.aligned import merge_aligned
from mapmeld.merging.fusion import fuse
from mapmeld.se2 import Pose2


class MergeError(MapmeldError):
    """The maps cannot be merged as asked."""


@dataclass(frozen=True, slots=True)
class Joint:
    """One accepted match that holds the merged map together.

    Attributes
    ----------
    reference
        Indices of the maps that had been merged when the match was made; its frame is the
        first one's.
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
        The accepted matches, in the order in which maps were joined.
    refused
        The last refused match of every map that was not joined to map 0, by index.
    """

    grid: OccupancyGrid
    poses: tuple[Pose2 | None, ...]
    starts: tuple[Pose2 | None, ...]
    components: tuple[tuple[int, ...], ...]
    joints: tuple[Joint, ...]
    refused: dict[int, MatchResult]

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


def merge(
    maps: Sequence[OccupancyGrid | str | os.PathLike[str]],
    *,
    method: str = "alphabet",
    parameters: object | None = None,
    fusion: str = "colour",
    starts: Sequence[Pose2] | None = None,
) -> MergeResult:
    """Match maps and merge those that fit, two by two as in the paper (section 4).

    The merged result so far is matched to each remaining map, and so on until none fits any
    more; what is left starts a component of its own.

    Parameters
    ----------
    maps
        Two or more maps or paths of maps; the first gives the frame and the lattice.
    method, parameters
        As for `mapmeld.match`.
    fusion
        A rule of `mapmeld.merging.fusion.FUSIONS`.
    starts
        Start pose of each robot in its own map's frame; a SLAM map's frame usually starts
        there, so the default is the identity.

    Raises
    ------
    MergeError
        Fewer than one map, or `starts` of another length.
    MapFileError
        A map could not be read.
    UnknownMethodError, UnknownFusionError
        No such method or rule.
    """
    if not maps:
        raise MergeError("there is no map to merge")
    if starts is not None and len(starts) != len(maps):
        raise MergeError(f"{len(maps)} maps need {len(maps)} start poses, not {len(starts)}")
    grids = [m if isinstance(m, OccupancyGrid) else load(m) for m in maps]
    fuse([grids[0].cells], fusion)  # an unknown rule is reported before the long work
    first = _grow_component(0, list(range(1, len(grids))), grids, method, parameters, fusion)
    components = [tuple(first.poses)]
    waiting = list(first.refused)
    while waiting:
        other = _grow_component(waiting[0], waiting[1:], grids, method, parameters, fusion)
        components.append(tuple(other.poses))
        waiting = list(other.refused)
    poses = tuple(first.poses.get(i) for i in range(len(grids)))
    start_poses = starts if starts is not None else [Pose2()] * len(grids)
    return MergeResult(
        grid=first.grid,
        poses=poses,
        starts=tuple(None if T is None else T @ start for T, start in zip(poses, start_poses, strict=True)),
        components=tuple(components),
        joints=first.joints,
        refused=first.refused,
    )


@dataclass(frozen=True, slots=True)
class _Component:
    grid: OccupancyGrid
    poses: dict[int, Pose2]
    joints: tuple[Joint, ...]
    refused: dict[int, MatchResult]


def _grow_component(
    seed: int,
    waiting: list[int],
    grids: Sequence[OccupancyGrid],
    method: str,
    parameters: object | None,
    fusion: str,
) -> _Component:
    """Join to map `seed`, one by one, every waiting map that fits on what has been merged so far."""
    merged = grids[seed]
    poses = {seed: Pose2()}
    joints: list[Joint] = []
    refused: dict[int, MatchResult] = {}
    while waiting:
        index, *waiting = waiting
        result = match(merged, grids[index], method, parameters)
        if result.verdict is not Verdict.ACCEPTED or result.T_a_b is None:
            refused[index] = result
            continue
        joints.append(Joint(tuple(poses), index, result))
        poses[index] = result.T_a_b
        merged = merge_aligned([grids[i] for i in poses], list(poses.values()), fusion)
        # What did not fit on less of the place may fit on more of it.
        waiting += refused
        refused = {}
    return _Component(merged, poses, tuple(joints), refused)
