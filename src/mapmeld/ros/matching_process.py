"""The node's end of the process that matches: newest maps win, and nobody ever waits for it."""

from __future__ import annotations

import multiprocessing
import threading
import time
import traceback
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import TypeVar

from mapmeld.io.recordings.messages import Patch
from mapmeld.live import Decree, FleetSettings, FleetState
from mapmeld.parallel.local import one_thread_each
from mapmeld.ros.work import Incoming, Limits, Notice, Reply, Round, Start, Wish

MAX_PATCHES = 500
"""Updates of a map that may wait; beyond it they are dropped until the next whole map."""

LONGEST_PAUSE = 30.0
"""[s] Before a process that dies again and again is started once more."""

Answer = Future[tuple[bool, str]]
T = TypeVar("T")


class MatchingProcess:
    """A thread that keeps one process busy with what is newest.

    Every method returns at once and can be called from any thread. If the process dies, another one is
    started, and gets the newest maps again, and what users have said and still holds. Maps on which it dies
    a second time are given up; it goes on with those before.

    Parameters
    ----------
    settings, limits
        To begin with.
    now
        The time of the node [ns].
    on_reply
        Called in the thread with every answer. What it raises is told of, and nothing else comes of it.
    on_notice
        Called in any thread with what is to be logged.
    """

    def __init__(
        self,
        settings: FleetSettings,
        limits: Limits,
        now: Callable[[], int],
        on_reply: Callable[[Reply], object],
        on_notice: Callable[[Notice], object],
    ) -> None:
        self.period = 0.5  # least time between the beginnings of two rounds with new maps [s]
        self.draw_period = 1.0  # and between two merged maps [s]
        self._now, self._on_reply, self._on_notice = now, on_reply, on_notice
        self._settings, self._limits = settings, limits
        self._changed = threading.Condition()
        self._pending: dict[str, Incoming] = {}
        self._overrun: set[str] = set()  # robots whose updates are dropped until their next whole map
        self._wishes: list[Wish] = []
        self._answers: dict[int, Answer] = {}
        self._told: tuple[FleetSettings | None, Limits | None] = (None, None)
        self._number = 0
        self._closing = False
        # What a new process must be told again.
        self._kept: dict[str, Incoming] = {}
        self._lasting: dict[tuple[object, ...], Wish] = {}
        self._state = FleetState()
        self._unconfirmed: dict[tuple[str, str], Wish] = {}
        self._suspects: dict[str, bytes | None] = {}  # maps on which a process died
        self._deaths = 0  # since a process has last finished its work
        self._process: BaseProcess | None = None
        self._pipe: Connection | None = None
        self._thread = threading.Thread(target=self._run, name="matching", daemon=True)
        self._thread.start()

    # ------------------------------------------------------------------ from the callbacks
    def put_map(self, name: str, data: bytes, received: int) -> None:
        """Take the newest map of a robot, serialised; what had waited of that robot is forgotten."""
        with self._changed:
            self._pending[name] = Incoming(data, received)
            self._overrun.discard(name)
            self._changed.notify()

    def put_patch(self, name: str, patch: bytes | Patch, received: int) -> None:
        """Take an update of a robot's map."""
        with self._changed:
            if name in self._overrun:
                return
            incoming = self._pending.setdefault(name, Incoming())
            if len(incoming.patches) < MAX_PATCHES:
                incoming.patches.append((patch, received))
                self._changed.notify()
                return
            self._overrun.add(name)
        self._on_notice(_overrun(name))

    def wish(self, kind: str, *arguments: object) -> Answer:
        """Ask for something (`mapmeld.ros.worker.Wishes`); answers whether it was done, and a sentence."""
        answer: Answer = Future()
        with self._changed:
            self._number += 1
            wish = Wish(self._number, kind, arguments)
            self._wishes.append(wish)
            self._answers[wish.number] = answer
            match kind, arguments:
                case "know", (name, *_):
                    self._lasting["know", name] = wish
                case (("confirm" | "forbid" | "release"), (a, b)):
                    first, second = sorted((str(a), str(b)))
                    self._lasting["pair", first, second] = wish
                    self._unconfirmed.pop((first, second), None)
                case "forget", (name,):
                    for maps in (self._kept, self._pending):
                        maps.pop(str(name), None)
            self._changed.notify()
        return answer

    def change(self, settings: FleetSettings, limits: Limits) -> None:
        """Go on with other settings."""
        with self._changed:
            self._told = (settings, limits)
            self._settings, self._limits = settings, limits
            self._changed.notify()

    def close(self) -> None:
        """End the process and the thread."""
        with self._changed:
            self._closing = True
            self._changed.notify()
            process = self._process
        if process is not None:
            process.terminate()
        self._thread.join(timeout=10)

    @property
    def process_id(self) -> int | None:
        """Of the process that matches."""
        return None if self._process is None else self._process.pid

    # ------------------------------------------------------------------ the thread
    def _run(self) -> None:
        waiting, undrawn = 0, False
        begun = drawn = -1e9
        while True:
            with self._changed:
                while not self._closing:
                    now = time.monotonic()
                    due = min(
                        now if self._wishes or self._told != (None, None) or waiting else now + 3600,
                        begun + self.period if self._pending else now + 3600,
                        drawn + self.draw_period if undrawn else now + 3600,
                    )
                    if due <= now:
                        break
                    self._changed.wait(due - now)
                if self._closing:
                    return self._end()
                begun = time.monotonic()
                draw = begun - drawn >= self.draw_period
                given = Round(self._pending, tuple(self._wishes), *self._told, draw, self._now())
                self._pending, self._wishes, self._told = {}, [], (None, None)
            try:
                reply = self._ask(given)
            except (EOFError, OSError) as error:
                if self._is_closing():
                    return self._end()
                self._after_death(given, error)
                waiting, undrawn = 0, False
                continue
            waiting, undrawn = reply.waiting, reply.undrawn
            if reply.merged is not None:
                drawn = begun
            self._after(given, reply)

    def _is_closing(self) -> bool:
        return self._closing

    def _ask(self, given: Round) -> Reply:
        if self._pipe is None:
            self._start()
        assert self._pipe is not None
        self._pipe.send(given)
        reply: Reply = self._pipe.recv()
        return reply

    def _start(self) -> None:
        # "spawn": a fork of a process in which the middleware has threads can deadlock.
        context = multiprocessing.get_context("spawn")
        from mapmeld.ros.worker import serve

        mine, its = context.Pipe()
        with one_thread_each():
            process = context.Process(target=serve, args=(its,), name="mapmeld matching", daemon=True)
            process.start()
        its.close()
        with self._changed:
            self._process, self._pipe = process, mine
        mine.send(Start(self._settings, self._limits, self._state.poses))

    def _after(self, given: Round, reply: Reply) -> None:
        for wish in given.wishes:
            if wish.kind == "forget":  # once more: its map may have been on its way when that was asked for
                self._kept.pop(str(wish.arguments[0]), None)
        for name, incoming in given.maps.items():
            if incoming.data is not None:
                self._kept[name] = incoming
            elif name in self._kept:
                self._kept[name] = _together(self._kept[name], incoming)
            self._suspects.pop(name, None)
        self._state = reply.state
        if not reply.waiting:
            self._deaths = 0
        self._confirm_again(reply)
        for number, (done, sentence) in reply.answers.items():
            with self._changed:
                answer = self._answers.pop(number)
            answer.set_result((done, sentence))
        for notice in reply.notices:
            self._tell(self._on_notice, notice)
        self._tell(self._on_reply, reply)

    def _tell(self, listener: Callable[[T], object], what: T) -> None:
        try:
            listener(what)
        except Exception as error:  # whatever it is, the robots that map now need the next round
            if self._is_closing():
                return
            at = traceback.extract_tb(error.__traceback__)[-1]
            where = f"{at.name}, line {at.lineno}"
            what_happened = f"{type(error).__name__}: {error} (in {where})"
            with suppress(Exception):
                self._on_notice(
                    Notice("telling", f"telling what was found failed, merging goes on: {what_happened}")
                )

    def _after_death(self, given: Round, error: Exception) -> None:
        self._end()
        names = ", ".join(sorted(given.maps)) or "none"
        given_up = [
            name
            for name, incoming in given.maps.items()
            if name in self._suspects and self._suspects[name] == incoming.data
        ]
        lost = f"; those of {', '.join(sorted(given_up))} are given up" if given_up else ""
        thinned = [name for name, kept in self._kept.items() if len(kept.patches) >= MAX_PATCHES]
        lost += f"; old updates of {', '.join(sorted(thinned))} are lost" if thinned else ""
        self._tell(
            self._on_notice,
            Notice(
                "process",
                f"the matching process died ({type(error).__name__}) on new maps of: {names}; "
                f"it is started again{lost}",
            ),
        )
        for wish in given.wishes:
            with self._changed:
                answer = self._answers.pop(wish.number)
            answer.set_result((False, "the matching process died; ask again"))
        with self._changed:
            for name, incoming in given.maps.items():
                if name not in given_up:
                    self._suspects[name] = incoming.data
                    self._pending[name] = _together(incoming, self._pending.get(name))
            for name, kept in self._kept.items():
                self._pending[name] = _together(kept, self._pending.get(name))
            for wish in self._still_holding():
                self._wish_again(wish)
            # One that dies at once shall not be started in a frenzy.
            self._changed.wait_for(self._is_closing, min(0.5 * 2 ** min(self._deaths, 8), LONGEST_PAUSE))
            self._deaths += 1

    def _still_holding(self) -> list[Wish]:
        """Return what users have said that had not been overtaken, as by a robot that started anew."""
        known = {robot.name: robot.known for robot in self._state.robots}
        decrees = {(pair.a, pair.b): pair.decree for pair in self._state.pairs}
        holding = []
        for (kind, *names), wish in self._lasting.items():
            if kind == "know" and known.get(str(names[0]), True):
                holding.append(wish)
            elif kind == "pair":
                decree = decrees.get((str(names[0]), str(names[1])))
                if decree is Decree.FORBIDDEN and wish.kind == "forbid":
                    holding.append(wish)
                elif decree is Decree.CONFIRMED and wish.kind == "confirm":
                    self._unconfirmed[str(names[0]), str(names[1])] = wish
        return holding

    def _confirm_again(self, reply: Reply) -> None:
        """Confirm pairs that were confirmed before a process died, once they are matched again."""
        for pair in reply.state.pairs:
            if pair.T_a_b is not None and (pair.a, pair.b) in self._unconfirmed:
                with self._changed:
                    self._wish_again(self._unconfirmed.pop((pair.a, pair.b)))

    def _wish_again(self, wish: Wish) -> None:
        self._number += 1
        again = Wish(self._number, wish.kind, wish.arguments)
        self._answers[again.number] = Future()
        self._wishes.append(again)

    def _end(self) -> None:
        with self._changed:
            process, pipe, self._process, self._pipe = self._process, self._pipe, None, None
        if pipe is not None:
            pipe.close()
        if process is not None:
            process.terminate()
            process.join(timeout=5)


def _overrun(name: str) -> Notice:
    text = f"{name}: {MAX_PATCHES} updates wait already; more are left out until its next whole map"
    return Notice(f"{name} updates", text)


def _together(older: Incoming, newer: Incoming | None) -> Incoming:
    """Return what comes of two pieces of news of a robot: updates alone follow the map before them."""
    if newer is None:
        return older
    if newer.data is not None:
        return newer
    return replace(older, patches=[*older.patches, *newer.patches][-MAX_PATCHES:])
