"""Follows two mapping processes through every pair of map histories of a place, and of different places.

    python benchmarks/follow_histories.py DATA [--different 30] [--rows rows.json]

DATA holds data sets as docs/datasets.md describes, whose maps have histories in
``maps/history/<name of the map>/`` (docs/histories.md), and trials: folders of history folders,
one for each robot, with a ``truth.json``: ``{"robot_a__robot_b": [x, y, theta]}``. For every pair
the states of both arrive in time order. Counted are, after each state, whether the match that stands is
accepted and right (0.5 m at the middle of the overlap, 5 degrees). The truth is that of the last maps:
the frame of a history stays, but SLAM bends maps, so that earlier states may differ from it.

Each way has its own copies of the maps and takes its turn at every state, in one process with one thread,
so that the times can be compared. "Each state afresh" is `mapmeld.match` on the newest two maps; "everything
anew" the same when nothing computed from the map that did not change is remembered.
"""

from __future__ import annotations

import argparse
import json
import math
import random
import statistics
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import combinations
from pathlib import Path

import cv2

from mapmeld.evaluation.calibration import expected_calibration_error, reliability
from mapmeld.evaluation.score import Tolerance, overlap_centroid, pose_errors
from mapmeld.grid import OccupancyGrid, overlap_share
from mapmeld.history import Change, Follower, Standing
from mapmeld.history.processes import in_time_order
from mapmeld.history.step import Maps, Which
from mapmeld.history.transforms import same_place
from mapmeld.io.history import HistoryFolder, read_history
from mapmeld.matching import Verdict, match
from mapmeld.se2 import Pose2

DIFFERENT = "different places"
ANEW = "correlative, everything anew"
AFRESH = "correlative, each state afresh"
RUNS = {
    "correlative, evidence": ("correlative", "evidence"),
    "correlative, paper": ("correlative", "paper"),
    "alphabet, evidence": ("alphabet", "evidence"),
    "alphabet, paper": ("alphabet", "paper"),
}
FEWEST_STATES = 5
TOLERANCE = Tolerance()


@dataclass(frozen=True)
class Pairing:
    """Two histories, and how the second lies on the first; None for different places."""

    dataset: str
    name: str
    folders: tuple[Path, Path]
    truth: Pose2 | None


@dataclass
class Outcome:
    """What one way of following made of one pairing.

    Attributes
    ----------
    states
        Steps at which there was something to match.
    first_time, first_state, first_overlap
        Of the first accepted and right answer: seconds from the first state of all, number of the step,
        true overlap.
    wrong
        The accepted answers that were not right.
    switches
        How often the accepted transform became another.
    """

    dataset: str
    name: str
    run: str
    same: bool
    states: int = 0
    first_time: float | None = None
    first_state: int | None = None
    first_overlap: float | None = None
    accepted: int = 0
    wrong: list[str] = field(default_factory=list)
    switches: int = 0
    withdrawn: int = 0
    works: dict[str, int] = field(default_factory=dict)
    seconds: list[tuple[str, float]] = field(default_factory=list)
    stated: list[tuple[float, bool]] = field(default_factory=list)
    ends_right: bool = False


# ---------------------------------------------------------------------- what there is to follow
def pairings(data: Path) -> Iterator[Pairing]:
    """Give the pairs of histories of one place."""
    for listing in sorted(data.glob("*/pairs.json")):
        histories = listing.parent / "maps" / "history"
        for pair in json.loads(listing.read_text(encoding="utf-8")):
            folders = tuple(histories / Path(pair[key]).stem for key in ("map1", "map2"))
            if pair["kind"] == "same" and all(map(_is_history, folders)):
                yield Pairing(listing.parent.name, pair["id"], (folders[0], folders[1]), Pose2(*pair["T"]))
    for truth in sorted(data.glob("*/*/truth.json")):
        for name, T in json.loads(truth.read_text(encoding="utf-8")).items():
            first, second = name.split("__")
            folders = truth.parent / first, truth.parent / second
            if all(map(_is_history, folders)):
                yield Pairing(truth.parent.parent.name, name, folders, Pose2(*T))


def of_different_places(same: Sequence[Pairing], count: int, seed: int) -> list[Pairing]:
    """Draw pairs of histories that no chain of true transforms connects."""
    place: dict[Path, int] = {}
    for pairing in same:
        one, two = (place.setdefault(folder, len(place)) for folder in pairing.folders)
        place = {folder: one if number == two else number for folder, number in place.items()}
    apart = [(a, b) for a, b in combinations(sorted(place), 2) if place[a] != place[b]]
    chosen = random.Random(seed).sample(apart, min(count, len(apart)))
    return [Pairing(DIFFERENT, f"{a.name}__{b.name}", (a, b), None) for a, b in chosen]


def _is_history(folder: Path) -> bool:
    return folder.is_dir() and len(list(folder.glob("*.yaml"))) >= FEWEST_STATES


# ---------------------------------------------------------------------- following
@dataclass(frozen=True)
class Answer:
    """What one way of following says after a state."""

    T: Pose2 | None
    accepted: bool
    probability: float | None
    work: str
    seconds: float


class Way:
    """One way of following, with its own copies of the maps, and what came of it."""

    def __init__(self, pairing: Pairing, run: str) -> None:
        self.outcome = Outcome(pairing.dataset, pairing.name, run, pairing.truth is not None)
        self._last: Pose2 | None = None
        self._follower = Follower(RUNS[run][0], strategy=RUNS[run][1]) if run in RUNS else None
        self._maps: dict[int, OccupancyGrid] = {}

    def answer(self, which: Which, grid: OccupancyGrid) -> Answer | None:
        """Take a state; None as long as there is nothing to match."""
        grid = copied(grid)
        if self.outcome.run == ANEW:
            self._maps = {number: copied(other) for number, other in self._maps.items()}
        started = time.perf_counter()
        if self._follower is not None:
            step = self._follower.update(which, grid)
            seconds = time.perf_counter() - started
            if step.change is Change.WITHDRAWN:
                self.outcome.withdrawn += 1
            if step.best is None:
                return None
            accepted = step.standing is Standing.ACCEPTED
            return Answer(step.best.T_a_b, accepted, step.best.probability, str(step.work), seconds)
        self._maps[which] = grid
        if len(self._maps) < 2:
            return None
        best = match(self._maps[1], self._maps[2])
        seconds = time.perf_counter() - started
        return Answer(best.T_a_b, best.verdict is Verdict.ACCEPTED, best.probability, "search", seconds)

    def note(self, answer: Answer, moment: Moment) -> None:
        """Hold an answer against the truth."""
        out = self.outcome
        out.states += 1
        out.works[answer.work] = out.works.get(answer.work, 0) + 1
        out.seconds.append((answer.work, answer.seconds))
        right = moment.is_right(answer.T)
        if answer.probability is not None:
            out.stated.append((answer.probability, right))
        out.ends_right = right and answer.accepted
        if not answer.accepted or answer.T is None:
            return
        out.accepted += 1
        if self._last is not None and not same_place(self._last, answer.T, moment.maps):
            out.switches += 1
        self._last = answer.T
        if not right:
            out.wrong.append(f"{moment.time:g} s, {moment.errors_of(answer.T)}")
        elif out.first_time is None:
            out.first_time, out.first_state, out.first_overlap = moment.time, out.states, moment.overlap


class Moment:
    """The two maps after a state, and the truth about them."""

    def __init__(self, pairing: Pairing, maps: Maps, stamp: float) -> None:
        self.maps = maps
        self.time = stamp
        self.truth = pairing.truth
        self.overlap = 0.0 if self.truth is None else overlap_share(*maps, self.truth)

    def errors_of(self, T: Pose2) -> str:
        """Return the errors in words."""
        if self.truth is None:
            return "a different place"
        metres, radians = self._errors(T, self.truth)
        return f"off by {metres:.2f} m, {math.degrees(radians):.1f} deg"

    def is_right(self, T: Pose2 | None) -> bool:
        """Whether a transform is within the tolerance of the truth."""
        if self.truth is None or T is None:
            return False
        metres, radians = self._errors(T, self.truth)
        return metres <= TOLERANCE.translation and radians <= TOLERANCE.rotation

    def _errors(self, T: Pose2, truth: Pose2) -> tuple[float, float]:
        # Where nothing is known in both, at the middle of what map 1 knows.
        at = overlap_centroid(*self.maps, truth)
        if at is None:
            x, y = self.maps[0].centres(self.maps[0].known).mean(axis=0)
            at = float(x), float(y)
        errors = pose_errors(T, truth, at)
        return errors.translation, errors.rotation


def copied(grid: OccupancyGrid) -> OccupancyGrid:
    """Return an equal grid of which nothing has been computed yet."""
    return replace(grid, cells=grid.cells.copy())


def follow_all(pairing: Pairing, histories: Sequence[HistoryFolder]) -> list[Outcome]:
    """Follow one pairing in every way, state by state."""
    loaded = [list(history) for history in histories]
    beginning = min(states[0].stamp or 0.0 for states in loaded)
    ways = [Way(pairing, run) for run in (ANEW, AFRESH, *RUNS)]
    newest: dict[int, OccupancyGrid] = {}
    for which, grid in in_time_order(*loaded):
        newest[which] = grid
        answers = [way.answer(which, grid) for way in ways]
        if len(newest) == 2:
            moment = Moment(pairing, (newest[1], newest[2]), (grid.stamp or 0.0) - beginning)
            for way, answer in zip(ways, answers, strict=True):
                if answer is not None:
                    way.note(answer, moment)
    return [way.outcome for way in ways]


# ---------------------------------------------------------------------- what came of it
def report(outcomes: Sequence[Outcome]) -> str:
    """Return the tables in Markdown."""
    runs = (ANEW, AFRESH, *RUNS)
    lines = [
        "| histories | method, strategy | pairs | found | first right accepted: s, state, overlap (medians) "
        "| wrong accepted states | withdrawn | switches | ends right | states |",
        "| --- | --- | --: | --: | --- | --: | --: | --: | --: | --: |",
    ]
    datasets = sorted({o.dataset for o in outcomes}, key=lambda d: (d == DIFFERENT, d))
    for dataset in datasets:
        for run in runs:
            chosen = [o for o in outcomes if o.dataset == dataset and o.run == run]
            found = [o for o in chosen if o.first_time is not None]
            first = "-"
            if found:
                seconds, state = (
                    _median(getattr(o, f"first_{what}") for o in found) for what in ("time", "state")
                )
                overlap = _median(o.first_overlap for o in found)
                first = f"{seconds:.0f} s, {state:g}, {100 * overlap:.0f} %"
            lines.append(
                f"| {dataset} | {run} | {len(chosen)} | {len(found)} | {first} "
                f"| {sum(len(o.wrong) for o in chosen)} | {sum(o.withdrawn for o in chosen)} "
                f"| {sum(o.switches for o in chosen)} | {sum(o.ends_right for o in chosen)} "
                f"| {sum(o.states for o in chosen)} |"
            )
    lines += ["", *_times(outcomes, datasets, runs), "", *_calibration(outcomes, runs)]
    return "\n".join(lines)


def _median(values: Iterable[float | None]) -> float:
    return statistics.median(value for value in values if value is not None)


def _times(outcomes: Sequence[Outcome], datasets: Sequence[str], runs: Sequence[str]) -> list[str]:
    lines = [
        "| histories | method, strategy | all steps: ms | ratio to everything anew | to each state afresh "
        "| searches, checks | median ms of a search | of a check |",
        "| --- | --- | --: | --: | --: | --- | --: | --: |",
    ]
    for dataset in datasets:
        of_run = {
            run: [t for o in outcomes if o.dataset == dataset and o.run == run for t in o.seconds]
            for run in runs
        }
        totals = {run: sum(seconds for _, seconds in times) for run, times in of_run.items()}
        for run, times in of_run.items():
            total = totals[run]
            by_work = {w: [1000 * s for work, s in times if work == w] for w in ("search", "check")}
            cells = [f"{statistics.median(v):.1f}" if v else "-" for v in by_work.values()]
            ratios = f"{total / totals[ANEW]:.2f} | {total / totals[AFRESH]:.2f}"
            lines.append(
                f"| {dataset} | {run} | {1000 * total:.0f} | {ratios} "
                f"| {len(by_work['search'])}, {len(by_work['check'])} | {cells[0]} | {cells[1]} |"
            )
    return lines


def _calibration(outcomes: Sequence[Outcome], runs: Sequence[str]) -> list[str]:
    lines = [
        "| method, strategy | answers | ECE | ten bins of equal count: stated / right |",
        "|---|--:|--:|---|",
    ]
    for run in runs:
        stated = [s for o in outcomes if o.run == run for s in o.stated]
        if not stated or "paper" in run:  # there the probability is that of an earlier state
            continue
        p, right = [s[0] for s in stated], [s[1] for s in stated]
        bins = ", ".join(f"{b.stated:.3f} / {b.observed:.3f}" for b in reliability(p, right))
        lines.append(f"| {run} | {len(p)} | {expected_calibration_error(p, right):.4f} | {bins} |")
    return lines


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("data", type=Path, help="folder of the data sets")
    parser.add_argument("--different", type=int, default=30, help="how many pairs of different places")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="only pairs whose name contains this")
    parser.add_argument("--rows", type=Path, help="also write every outcome to this JSON file")
    asked = parser.parse_args()
    cv2.setNumThreads(1)
    same = list(pairings(asked.data))
    if not same:
        sys.exit(f"{asked.data}: no pairs of maps with histories")
    chosen = [
        p for p in (*same, *of_different_places(same, asked.different, asked.seed)) if asked.only in p.name
    ]
    outcomes: list[Outcome] = []
    for number, pairing in enumerate(chosen, start=1):
        print(f"{number}/{len(chosen)} {pairing.name}", file=sys.stderr, flush=True)
        outcomes += follow_all(pairing, [read_history(folder) for folder in pairing.folders])
    print(report(outcomes))
    print()
    for outcome in outcomes:
        if outcome.wrong:
            number, last = len(outcome.wrong), outcome.wrong[-1]
            print(f"wrong: {outcome.run}: {outcome.name}: {number} states, the last at {last}")
    if asked.rows:
        asked.rows.write_text(json.dumps([asdict(outcome) for outcome in outcomes]), encoding="utf-8")


if __name__ == "__main__":
    main()
