"""The process that matches: takes rounds of work from a pipe, one at a time, and answers each."""

from __future__ import annotations

import os
import resource
import signal
import time
from multiprocessing.connection import Connection
from pathlib import Path

from mapmeld.errors import MapmeldError
from mapmeld.grid import OccupancyGrid
from mapmeld.io import MapFileError, save
from mapmeld.io.recordings.messages import (
    BadMessageError,
    Patch,
    is_of_an_earlier_map,
    own_stamp,
    patched,
)
from mapmeld.live import Fleet
from mapmeld.merging.graph import KnownPose
from mapmeld.ros.messages import grid_from_bytes, map_bytes, patch_from_bytes
from mapmeld.ros.work import Incoming, Notice, Reply, Round, Start, Wish

NICENESS = 5
"""The robots' own SLAM and navigation come first."""


def serve(pipe: Connection) -> None:
    """Work off rounds until the other end of the pipe is closed; the first message is a `Start`."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all; the node ends this process
    os.nice(NICENESS)
    import cv2

    cv2.setNumThreads(1)
    try:
        worker = Worker(pipe.recv())
        while True:
            reply = worker.round(pipe.recv())
            pipe.send(reply)
            worker.rest()
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return


class Worker:
    """A fleet that is fed with messages."""

    def __init__(self, start: Start) -> None:
        self.fleet = Fleet(start.settings, start.poses)
        self._limits = start.limits
        self._maps: dict[str, OccupancyGrid] = {}  # updates are laid on these
        self._since: dict[str, float | None] = {}  # the stamps of the last whole maps, if they have their own
        self._drawn: tuple[object, ...] | None = None
        self._busy = 0.0

    def round(self, given: Round) -> Reply:
        """Do one round: take the maps, fulfil the wishes, match one pair, draw."""
        started, cpu = time.perf_counter(), time.process_time()
        notices: list[Notice] = []
        if given.limits is not None:
            self._limits = given.limits
        if given.settings is not None:
            self.fleet.change(given.settings)
        # Robots go before others come: there may be no more room. What is here of them came after that wish.
        wishes = sorted(given.wishes, key=lambda wish: wish.kind != "forget")
        going = sum(wish.kind == "forget" for wish in wishes)
        answers = {wish.number: self._fulfil(wish) for wish in wishes[:going]}
        for name, incoming in given.maps.items():
            notices += self._take(name, incoming)
        answers |= {wish.number: self._fulfil(wish) for wish in wishes[going:]}
        try:
            self.fleet.work()
        except MemoryError:
            notices.append(Notice("memory", "not enough memory to match; smaller maps, or fewer, are needed"))
        state = self.fleet.state()
        merged, undrawn = self._draw(given, notices)
        self._busy = time.process_time() - cpu
        return Reply(
            state,
            merged,
            undrawn,
            tuple(notices),
            answers,
            self.fleet.waiting,
            time.perf_counter() - started,
            time.process_time(),
            memory_of_process(),
        )

    def rest(self) -> None:
        """Pause for as long as keeps the use of the processor within its share."""
        time.sleep(min(self._busy * (1 / self._limits.cpu_share - 1), 60.0))

    # ------------------------------------------------------------------ maps
    def _take(self, name: str, incoming: Incoming) -> list[Notice]:
        notices = []
        if name not in self._maps and len(self._maps) >= self._limits.max_robots:
            return [Notice("robots", f"{name} is left out: more than max_robots, {self._limits.max_robots}")]
        grid, since = self._maps.get(name), self._since.get(name)
        try:
            if incoming.data is not None:
                whole = grid_from_bytes(incoming.data, incoming.received, self._limits.max_cells)
                if whole is None:
                    raise BadMessageError("a map without cells")
                if grid is not None and grid.resolution != whole.resolution:
                    notices.append(
                        Notice(
                            f"{name} resolution",
                            f"{name}: its map has cells of {whole.resolution:g} m now, "
                            f"not {grid.resolution:g} m",
                        )
                    )
                grid, since = whole, own_stamp(whole, incoming.received)
            for item, received in incoming.patches:
                patch = item if isinstance(item, Patch) else patch_from_bytes(item, received)
                if not is_of_an_earlier_map(patch, since):
                    grid = _with(grid, patch)
        except (BadMessageError, ValueError) as error:
            notices.append(Notice(f"{name} map", f"{name}: ignored {error}"))
        if grid is not None and grid is not self._maps.get(name):
            self._maps[name], self._since[name] = grid, since
            anew = self.fleet.put(name, grid)
            if anew:
                notices.append(Notice(f"{name} anew", anew))
        return notices

    # ------------------------------------------------------------------ wishes
    def _fulfil(self, wish: Wish) -> tuple[bool, str]:
        try:
            sentence = str(getattr(Wishes(self.fleet), wish.kind)(*wish.arguments))
            if wish.kind == "forget":
                for kept in (self._maps, self._since):  # an update shall not bring its old map back
                    kept.pop(str(wish.arguments[0]), None)
            return True, sentence
        except MapmeldError as error:
            return False, str(error)

    def _draw(self, given: Round, notices: list[Notice]) -> tuple[bytes | None, bool]:
        shown = self.fleet.shown
        if shown == self._drawn:
            return None, False
        if not given.draw:
            return None, True
        self._drawn = shown
        try:
            merged = self.fleet.merged()
        except MapmeldError as error:
            notices.append(Notice("merged", f"the merged map is not drawn: {error}"))
            merged = self.fleet.blank()  # the one before is right no more
        if merged is None:
            return None, False
        return map_bytes(merged, self.fleet.settings.world_frame, given.now), False


class Wishes:
    """What users can ask for; each returns a sentence."""

    def __init__(self, fleet: Fleet) -> None:
        self._fleet = fleet

    def confirm(self, a: str, b: str) -> str:
        """Take the best match of two robots for right."""
        self._fleet.confirm(a, b)
        return f"the match of {a} and {b} is taken for right"

    def forbid(self, a: str, b: str) -> str:
        """Never join two robots by a match of theirs."""
        self._fleet.forbid(a, b)
        return f"{a} and {b} are not joined by a match of theirs any more"

    def release(self, a: str, b: str) -> str:
        """Take back what was said of two robots."""
        self._fleet.release(a, b)
        return f"{a} and {b} are matched as any others"

    def know(self, name: str, pose: KnownPose | None) -> str:
        """Set a known pose."""
        self._fleet.know(name, pose)
        return f"the pose of {name} is no more known" if pose is None else f"{name} is at {pose.T_w_i}"

    def forget(self, name: str) -> str:
        """Drop a robot."""
        self._fleet.forget(name)
        return f"{name} is forgotten until its next map"

    def reset(self) -> str:
        """Start anew with the newest maps."""
        self._fleet.reset()
        return "all matches are forgotten"

    def save(self, path: str, overwrite: bool) -> str:
        """Write the merged map."""
        merged = self._fleet.merged()
        if merged is None or not self._fleet.state().poses:
            raise BadMessageError("no robots are joined: there is no merged map to save")
        target = Path(path if path.endswith(".yaml") else f"{path}.yaml").expanduser().resolve()
        try:
            save(merged, target, force=overwrite)
        except MapFileError as error:  # as the user of a node can follow it
            advice = "another name, or force=True", "another save_path, or set save_overwrite to true"
            raise BadMessageError(str(error).replace(*advice)) from error
        return f"saved as {target}"


def _with(grid: OccupancyGrid | None, patch: Patch) -> OccupancyGrid:
    if grid is None:
        raise BadMessageError("an update of a map that has not come yet")
    result = patched(grid, patch)
    if result is None:
        raise BadMessageError("an update that does not lie within its map")
    return result


def memory_of_process() -> int:
    """Return the resident memory of this process [bytes]."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * resource.getpagesize()
    except (OSError, IndexError, ValueError):  # no /proc: the highest so far
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
