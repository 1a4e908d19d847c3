"""Algorithm 1: the more similar of the best matching so far, re-scored on the new maps, and the new one."""

from dataclasses import replace

import pytest
from drawing import cut, office, seen_from
from growing import T_1_2, T_2_PLACE, two_robots

from mapmeld.history import Change, Standing, Work, algorithm1, follow
from mapmeld.history.algorithm1 import Algorithm1, more_similar
from mapmeld.matching import METHODS, MatchResult, Verdict
from mapmeld.matching.alphabet import AlphabetParameters
from mapmeld.se2 import Pose2

WRONG, RIGHT = Pose2(9, 9, 2), Pose2(1, 0, 0)


def result(T: Pose2 | None, similarity: float, verdict: Verdict = Verdict.ACCEPTED) -> MatchResult:
    return MatchResult(T, verdict, "", similarity=similarity)


def test_the_more_similar_stays_and_of_equals_the_previous() -> None:
    best, current = result(WRONG, 0.4), result(RIGHT, 0.5)
    assert more_similar(best, current) is current
    assert more_similar(current, best) is current
    assert more_similar(best, result(RIGHT, 0.4)) is best
    assert more_similar(None, best) is best
    assert more_similar(best, result(None, 0.0)) is best


@pytest.fixture
def played(monkeypatch: pytest.MonkeyPatch) -> Algorithm1:
    """An alphabet whose matching and re-scoring are told below."""
    monkeypatch.setattr(algorithm1, "match", lambda *_: answers.pop(0))
    scored = replace(METHODS["alphabet"], similarity_at=lambda a, b, T, p: rescored.pop(0))
    monkeypatch.setattr(algorithm1, "method_named", lambda _: scored)
    return Algorithm1("alphabet", None)


answers: list[MatchResult] = []
rescored: list[float] = []


def test_an_early_wrong_maximum_is_re_scored_and_then_loses(played: Algorithm1) -> None:
    grid = office()
    answers[:] = [result(WRONG, 0.9), result(RIGHT, 0.3), result(RIGHT, 0.3)]
    rescored[:] = [0.5, 0.2]
    found = [played.update((grid, grid), None) for _ in range(3)]
    assert [f.best.T_a_b for f in found if f.best] == [WRONG, WRONG, RIGHT]
    assert [f.best.similarity for f in found if f.best] == [0.9, 0.5, 0.3]
    assert [f.change for f in found] == [Change.FOUND, Change.CONFIRMED, Change.SWITCHED]
    assert all(f.work is Work.SEARCH for f in found)


def test_the_verdict_is_that_of_the_states_on_which_it_was_found(played: Algorithm1) -> None:
    grid = office()
    answers[:] = [
        result(None, 0.0, Verdict.REJECTED),
        result(RIGHT, 0.2, Verdict.REJECTED),
        result(RIGHT, 0.4),
    ]
    rescored[:] = [0.2, 0.2]
    found = [played.update((grid, grid), None) for _ in range(3)]
    assert [f.standing for f in found] == [Standing.UNDECIDED] * 2 + [Standing.ACCEPTED]
    assert [f.change for f in found] == [Change.NONE, Change.NONE, Change.FOUND]
    assert "moved by 0.00 m" in found[2].why


def test_what_is_accepted_no_more_is_accepted_again_when_similar_enough(played: Algorithm1) -> None:
    grid = office()
    strict = Algorithm1("alphabet", AlphabetParameters(accept_similarity=0.3))
    low = result(WRONG, 0.05, Verdict.REJECTED)
    answers[:] = [result(RIGHT, 0.9), low, low, low]
    rescored[:] = [0.2, 0.4, 0.4]
    found = [strict.update((grid, grid), None) for _ in range(4)]
    assert [f.change for f in found] == [Change.FOUND, Change.WITHDRAWN, Change.FOUND, Change.CONFIRMED]
    assert [f.best.verdict for f in found if f.best] == [
        Verdict.ACCEPTED, Verdict.REJECTED, Verdict.ACCEPTED, Verdict.ACCEPTED
    ]  # fmt: skip


def test_the_overlap_is_that_of_the_new_maps(played: Algorithm1) -> None:
    grid = office()
    answers[:] = [result(Pose2(), 0.9), result(None, 0.0, Verdict.REJECTED)]
    rescored[:] = [0.5]
    played.update((grid, grid), None)
    half = cut(grid, 0, 0, 8, 12)
    best = played.update((grid, replace(half, origin=Pose2(12, 0, 0) @ half.origin)), None).best
    assert best is not None
    assert best.overlap == pytest.approx(0.5, abs=0.01)


def test_a_similarity_below_the_threshold_of_the_method_is_accepted_no_more(played: Algorithm1) -> None:
    grid = office()
    strict = Algorithm1("alphabet", AlphabetParameters(accept_similarity=0.3))
    answers[:] = [result(WRONG, 0.9), result(RIGHT, 0.05, Verdict.REJECTED), result(RIGHT, 0.5)]
    rescored[:] = [0.2, 0.1]
    found = [strict.update((grid, grid), None) for _ in range(3)]
    assert [f.standing for f in found] == [Standing.ACCEPTED, Standing.UNDECIDED, Standing.ACCEPTED]
    assert [f.change for f in found] == [Change.FOUND, Change.WITHDRAWN, Change.SWITCHED]
    assert found[1].best is not None
    assert found[1].best.T_a_b == WRONG
    assert found[1].why.endswith("but not accepted")


def test_on_maps_that_grow() -> None:
    steps = list(follow(*two_robots(), method="alphabet", strategy="paper"))
    best = steps[-1].best
    assert best is not None
    assert best.T_a_b is not None
    assert best.T_a_b.distance_to(T_1_2)[0] < 0.3
    assert best.method == "alphabet"


@pytest.mark.parametrize("name", [name for name in METHODS if name != "feature_akaze"])
def test_every_method_measures_its_own_similarity_again(name: str) -> None:
    method = METHODS[name]
    a, b = office(), seen_from(office(), T_2_PLACE)
    found = method.run(a, b, method.parameters())
    assert found.T_a_b is not None
    assert method.similarity_at(a, b, found.T_a_b, method.parameters()) == pytest.approx(
        found.similarity, abs=1e-3
    )
    elsewhere = Pose2(100.0, 0.0, 0.0) @ found.T_a_b
    assert method.similarity_at(a, b, elsewhere, method.parameters()) == 0.0
    finer = seen_from(office(0.025), T_2_PLACE)
    assert method.similarity_at(a, finer, found.T_a_b, method.parameters()) > 0.3 * found.similarity


@pytest.mark.parametrize("name", list(METHODS))
def test_without_walls_there_is_no_similarity(name: str) -> None:
    method = METHODS[name]
    bare = replace(office(), cells=office().cells * 0)
    assert method.similarity_at(office(), bare, Pose2(), method.parameters()) == 0.0
    assert method.similarity_at(bare, bare, Pose2(), method.parameters()) == 0.0
