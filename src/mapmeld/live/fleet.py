"""A fleet of robots that map: their newest maps in, what is known of where they lie out.

`Fleet` decides, and nothing else: it knows no middleware, no clock and no thread. Its work is cut into pieces
of at most one match (`Fleet.work`), so that whoever drives it can hand in newer maps between them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from mapmeld.errors import MapmeldError
from mapmeld.grid import OccupancyGrid
from mapmeld.history import EvidenceParameters
from mapmeld.history.changes import same_map
from mapmeld.live.canvas import Canvas
from mapmeld.live.exactness import covariances_from, turned
from mapmeld.live.pair import Pair
from mapmeld.live.restart import started_anew
from mapmeld.live.state import Decree, FleetState, PairReport, RobotReport
from mapmeld.matching import DEFAULT_METHOD
from mapmeld.matching.match import checked_parameters
from mapmeld.merging.aligned import MergeError
from mapmeld.merging.fusion import check_fusion
from mapmeld.merging.graph import KnownPose, MapGraph, PairMatch, PairState, solve
from mapmeld.se2 import Pose2

STILL_METRES = 0.02
STILL_RADIANS = 0.003
"""Poses that a new fit moves by less than this stay as they are: the merged map need not tremble."""


class FleetError(MapmeldError):
    """A wish that cannot be fulfilled: no such robot, nothing to confirm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetSettings:
    """How robots are joined and drawn.

    Attributes
    ----------
    method, parameters
        As for `mapmeld.match`.
    evidence
        As for `mapmeld.follow`.
    matching
        Whether maps are matched at all; else only poses that are known join robots.
    fusion
        A rule of `mapmeld.merging.FUSIONS`.
    world_frame
        Name of the frame of the merged map.
    """

    method: str = DEFAULT_METHOD
    parameters: object | None = None
    evidence: EvidenceParameters | None = None
    matching: bool = True
    fusion: str = "colour"
    world_frame: str = "world"

    def __post_init__(self) -> None:
        checked_parameters(self.method, self.parameters)
        check_fusion(self.fusion)
        if not self.world_frame:
            raise ValueError("the world frame needs a name")


@dataclass(slots=True, eq=False)
class _Robot:
    newest: OccupancyGrid
    # The newest map that a match which is used, or a known pose, vouches for: only that is ever drawn. A map
    # in another frame, by a restart that nothing has noticed yet, is not.
    vouched: OccupancyGrid | None = None
    version: int = 0  # counts the maps that were vouched for
    starts: int = 1
    anew: str = ""

    def vouch(self, grid: OccupancyGrid) -> None:
        if grid is not self.vouched:
            self.vouched, self.version = grid, self.version + 1


class Fleet:
    """Joins the newest maps of any number of robots.

    The world frame is that in which poses are known, once a robot with a known pose has sent a map; else that
    of the first robot, by name, of the first group that is joined. It stays where it is though that robot's
    map is withdrawn. The merged map has what is connected with the world frame, by matches or by a known pose
    of its own; other groups, and robots that are in none, are told of, but not drawn.

    Parameters
    ----------
    settings
        See there.
    resume
        ``T_world_robot`` of an earlier fleet: joined again, these robots keep the world frame where it was.
    """

    def __init__(
        self, settings: FleetSettings | None = None, resume: Mapping[str, Pose2] | None = None
    ) -> None:
        self.settings = settings or FleetSettings()
        self._robots: dict[str, _Robot] = {}
        self._pairs: dict[tuple[str, str], Pair] = {}
        self._known: dict[str, KnownPose] = {}
        self._suspended: dict[str, KnownPose] = {}
        self._last: dict[str, Pose2] = dict(resume or {})  # where robots were joined
        self._poses: dict[str, Pose2] = {}
        self._anchor: str | None = None
        self._graph: MapGraph | None = None
        self._groups: dict[str, list[str]] = {}  # with whom each robot is joined
        self._covariances: dict[str, NDArray[np.float64]] = {}
        self._by_known = False  # whether the world frame is that of the known poses
        self._canvas: Canvas | None = None
        self._blank: OccupancyGrid | None = None  # as large as the last map of a canvas that is no more
        self._looks = 0
        self._stale = True  # whether poses are to be found anew

    # ------------------------------------------------------------------ what comes in
    def put(self, name: str, grid: OccupancyGrid) -> str | None:
        """Take a robot's newest map; return a sentence if its mapping has started anew."""
        robot = self._robots.get(name)
        if robot is None:
            for other in self._robots:
                self._pairs[_key(name, other)] = self._new_pair()
            self._robots[name] = _Robot(grid)
            self._stale = True
            return None
        if same_map(robot.newest, grid) and robot.newest.frame_id == grid.frame_id:
            return None  # the map at hand stays: what has been computed from it is remembered for that object
        why = started_anew(robot.newest, grid)
        robot.newest = grid
        self._stale = self._stale or name in self._known
        if why is None:
            return None
        self._start_anew(name, why)
        return f"{name} has started its map anew ({why}); its matches are withdrawn"

    def _start_anew(self, name: str, why: str) -> None:
        robot = self._robots[name]
        robot.starts += 1
        robot.anew, robot.vouched = why, None
        self._last.pop(name, None)
        if name in self._known:
            self._suspended[name] = self._known.pop(name)
        for key, pair in self._pairs.items():
            if name in key:
                pair.start_anew(f"{name} has started its map anew", withdrawn=True)
        self._stale = True

    def know(self, name: str, pose: KnownPose | None) -> None:
        """Set the pose of a robot's map frame (its start pose) in the world; None: it is not known.

        It holds for the mapping that goes on now, or that is still to come; not for one that starts anew.
        """
        self._suspended.pop(name, None)
        if pose is None:
            self._known.pop(name, None)
        else:
            self._known[name] = pose
        self._stale = True

    def confirm(self, a: str, b: str) -> None:
        """Take the best match of two robots for right.

        Raises
        ------
        FleetError
            There is no such robot, or no match.
        """
        problem = self._pair(a, b).confirm()
        if problem:
            raise FleetError(f"{a} and {b}: {problem}")
        self._stale = True

    def forbid(self, a: str, b: str) -> None:
        """Never join two robots by a match of theirs; errors as `confirm`."""
        self._pair(a, b).forbid()
        self._stale = True

    def release(self, a: str, b: str) -> None:
        """Take back what was said of two robots; errors as `confirm`."""
        self._pair(a, b).release()
        self._stale = True

    def forget(self, name: str) -> None:
        """Drop a robot and its map.

        Raises
        ------
        FleetError
            There is no such robot.
        """
        if name not in self._robots:
            raise FleetError(self._no_such(name))
        del self._robots[name]
        self._poses.pop(name, None)
        self._pairs = {key: pair for key, pair in self._pairs.items() if name not in key}
        self._last.pop(name, None)
        self._stale = True

    def reset(self) -> None:
        """Forget all matches, decrees and the world frame; newest maps and known poses stay."""
        self._pairs = {_key(a, b): self._new_pair() for a, b in combinations(sorted(self._robots), 2)}
        self._last, self._poses, self._anchor = {}, {}, None
        self._drop_canvas()
        for robot in self._robots.values():
            robot.vouched = None
        self._stale = True

    def change(self, settings: FleetSettings) -> None:
        """Go on with other settings; another method, or its parameters, begins all matches anew."""
        before, self.settings = self.settings, settings
        if (before.method, before.parameters, before.evidence) != (
            settings.method,
            settings.parameters,
            settings.evidence,
        ):
            decrees = {key: pair.decree for key, pair in self._pairs.items()}
            self._pairs = {key: self._new_pair() for key in self._pairs}
            for key, decree in decrees.items():
                if decree is Decree.FORBIDDEN:
                    self._pairs[key].forbid()
        if self._canvas is not None:
            self._canvas.frame_id = settings.world_frame
        self._stale = True

    # ------------------------------------------------------------------ the work
    def work(self) -> bool:
        """Match the pair that has waited longest, if any has new maps; return whether one has."""
        waiting = [key for key in self._pairs if self._waits(key)] if self.settings.matching else []
        if waiting:
            key = min(waiting, key=lambda key: (self._pairs[key].turn, key))
            self._looks += 1
            self._pairs[key].look((self._robots[key[0]].newest, self._robots[key[1]].newest), self._looks)
            self._stale = True
        if self._stale:
            self._place()
        return bool(waiting)

    @property
    def waiting(self) -> int:
        """How many pairs have maps that have not been matched yet."""
        return sum(map(self._waits, self._pairs)) if self.settings.matching else 0

    def _waits(self, key: tuple[str, str]) -> bool:
        pair = self._pairs[key]
        if pair.decree is Decree.FORBIDDEN:
            return False
        newest = (self._robots[key[0]].newest, self._robots[key[1]].newest)
        return pair.maps is None or pair.maps[0] is not newest[0] or pair.maps[1] is not newest[1]

    def _place(self) -> None:
        self._stale = False
        names = sorted(self._robots)
        index = {name: i for i, name in enumerate(names)}
        matches = []
        if self.settings.matching:
            for (a, b), pair in sorted(self._pairs.items()):
                result = pair.result
                if result is not None:
                    matches.append((index[a], index[b], result))
        known = {index[name]: pose for name, pose in self._known.items() if name in index}
        if not names:
            self._graph, self._poses, self._anchor = None, {}, None
            return
        graph = self._graph = solve([self._robots[name].newest for name in names], matches, known)
        self._vouch(names, graph)
        groups = [[names[i] for i in members] for members in graph.components]
        self._groups = {name: group for group in groups for name in group}
        if self._by_known != bool(graph.known):
            self._by_known = bool(graph.known)
            if self._by_known:
                self._last, self._poses = {}, {}  # in another world
            self._drop_canvas()
        poses = self._in_world(names, graph)
        self._covariances = self._in_world_frame(names, graph, poses)
        self._poses = {
            name: self._still(name, T) for name, T in poses.items() if self._robots[name].vouched is not None
        }
        self._last |= self._poses

    def _vouch(self, names: list[str], graph: MapGraph) -> None:
        for match in graph.pairs:
            if match.state in (PairState.USED, PairState.SETTLED):
                pair = self._pairs[names[match.i], names[match.j]]
                assert pair.maps is not None
                for name, seen in zip((names[match.i], names[match.j]), pair.maps, strict=True):
                    robot = self._robots[name]
                    # Pairs are looked at in turns: another's map may be older than what is vouched for.
                    if robot.vouched is None or seen is robot.newest:
                        robot.vouch(seen)
        for name in self._known:
            if name in self._robots:
                self._robots[name].vouch(self._robots[name].newest)

    def _in_world(self, names: list[str], graph: MapGraph) -> dict[str, Pose2]:
        """Return T_world_robot of the robots that hang together with the world frame."""
        if graph.known:
            self._anchor = None
            return {name: T for name, T in zip(names, graph.T_w_i, strict=True) if T is not None}
        groups = [[names[i] for i in members] for members in graph.components if len(members) > 1]
        group = next((group for group in groups if self._anchor in group), None)
        if group is None and groups:
            # The group that most of what was joined before is in; the first, if nothing was.
            group = max(groups, key=lambda group: sum(name in self._last for name in group))
            before = [name for name in group if name in self._last]
            self._anchor = (before or group)[0]
            if not before:  # another world: nothing of the one before is left in it
                self._last, self._poses = {}, {}
                self._drop_canvas()
        if group is None or self._anchor is None:
            self._anchor = None
            return {}
        T_anchor = graph.poses[names.index(self._anchor)]
        T_world_group = self._last.get(self._anchor, Pose2()) @ T_anchor.inverse()
        return {name: T_world_group @ graph.poses[names.index(name)] for name in group}

    def _in_world_frame(
        self, names: list[str], graph: MapGraph, poses: Mapping[str, Pose2]
    ) -> dict[str, NDArray[np.float64]]:
        """Return the covariances of (x, y, theta) of T_world_robot of the robots that have poses."""
        if not poses:
            return {}
        origin = None if self._anchor is None else names.index(self._anchor)
        found = covariances_from(graph, origin)
        theta = 0.0 if self._anchor is None else poses[self._anchor].theta
        return {name: turned(found[names.index(name)], theta) for name in poses}

    def _drop_canvas(self) -> None:
        self._blank, self._canvas = self.blank(), None

    def _still(self, name: str, T: Pose2) -> Pose2:
        before = self._poses.get(name)
        if before is None or name == self._anchor:
            return T
        metres, radians = before.distance_to(T)
        return before if metres < STILL_METRES and radians < STILL_RADIANS else T

    # ------------------------------------------------------------------ what comes out
    def merged(self) -> OccupancyGrid | None:
        """Return the merged map of the robots that are joined; an empty one where none are any more.

        None if none have ever been.

        Raises
        ------
        MergeError, ResolutionError
            The maps cannot be drawn into one (`mapmeld.live.canvas.Canvas`).
        """
        placed = {}
        for name, T in self._poses.items():
            vouched = self._robots[name].vouched
            if vouched is not None:
                placed[name] = (vouched, T)
        if not placed:
            return self.blank()
        first = placed[self._anchor if self._anchor in placed else min(placed)][0]
        if self._canvas is not None and all(
            grid.resolution != self._canvas.resolution for grid, _ in placed.values()
        ):
            self._drop_canvas()
        if self._canvas is not None:
            try:
                return self._canvas.draw(placed, self.settings.fusion)
            except MergeError:
                self._drop_canvas()  # what it holds from before may be far from where robots are now
        self._canvas = Canvas(first.resolution, self.settings.world_frame)
        return self._canvas.draw(placed, self.settings.fusion)

    def blank(self) -> OccupancyGrid | None:
        """Return a map as large as the last merged one, in which nothing is known; None if there was none."""
        blank = None if self._canvas is None else self._canvas.blank()
        blank = self._blank if blank is None else blank
        return None if blank is None else replace(blank, frame_id=self.settings.world_frame)

    @property
    def shown(self) -> tuple[object, ...]:
        """What the merged map is drawn from: equal as long as that is the same."""
        robots = ((name, self._robots[name].version, T) for name, T in sorted(self._poses.items()))
        return (self.settings.fusion, self.settings.world_frame, *robots)

    def state(self) -> FleetState:
        """Return what is known of all robots and pairs."""
        names = sorted(self._robots)
        matches = {} if self._graph is None else {(m.i, m.j): m for m in self._graph.pairs}
        index = {name: i for i, name in enumerate(names)}
        robots = tuple(map(self._robot, names))
        pairs = tuple(
            self._pair_report(a, b, pair, matches.get((index[a], index[b])))
            for (a, b), pair in sorted(self._pairs.items())
        )
        return FleetState(robots, pairs, self._anchor)

    def _robot(self, name: str) -> RobotReport:
        robot, T = self._robots[name], self._poses.get(name)
        known = name in self._known
        return RobotReport(
            name,
            robot.newest.frame_id,
            robot.newest.stamp,
            T,
            None if T is None else self._covariances[name],
            known,
            robot.starts,
            robot.newest.known_area,
            self._why(name),
        )

    def _why(self, name: str) -> str:
        robot = self._robots[name]
        if name in self._known:
            return "its pose is known"
        if name in self._poses:
            return "the world frame hangs on its map" if name == self._anchor else "joined by matches"
        others = ", ".join(other for other in self._groups.get(name, ()) if other != name)
        if others:
            if self._by_known:
                return f"joined with {others}, but no known pose reaches them"
            return f"joined with {others}, but not with those in the world frame"
        if name in self._suspended:
            return "its known pose was that of a mapping before; set it again, or wait for a match"
        if not self.settings.matching:
            return "its pose is not known, and maps are not matched"
        if robot.starts > 1:
            return f"has started anew ({robot.anew}); no match yet"
        return "no match that is believed joins it"

    def _pair_report(self, a: str, b: str, pair: Pair, match: PairMatch | None) -> PairReport:
        best = None if pair.finding is None else pair.finding.best
        state = "unused" if match is None else str(match.state)
        why = pair.why
        if pair.decree is Decree.FORBIDDEN:
            why = "forbidden by the user"
        elif match is not None and match.why:
            why = f"{why}; {match.why}"
        return PairReport(
            a,
            b,
            str(pair.standing),
            "rejected" if best is None else str(best.verdict),
            state,
            None if best is None else best.probability,
            None if best is None else best.similarity,
            None if best is None else best.overlap,
            None if best is None else best.T_a_b,
            pair.decree,
            why,
            0.0 if best is None else best.seconds,
        )

    # ------------------------------------------------------------------ small things
    def _new_pair(self) -> Pair:
        return Pair(self.settings.method, self.settings.parameters, self.settings.evidence)

    def _pair(self, a: str, b: str) -> Pair:
        for name in (a, b):
            if name not in self._robots:
                raise FleetError(self._no_such(name))
        if a == b:
            raise FleetError(f"two robots are needed, not {a} twice")
        return self._pairs[_key(a, b)]

    def _no_such(self, name: str) -> str:
        return f"there is no robot {name!r} (there are: {', '.join(sorted(self._robots)) or 'none'})"


def _key(a: str, b: str) -> tuple[str, str]:
    return (a, b) if a < b else (b, a)
