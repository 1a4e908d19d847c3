"""Merging maps whose poses are not known: match, then merge what fits."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from mapmeld.grid import OccupancyGrid
from mapmeld.io import load, save
from mapmeld.matching import DEFAULT_METHOD, MatchResult, Verdict, match
from mapmeld.merging.aligned import MergeError, merge_aligned
from mapmeld.merging.fusion import check_fusion
from mapmeld.se2 import Pose2


@dataclass(frozen=True, slots=True)
class Joint:
    """One accepted match that holds a merged map together.

    Attributes
    ----------
    reference
        Indices of the maps on which the match was made: all that had been merged by then, or
        one of them; the frame is that of the first of these indices.
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
        For every map that was not joined to map 0, by index: the last match of it with all
        that was merged around map 0.
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
    method: str = DEFAULT_METHOD,
    parameters: object | None = None,
    fusion: str = "colour",
    starts: Sequence[Pose2] | None = None,
) -> MergeResult:
    """Match maps and merge those that fit, two by two as in the paper (section 4).

    Each remaining map is matched with the merged result so far and, should it be rejected there, with
    each of the maps in it (a crowded merged map can hide a fit); and so on until none fits
    any more. What is left starts a component of its own.

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
        Fewer than one map, `starts` of another length, or a merged map beyond all size.
    MapFileError
        A map could not be read.
    UnknownMethodError, UnknownFusionError
        No such method or rule.
    """
    if isinstance(maps, str | os.PathLike):
        raise MergeError(f"{os.fspath(maps)!r} is one map; give a list of maps")
    if not maps:
        raise MergeError("there is no map to merge")
    if starts is not None and len(starts) != len(maps):
        raise MergeError(f"{len(maps)} maps need {len(maps)} start poses, not {len(starts)}")
    check_fusion(fusion)  # before the long work
    grids = [m if isinstance(m, OccupancyGrid) else load(m) for m in maps]
    first, *others = _components(grids, method, parameters)
    poses = [first.poses.get(i) for i in range(len(grids))]
    joined = sorted(first.poses)
    start_poses = starts if starts is not None else [Pose2()] * len(grids)
    return MergeResult(
        grid=merge_aligned([grids[i] for i in joined], [first.poses[i] for i in joined], fusion),
        poses=tuple(poses),
        starts=tuple(None if T is None else T @ start for T, start in zip(poses, start_poses, strict=True)),
        components=tuple(tuple(sorted(c.poses)) for c in (first, *others)),
        joints=tuple(joint for c in (first, *others) for joint in c.joints),
        refused=first.refused,
    )


@dataclass(frozen=True, slots=True)
class _Component:
    poses: dict[int, Pose2]
    joints: tuple[Joint, ...]
    refused: dict[int, MatchResult]


def _components(
    grids: Sequence[OccupancyGrid], method: str, parameters: object | None
) -> Iterator[_Component]:
    """Grow a component from the first map, then from the first of those left, and so on."""
    waiting = list(range(len(grids)))
    while waiting:
        component = _grow_component(waiting[0], waiting[1:], grids, method, parameters)
        yield component
        waiting = sorted(component.refused)


def _grow_component(
    seed: int, waiting: list[int], grids: Sequence[OccupancyGrid], method: str, parameters: object | None
) -> _Component:
    """Join to map `seed`, one by one, every waiting map that fits on what has been joined so far."""
    # The paper's own rule is what is matched on, whichever rule the result will be fused by.
    merged = grids[seed]
    poses = {seed: Pose2()}
    joints: list[Joint] = []
    refused: dict[int, MatchResult] = {}
    while waiting:
        index, *waiting = waiting
        on_all = Joint(tuple(poses), index, match(merged, grids[index], method, parameters))
        joint = next(filter(_accepted, _attempts(on_all, poses, grids, method, parameters)), None)
        if joint is None or joint.result.T_a_b is None:
            refused[index] = on_all.result
            continue
        joints.append(joint)
        poses[index] = poses[joint.reference[0]] @ joint.result.T_a_b
        merged = merge_aligned([grids[i] for i in poses], list(poses.values()))
        # What did not fit on less of the place may fit on more of it.
        waiting += refused
        refused = {}
    return _Component(poses, tuple(joints), refused)


def _attempts(
    on_all: Joint,
    poses: Iterable[int],
    grids: Sequence[OccupancyGrid],
    method: str,
    parameters: object | None,
) -> Iterator[Joint]:
    """Give the match with the merged map and then, as long as more are wanted, with each map in it."""
    yield on_all
    # Ambiguous on all that is known stays so: a single map may only show too little to tell.
    if len(on_all.reference) > 1 and on_all.result.verdict is Verdict.REJECTED:
        for member in poses:
            result = match(grids[member], grids[on_all.index], method, parameters)
            yield Joint((member,), on_all.index, result)


def _accepted(joint: Joint) -> bool:
    return joint.result.verdict is Verdict.ACCEPTED
