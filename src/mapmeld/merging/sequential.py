"""Two by two: merged results matched again with other maps, as in the paper (section 4, Figure 9).

Each remaining map is matched with the merged result so far and, should it be rejected there, with
each of the maps in it (a crowded merged map can hide a fit); and so on until none fits
any more. What is left starts a component of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from mapmeld.grid import OccupancyGrid
from mapmeld.matching import MatchResult, Verdict, match
from mapmeld.merging.aligned import merge_aligned
from mapmeld.merging.result import Joint, Placement
from mapmeld.se2 import Pose2


def placed_one_by_one(grids: Sequence[OccupancyGrid], method: str, parameters: object | None) -> Placement:
    """Place maps by matching each with all that was merged before it."""
    first, *others = _components(grids, method, parameters)
    return Placement(
        poses=tuple(first.poses.get(i) for i in range(len(grids))),
        components=tuple(tuple(sorted(c.poses)) for c in (first, *others)),
        joints=tuple(joint for c in (first, *others) for joint in c.joints),
        refused=first.refused,
        covariances=(None,) * len(grids),
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
