"""The rules of acceptance, on answers that are made up: what matching says is tested elsewhere."""

import tracemalloc
from collections.abc import Sequence
from dataclasses import replace

import pytest
from drawing import cut, drawn, office, row_of_rooms, seen_from
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.grid import OccupancyGrid
from mapmeld.history import Change, EvidenceParameters, Follower, Standing, Work
from mapmeld.history import evidence_over_time as module
from mapmeld.history.evidence_over_time import EvidenceOverTime
from mapmeld.history.step import Finding, Maps
from mapmeld.matching import Alternative, MatchResult, Verdict
from mapmeld.matching.correlative import CorrelativeParameters
from mapmeld.matching.correlative.matcher import LOOKED_AT
from mapmeld.se2 import Pose2

HERE, THERE = Pose2(1, 2, 0.3), Pose2(-4, 5, 1.9)
Said = dict[Pose2, float]


def answer(said: Said, first: Pose2 | None = None) -> MatchResult:
    """What the matcher says where it gives these transforms these probabilities."""
    if not said:
        return MatchResult(None, Verdict.REJECTED, "nothing to match on", 0.0)
    (best, p), *others = sorted(said.items(), key=lambda item: (item[0] != first, -item[1]))
    verdict = Verdict.ACCEPTED if p >= 0.85 else Verdict.REJECTED
    return MatchResult(
        best, verdict, "made up", p, alternatives=tuple(Alternative(T, 0.1, q) for T, q in others)
    )


class Script:
    """Stands for the matcher: for every state, what is true of the transforms that it knows of."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.said: Said = {}
        self.hidden: set[Pose2] = set()  # what the search misses
        self.first: Pose2 | None = None  # what explains the most, though it need not be the most probable
        self.searches = 0
        self.weighed: list[list[Pose2]] = []
        monkeypatch.setattr(module, "match", self._match)
        monkeypatch.setattr(module, "assess", self._assess)

    def _match(self, *_: object) -> MatchResult:
        self.searches += 1
        return answer({T: p for T, p in self.said.items() if T not in self.hidden}, self.first)

    def _assess(self, a: object, b: object, transforms: Sequence[Pose2], *_: object) -> MatchResult:
        self.weighed.append(list(transforms))
        return answer({T: self.said.get(T, 0.0) for T in transforms}, self.first)


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> Script:
    return Script(monkeypatch)


def maps(area: int = 20) -> Maps:
    return drawn("#" + "." * area), drawn("#" + "." * area)


def play(
    script: Script,
    states: Sequence[Said],
    areas: Sequence[int] | None = None,
    evidence: EvidenceParameters | None = None,
) -> list[Finding]:
    strategy = EvidenceOverTime("correlative", CorrelativeParameters(), evidence)
    found = []
    previous: Maps | None = None
    for k, said in enumerate(states):
        script.said = said
        newest = maps(areas[k] if areas else 20 + 5 * k)
        found.append(strategy.update(newest, previous))
        previous = newest
    return found


def changes(found: Sequence[Finding]) -> list[str]:
    return [str(finding.change) for finding in found]


def test_from_undecided_to_accepted(script: Script) -> None:
    found = play(script, [{HERE: 0.1}, {THERE: 0.6}, {HERE: 0.9, THERE: 0.05}, {HERE: 0.99}])
    assert changes(found) == ["none", "none", "found", "confirmed"]
    assert [f.standing for f in found] == [Standing.UNDECIDED] * 2 + [Standing.ACCEPTED] * 2
    assert [f.best.T_a_b for f in found if f.best] == [HERE, THERE, HERE, HERE]
    assert [f.best.verdict for f in found if f.best][1:3] == [Verdict.REJECTED, Verdict.ACCEPTED]
    assert found[-1].best is not None
    assert found[-1].best.method == "correlative"


def test_an_early_wrong_maximum_is_forgotten(script: Script) -> None:
    found = play(script, [{THERE: 0.9}, {THERE: 0.05, HERE: 0.9}, {THERE: 0.01, HERE: 0.95}])
    assert changes(found) == ["found", "withdrawn", "switched"]
    assert found[1].standing is Standing.WITHDRAWN
    assert found[1].best is not None
    assert found[1].best.verdict is Verdict.AMBIGUOUS, "it is the better one, but not accepted yet"
    assert found[2].best is not None
    assert found[2].best.T_a_b == HERE
    assert "moved by" in found[2].why


def test_clearly_more_evidence_switches_at_once(script: Script) -> None:
    found = play(script, [{THERE: 0.9}, {THERE: 0.001, HERE: 0.98}])
    assert changes(found) == ["found", "switched"]
    assert "0.001" in found[1].why
    assert "0.980" in found[1].why


def test_less_evidence_lowers_before_it_withdraws(script: Script) -> None:
    found = play(script, [{HERE: 0.9}, {HERE: 0.6}, {HERE: 0.4}, {HERE: 0.9}, {HERE: 0.9}])
    assert changes(found) == ["found", "lowered", "withdrawn", "none", "found"]
    assert [f.best.probability for f in found if f.best] == [0.9, 0.6, 0.4, 0.9, 0.9]
    assert found[1].standing is Standing.ACCEPTED
    assert found[3].standing is Standing.WITHDRAWN
    assert "must agree: 1 so far" in found[3].why
    assert found[4].why.startswith("again")


def test_what_agrees_must_do_so_in_a_row(script: Script) -> None:
    three = EvidenceParameters(confirm_states=3)
    states = [{HERE: 0.9}, {HERE: 0.1}, {HERE: 0.9}, {THERE: 0.9}, {THERE: 0.9}, {}, {THERE: 0.9}]
    assert "found" not in changes(play(script, states, evidence=three))[1:]
    assert changes(play(script, [*states, {THERE: 0.9}, {THERE: 0.9}], evidence=three))[-1] == "switched"


def test_nothing_to_match_on_is_no_match(script: Script) -> None:
    found = play(script, [{}, {}])
    assert [f.best.T_a_b for f in found if f.best] == [None, None]
    assert found[0].why == "nothing to match on"


def test_drift_is_no_switch(script: Script) -> None:
    drifted = Pose2(HERE.x + 0.2, HERE.y, HERE.theta + 0.02)
    found = play(script, [{HERE: 0.9}, {drifted: 0.95}])
    # It is found again by the search only: `assess` is asked for the old place.
    assert changes(found) == ["found", "confirmed"]
    assert found[1].best is not None
    assert found[1].best.T_a_b == drifted
    assert "moved by" in found[1].why


# ---------------------------------------------------------------------- what is computed
def test_an_accepted_match_is_checked_and_searched_for_again_only_when_much_has_changed(
    script: Script,
) -> None:
    found = play(script, [{HERE: 0.99}] * 5, areas=[20, 22, 24, 30, 31])
    assert [f.work for f in found] == [Work.SEARCH, Work.CHECK, Work.CHECK, Work.SEARCH, Work.CHECK]
    assert script.searches == 2


def test_a_map_that_shrinks_is_searched_again(script: Script) -> None:
    found = play(script, [{HERE: 0.99}] * 2, areas=[40, 20])
    assert found[1].work is Work.SEARCH


def test_contradiction_makes_it_search(script: Script) -> None:
    found = play(script, [{HERE: 0.99}, {HERE: 0.7}], areas=[20, 20])
    assert found[1].work is Work.SEARCH


def test_while_undecided_small_changes_are_checked_and_promising_ones_searched(script: Script) -> None:
    found = play(script, [{HERE: 0.3}, {HERE: 0.4}, {HERE: 0.9}], areas=[100, 101, 101])
    assert [f.work for f in found] == [Work.SEARCH, Work.CHECK, Work.SEARCH]
    assert changes(found) == ["none", "none", "found"]


def test_what_the_search_misses_is_remembered(script: Script) -> None:
    script.hidden = set()
    strategy = EvidenceOverTime("correlative", CorrelativeParameters())
    script.said = {HERE: 0.99}
    strategy.update(maps(20), None)
    script.hidden = {HERE}
    script.said = {HERE: 0.95, THERE: 0.01}
    found = strategy.update(maps(60), maps(20))
    assert found.work is Work.SEARCH
    assert found.change is Change.CONFIRMED
    assert found.best is not None
    assert found.best.T_a_b == HERE


def test_hopeless_guesses_are_not_carried_along(script: Script) -> None:
    play(script, [{HERE: 0.001}, {THERE: 0.002}], areas=[20, 40])
    assert script.weighed == []


def test_a_method_without_probability_gets_one_from_the_walls(
    script: Script, monkeypatch: pytest.MonkeyPatch
) -> None:
    proposal = MatchResult(HERE, Verdict.REJECTED, "low", None, alternatives=(Alternative(THERE, 0.2),))
    monkeypatch.setattr(module, "match", lambda *_: proposal)
    script.said = {HERE: 0.1, THERE: 0.88}
    found = EvidenceOverTime("alphabet", None).update(maps(), None)
    assert found.change is Change.FOUND
    assert found.best is not None
    assert (found.best.T_a_b, found.best.probability) == (THERE, 0.88)
    assert found.best.method == "alphabet"


def test_a_method_that_does_not_know_how_probable_it_is_meets_the_rivals_of_the_default_method(
    script: Script, monkeypatch: pytest.MonkeyPatch
) -> None:
    proposal = MatchResult(HERE, Verdict.ACCEPTED, "high", None)
    default = answer({THERE: 0.5, HERE: 0.4})
    monkeypatch.setattr(
        module, "match", lambda a, b, method, _: proposal if method == "alphabet" else default
    )
    script.said = {HERE: 0.4, THERE: 0.5}
    found = EvidenceOverTime("alphabet", None).update(maps(), None)
    assert found.standing is Standing.UNDECIDED
    assert script.weighed == [[HERE, THERE]]


def test_only_so_many_of_a_methods_proposals_are_weighed(
    script: Script, monkeypatch: pytest.MonkeyPatch
) -> None:
    many = [Pose2(10 * k, 0, 0) for k in range(9)]
    proposal = MatchResult(
        many[0], Verdict.REJECTED, "", None, alternatives=tuple(Alternative(T, 0.1) for T in many[1:])
    )
    monkeypatch.setattr(
        module, "match", lambda a, b, method, _: proposal if method == "alphabet" else answer({})
    )
    EvidenceOverTime("alphabet", None).update(maps(), None)
    assert script.weighed == [many[:LOOKED_AT]]


def test_rivals_are_weighed_at_every_state_however_unlikely(script: Script) -> None:
    rivals = [Pose2(10 * k, 0, 0) for k in range(1, LOOKED_AT)]
    play(script, [{HERE: 0.99} | dict.fromkeys(rivals, 0.001)] * 3, areas=[20, 20, 20])
    assert script.searches == 1
    assert [set(weighed) for weighed in script.weighed] == [{HERE, *rivals}] * 2


def test_an_accepted_match_keeps_its_rivals_though_another_explains_more(script: Script) -> None:
    """The better one may be less probable: where next to nothing fixes it in some direction, for one."""
    elsewhere = Pose2(20, 0, 0)
    strategy = EvidenceOverTime("correlative", CorrelativeParameters())
    script.said = {HERE: 0.9}
    strategy.update(maps(20), None)
    script.first = THERE
    script.said = {HERE: 0.7, THERE: 0.2, elsewhere: 0.05}
    found = strategy.update(maps(60), maps(20))
    assert found.change is Change.LOWERED
    assert found.best is not None
    assert (found.best.T_a_b, found.best.probability) == (HERE, 0.7)
    assert [o.T_a_b for o in found.best.alternatives] == [THERE, elsewhere]
    assert [o.probability for o in found.best.alternatives] == [0.2, 0.05]


def test_in_a_row_of_rooms_no_method_is_sure() -> None:
    """One that lists few rivals, or none that fit, would be: whichever room it takes, the walls agree."""
    rooms = row_of_rooms(6)
    follower = Follower("hough_spectrum")
    follower.update_1(rooms)
    step = follower.update_2(cut(rooms, 4, 0, 12.1, 5))
    assert step.standing is Standing.UNDECIDED
    assert step.best is not None
    assert step.best.probability is not None
    assert step.best.probability < 0.5
    assert step.best.method == "hough_spectrum"


def test_a_map_that_begins_anew_far_away_costs_no_more() -> None:
    """Evidence is gathered in patches over what both maps cover: gigabytes, if all between counted."""
    follower = Follower()
    follower.update_1(office())
    follower.update_2(seen_from(office(), Pose2(3, -2, 0.7)))
    far = replace(office(), origin=Pose2(1e7, 1e7, 0))
    limit = 200 << 20
    tracemalloc.start()
    step = follower.update_1(far)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert step.change in (Change.SWITCHED, Change.WITHDRAWN)
    assert "map 1 does not lie where it did" in step.why
    assert most < limit


# ---------------------------------------------------------------------- in general
probabilities = st.floats(0, 1, allow_nan=False)


@given(st.lists(st.tuples(probabilities, probabilities, st.integers(20, 60)), max_size=12))
def test_whatever_comes_the_answers_make_sense(states: list[tuple[float, float, int]]) -> None:
    with pytest.MonkeyPatch.context() as patch:
        script = Script(patch)
        said = [{HERE: p / 2 if p + q > 1 else p, THERE: q / 2 if p + q > 1 else q} for p, q, _ in states]
        found = play(script, said, areas=[area for *_, area in states])
    accepted = False
    at: Pose2 | None = None
    for finding, truth in zip(found, said, strict=True):
        best = finding.best
        assert best is not None
        stands = finding.standing is Standing.ACCEPTED
        assert (best.verdict is Verdict.ACCEPTED) == stands
        assert stands == (finding.change in (Change.FOUND, Change.CONFIRMED, Change.LOWERED, Change.SWITCHED))
        assert (finding.change in (Change.CONFIRMED, Change.LOWERED)) == (
            accepted and stands and at == best.T_a_b
        )
        if stands:
            assert best.T_a_b is not None
            assert best.probability == truth[best.T_a_b] >= 0.5
            at = best.T_a_b
        accepted = stands


@pytest.mark.parametrize(
    ("name", "value"),
    [("keep_probability", 1.0), ("sure_probability", 0.0), ("search_change", -0.1), ("confirm_states", 0),
     ("undecided_change", float("nan")), ("remember_probability", -1.0), ("confirm_states", 1.5)],
)  # fmt: skip
def test_settings_without_sense_are_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=name):
        EvidenceParameters(**{name: value})  # type: ignore[arg-type]


def test_nothing_keeps_the_maps(script: Script) -> None:
    import gc
    import weakref

    strategy = EvidenceOverTime("correlative", CorrelativeParameters())
    script.said = {HERE: 0.99}

    def once() -> weakref.ref[OccupancyGrid]:
        newest = maps()
        strategy.update(newest, None)
        return weakref.ref(newest[0])

    kept = once()
    gc.collect()
    assert kept() is None
