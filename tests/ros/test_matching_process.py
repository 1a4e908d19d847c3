"""The node's end of the process that matches, without that process."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from live_system import until

from mapmeld.io.recordings.messages import Patch
from mapmeld.live import FleetSettings, FleetState
from mapmeld.ros.matching_process import MAX_PATCHES, MatchingProcess
from mapmeld.ros.work import Limits, Notice, Reply, Round

PATCH = Patch(0, 0, np.zeros((1, 1), np.int8), 1.0)


class Answering(MatchingProcess):
    """Answers each round itself, when it may."""

    def __init__(self, on_reply: Callable[[Reply], object]) -> None:
        self.rounds: list[Round] = []
        self.may = threading.Semaphore(0)
        self.fails = False
        self.notices: list[Notice] = []
        super().__init__(FleetSettings(), Limits(), lambda: 0, on_reply, self.notices.append)
        self.period = 0.0

    def _ask(self, given: Round) -> Reply:
        self.rounds.append(given)
        self.may.acquire()
        if self.fails:
            self.fails = False
            raise EOFError
        answers = {wish.number: (True, "done") for wish in given.wishes}
        return Reply(FleetState(), None, False, (), answers, 0, 0.0, 0.0, 0)

    def done(self, count: int) -> None:
        """Wait until so many rounds have begun."""
        until(lambda: len(self.rounds) >= count, f"round {count}")


@contextmanager
def answering(on_reply: Callable[[Reply], object] = lambda _: None) -> Iterator[Answering]:
    matching = Answering(on_reply)
    try:
        yield matching
    finally:
        matching.fails = False
        matching._closing = True
        for _ in range(10):
            matching.may.release()
        matching.close()


def test_updates_beyond_the_limit_are_left_out_until_the_next_map_and_that_is_said_once() -> None:
    with answering() as matching:
        matching.put_map("a", b"1", 0)
        matching.done(1)
        for _ in range(MAX_PATCHES + 200):
            matching.put_patch("a", PATCH, 0)
        matching.may.release()
        matching.done(2)
        assert len(matching.rounds[1].maps["a"].patches) == MAX_PATCHES
        for _ in range(3):
            matching.put_patch("a", PATCH, 0)  # laid on a map that lacks those before: left out
        matching.put_map("a", b"2", 0)
        matching.put_patch("a", PATCH, 0)
        matching.may.release()
        matching.done(3)
        assert matching.rounds[2].maps["a"].data == b"2"
        assert len(matching.rounds[2].maps["a"].patches) == 1
        (notice,) = matching.notices
        assert notice.text == "a: 500 updates wait already; more are left out until its next whole map"


def test_whatever_goes_wrong_while_a_reply_is_told_of_merging_goes_on() -> None:
    told: list[Reply] = []

    def breaks(reply: Reply) -> None:
        told.append(reply)
        raise RuntimeError("dictionary changed size")

    with answering(breaks) as matching:
        for _ in range(3):
            matching.may.release()
        answers = [matching.wish("reset") for _ in range(1)]
        assert answers[0].result(timeout=60) == (True, "done"), "who asked is answered all the same"
        matching.put_map("a", b"1", 0)
        matching.done(2)
        until(lambda: len(told) == 2, "the second reply")
        until(lambda: len(matching.notices) == 2, "what is logged")
        assert "RuntimeError: dictionary changed size (in breaks" in matching.notices[0].text


def test_a_robot_that_was_forgotten_is_not_brought_back_by_a_death() -> None:
    with answering() as matching:
        matching.put_map("a", b"1", 0)
        matching.done(1)
        matching.wish("forget", "a")  # while its map is on its way
        matching.may.release()
        matching.done(2)
        matching.may.release()
        matching.put_map("b", b"1", 0)
        matching.done(3)
        matching.fails = True
        matching.may.release()
        matching.done(4)
        assert set(matching.rounds[3].maps) == {"b"}
        assert "the matching process died" in matching.notices[0].text
