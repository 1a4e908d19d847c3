import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawing import cut, drawn, hall, office, school, seen_from
from growing import T_1_2, T_2_PLACE, grown, two_robots

import mapmeld
from mapmeld.errors import MapmeldError
from mapmeld.grid import OccupancyGrid, ResolutionError
from mapmeld.history import (
    Change,
    EvidenceParameters,
    Follower,
    Standing,
    Step,
    UnknownStrategyError,
    Work,
    follow,
)
from mapmeld.history import evidence_over_time as module
from mapmeld.io.history_writer import write_history
from mapmeld.matching import METHODS, UnknownMethodError, Verdict
from mapmeld.matching.alphabet import AlphabetParameters
from mapmeld.matching.correlative import prepared_map
from mapmeld.matching.correlative.masks import MapMasks
from mapmeld.matching.correlative.wall_map import WallMap, wall_map
from mapmeld.se2 import Pose2


def near(T: Pose2 | None, truth: Pose2) -> bool:
    if T is None:
        return False
    metres, radians = T.distance_to(truth)
    return metres < 0.1 and radians < 0.02


@pytest.fixture(scope="module")
def steps() -> list[Step]:
    return list(follow(*two_robots()))


def test_two_robots_that_meet(steps: list[Step]) -> None:
    assert [step.which for step in steps] == [1, 2] * 5
    assert [step.number for step in steps] == list(range(1, 11))
    assert [step.stamp for step in steps][:4] == [0.0, 5.0, 10.0, 15.0]
    assert steps[0].best is None
    assert steps[0].why == "waiting for the first map of process 2"
    assert steps[1].states == (1, 1)
    accepted = [step.standing is Standing.ACCEPTED for step in steps]
    assert accepted[-1]
    assert not accepted[1], "two strips at both ends of the office have nothing in common"
    assert accepted == sorted(accepted), "what is accepted stays so"
    assert [step.change for step in steps].count(Change.FOUND) == 1
    assert all(near(step.T_1_2, T_1_2) for step in steps if step.standing is Standing.ACCEPTED)


def test_a_step_gives_the_merged_map(steps: list[Step]) -> None:
    assert steps[1].merged() is None
    merged = steps[-1].merged()
    assert merged is not None
    assert merged.known_area > 0.9 * office().known_area
    assert merged.stamp == 45.0


def test_the_least_work_that_will_do(steps: list[Step]) -> None:
    assert steps[0].work is Work.NOTHING
    assert Work.SEARCH in {step.work for step in steps}


def test_an_unchanged_map_costs_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    follower = Follower()
    first, second = two_robots()
    follower.update_1(first[-1])
    found = follower.update_2(second[-1])

    def never(*_: object) -> Any:
        raise AssertionError("computed something")

    monkeypatch.setattr(module, "match", never)
    monkeypatch.setattr(module, "assess", never)
    later = replace(first[-1], cells=first[-1].cells.copy(), stamp=99.0)
    wider = replace(second[-1].extended(3, 4, 5, 6), stamp=100.0)
    for step in (follower.update(1, later), follower.update(2, wider)):
        assert step.work is Work.NOTHING
        assert step.change is Change.NONE
        assert step.best is found.best
        assert step.standing is Standing.ACCEPTED
    assert step.stamp == 100.0
    assert step.states == (2, 2)


def test_what_is_computed_from_a_map_is_computed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    counted: list[MapMasks] = []

    def counting(masks: MapMasks) -> WallMap:
        counted.append(masks)
        return wall_map(masks)

    monkeypatch.setattr(prepared_map, "wall_map", counting)
    first, second = two_robots()
    list(follow(first, second))
    assert len(counted) == len(first) + len(second)


# ---------------------------------------------------------------------- what may happen to a map
def test_maps_that_grow_in_size_and_origin_and_drift_keep_their_match() -> None:
    office_map = office()
    first = [office_map]
    second = []
    T = T_2_PLACE
    for k in range(6):
        T = T @ Pose2(0.03, -0.02, math.radians(0.4))
        second.append(replace(seen_from(office_map, T).extended(k, 2 * k, 1, k), stamp=float(k)))
    found = list(follow([replace(first[0], stamp=0.0)], second))
    assert [step.change for step in found[2:]] == [Change.CONFIRMED] * 5
    assert near(found[-1].T_1_2, T.inverse())


def test_a_map_that_starts_anew_in_another_frame_withdraws_the_match() -> None:
    office_map = office()
    follower = Follower()
    follower.update_1(office_map)
    assert follower.update_2(seen_from(office_map, T_2_PLACE)).standing is Standing.ACCEPTED
    T_new = Pose2(-20.0, 7.0, 2.2)
    corner = follower.update_2(seen_from(cut(office_map, 0, 0, 3, 3), T_new))
    assert corner.change is Change.WITHDRAWN
    assert corner.T_1_2 is None
    assert corner.merged() is None
    assert "map 2 does not lie where it did" in corner.why
    whole = follower.update_2(seen_from(office_map, T_new))
    assert whole.change is Change.SWITCHED
    assert near(whole.T_1_2, T_new.inverse())


def test_a_map_that_jumps_as_a_whole_switches_at_once() -> None:
    office_map = office()
    follower = Follower()
    follower.update_2(office_map)
    follower.update_1(office_map)
    jumped = follower.update_1(office_map.moved(Pose2(8.0, 3.0, 1.0)))
    assert jumped.change is Change.SWITCHED
    assert near(jumped.T_1_2, Pose2(8.0, 3.0, 1.0))


def test_another_building_is_never_accepted() -> None:
    found = list(
        follow(grown(office(), [(0, 0, x, 12) for x in (5, 10, 16)]), grown(school(), [(0, 0, 20, 9)] * 2))
    )
    assert {step.standing for step in found} == {Standing.UNDECIDED}
    assert {step.change for step in found} == {Change.NONE}


def test_a_place_that_looks_the_same_turned_by_half_stays_undecided_until_it_does_not() -> None:
    place = hall()
    cells = place.cells.copy()
    cells[20:100, 20:60] = 100  # a cupboard, seen later, in one corner
    furnished = OccupancyGrid(cells, place.resolution)
    follower = Follower()
    follower.update_1(place)
    both_ways = follower.update_2(seen_from(place, T_2_PLACE))
    assert both_ways.standing is Standing.UNDECIDED
    assert both_ways.best is not None
    assert both_ways.best.verdict is Verdict.AMBIGUOUS
    follower.update_1(furnished)
    decided = follower.update_2(seen_from(furnished, T_2_PLACE))
    assert decided.standing is Standing.ACCEPTED
    assert near(decided.T_1_2, T_1_2)


# ---------------------------------------------------------------------- equivariance
@pytest.mark.parametrize("strategy", ["evidence", "paper"])
def test_the_frames_do_not_matter(strategy: str, steps: list[Step]) -> None:
    S_1, S_2 = Pose2(30.0, -7.0, 2.0), Pose2(-3.0, 11.0, -1.0)
    first, second = two_robots()
    plain = steps if strategy == "evidence" else list(follow(first, second, strategy=strategy))
    moved = list(follow((m.moved(S_1) for m in first), (m.moved(S_2) for m in second), strategy=strategy))
    for one, other in zip(plain, moved, strict=True):
        assert (one.standing, one.change, one.work) == (other.standing, other.change, other.work)
        if one.T_1_2 is not None and other.T_1_2 is not None:
            metres, radians = other.T_1_2.distance_to(S_1 @ one.T_1_2 @ S_2.inverse())
            assert metres < 1e-3
            assert radians < 1e-4


def test_the_processes_play_the_same_part(steps: list[Step]) -> None:
    first, second = two_robots()
    for one, other in zip(steps, follow(second, first), strict=True):
        assert one.standing is other.standing
        assert other.which == 3 - one.which
        if one.T_1_2 is not None and other.T_1_2 is not None:
            metres, radians = other.T_1_2.inverse().distance_to(one.T_1_2)
            assert metres < 1e-6
            assert radians < 1e-6


# ---------------------------------------------------------------------- any method, any input
@pytest.mark.parametrize("method", [name for name in METHODS if name != "feature_akaze"])
@pytest.mark.parametrize("strategy", ["evidence", "paper"])
def test_every_method_can_be_followed(method: str, strategy: str) -> None:
    office_map = office()
    turned = seen_from(office_map, T_2_PLACE)
    found = list(follow([office_map], [cut(turned, 0, 0, 4, 4), turned], method=method, strategy=strategy))
    assert len(found) == 3
    best = found[-1].best
    assert best is not None
    assert best.method == method
    if strategy == "evidence":
        assert found[-1].standing is Standing.UNDECIDED or near(found[-1].T_1_2, T_1_2)


def test_history_folders_by_name(tmp_path: Path, steps: list[Step]) -> None:
    for name, process in zip("ab", two_robots(), strict=True):
        write_history(process, tmp_path / name)
    found = list(mapmeld.follow(tmp_path / "a", str(tmp_path / "b")))
    assert [step.standing for step in found] == [step.standing for step in steps]
    with pytest.raises(MapmeldError, match="no such folder"):
        mapmeld.follow(tmp_path / "a", tmp_path / "nowhere")


def test_states_are_taken_one_by_one() -> None:
    def endless() -> Iterator[OccupancyGrid]:
        while True:
            yield drawn("#.#")

    stepping = follow(endless(), endless())
    assert [next(stepping).number for _ in range(4)] == [1, 2, 3, 4]


def test_maps_with_nothing_on_them() -> None:
    empty = OccupancyGrid(np.zeros((0, 0), np.int8), 0.05)
    blank = OccupancyGrid(np.full((5, 5), -1, np.int8), 0.05)
    for strategy in ("evidence", "paper"):
        found = list(follow([empty, blank, office()], [blank, empty, blank], strategy=strategy))
        assert {step.standing for step in found} == {Standing.UNDECIDED}


def test_what_cannot_be_followed_is_said_before_anything_is_read() -> None:
    with pytest.raises(UnknownStrategyError, match="evidence, paper"):
        follow([], [], strategy="luck")
    with pytest.raises(UnknownMethodError):
        follow([], [], method="luck")
    with pytest.raises(TypeError, match="AlphabetParameters"):
        follow([], [], parameters=AlphabetParameters())
    with pytest.raises(ValueError, match="'paper' has no settings"):
        follow([], [], strategy="paper", evidence=EvidenceParameters())


def test_settings_of_the_strategy_count() -> None:
    place = office()
    always = EvidenceParameters(search_change=0.0)
    grown = replace(
        place, cells=np.where(np.arange(place.cells.size).reshape(place.shape) == 5000, -1, place.cells)
    )
    for evidence, work in ((None, Work.CHECK), (always, Work.SEARCH)):
        assert [step.work for step in follow([place, grown], [place], evidence=evidence)][-1] is work


def test_bad_states() -> None:
    follower = Follower()
    with pytest.raises(TypeError, match="OccupancyGrid, not a str"):
        follower.update_1("a.yaml")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="not 3"):
        follower.update(3, office())  # type: ignore[arg-type]
    follower.update_1(office())
    with pytest.raises(ResolutionError):
        follower.update_2(replace(office(), resolution=50.0))
    assert follower.update_2(office()).standing is Standing.ACCEPTED, "a refused state leaves no trace"
