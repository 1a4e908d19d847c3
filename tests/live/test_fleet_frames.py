"""Which world robots are drawn in, and how exactly they lie there; the matcher says what it is told."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

import mapmeld.live.pair
from mapmeld.grid import OccupancyGrid
from mapmeld.history import Standing
from mapmeld.history.step import Change, Finding, Maps, Work
from mapmeld.live import Decree, Fleet, FleetSettings
from mapmeld.live.fleet import FleetError
from mapmeld.matching import MatchResult, Verdict
from mapmeld.merging.graph import KnownPose
from mapmeld.se2 import Pose2

SPREAD = np.diag([0.01, 0.04, 0.0001])  # of every match


class Told:
    """A strategy that finds the transforms it is told, by the names of the maps' frames."""

    transforms: dict[tuple[str, str], tuple[Pose2, Verdict]] = {}  # noqa: RUF012

    def __init__(self, *_: object) -> None:
        pass

    def update(self, maps: Maps, _: Maps | None) -> Finding:
        nothing = Pose2(1, 1, 1), Verdict.REJECTED
        T, verdict = self.transforms.get((str(maps[0].frame_id), str(maps[1].frame_id)), nothing)
        accepted = verdict is Verdict.ACCEPTED
        probability = 0.98 if accepted else 0.3
        result = MatchResult(T, verdict, "told", probability, 0.9, 0.9, SPREAD)
        standing = Standing.ACCEPTED if accepted else Standing.UNDECIDED
        return Finding(result, standing, Change.NONE, "told", Work.SEARCH)


@pytest.fixture(autouse=True)
def told(monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[tuple[str, str], tuple[Pose2, Verdict]]]:
    monkeypatch.setattr(mapmeld.live.pair, "EvidenceOverTime", Told)
    Told.transforms = {}
    yield Told.transforms
    Told.transforms = {}


def join(a: str, b: str, T: Pose2, verdict: Verdict = Verdict.ACCEPTED) -> None:
    Told.transforms[a, b] = T, verdict


def room(frame: str, resolution: float = 0.05) -> OccupancyGrid:
    cells = np.zeros((80, 80), np.int8)
    cells[10:70, 10] = 100
    return OccupancyGrid(cells, resolution, Pose2(), 1.0, frame)


def again(fleet: Fleet, name: str, shift: float = 0.05) -> None:
    """The robot's next map: the same, its origin a cell further, which is new to the matcher."""
    fleet.put(name, replace(room(name), origin=Pose2(0.0, shift)))


def settled(fleet: Fleet) -> Fleet:
    while fleet.work():
        pass
    fleet.work()
    return fleet


def fleet_of(*names: str) -> Fleet:
    fleet = Fleet()
    for name in names:
        fleet.put(name, room(name))
    return settled(fleet)


def why(fleet: Fleet) -> dict[str, str]:
    return {robot.name: robot.why for robot in fleet.state().robots}


def covariance(fleet: Fleet, name: str) -> NDArray[np.float64]:
    (found,) = (robot.covariance for robot in fleet.state().robots if robot.name == name)
    assert found is not None
    return found


# ---------------------------------------------------------------------- covariances
def test_known_poses_are_as_exact_as_they_were_said_to_be() -> None:
    fleet = Fleet(FleetSettings(matching=False))
    fleet.know("a", KnownPose(Pose2(), 1.0, 0.2))
    fleet.know("b", KnownPose(Pose2(10, 0, math.pi / 2), 0.1, 0.02))
    fleet.put("a", room("a"))
    fleet.put("b", room("b"))
    settled(fleet)
    assert np.allclose(covariance(fleet, "a"), np.diag([1.0, 1.0, 0.04]))
    assert np.allclose(covariance(fleet, "b"), np.diag([0.01, 0.01, 0.0004]))


def test_a_match_adds_to_what_a_known_pose_leaves_open() -> None:
    """By drawing: T_w_b = T_w_a T_a_b, both with errors of their own."""
    T_a_b, T_w_a = Pose2(6, 2, 0.4), Pose2(3, -1, 2.0)
    join("a", "b", T_a_b)
    fleet = fleet_of("a", "b")
    alone = covariance(fleet, "b")  # that of T_a_b, as the graph has it
    fleet.know("a", KnownPose(T_w_a, 0.05, 0.01))
    settled(fleet)
    rng = np.random.default_rng(0)
    ends = []
    for first, second in zip(
        rng.multivariate_normal(np.zeros(3), np.diag([0.05**2, 0.05**2, 0.01**2]), 20_000),
        rng.multivariate_normal(np.zeros(3), alone, 20_000),
        strict=True,
    ):
        one = Pose2(T_w_a.x + first[0], T_w_a.y + first[1], T_w_a.theta + first[2])
        two = Pose2(T_a_b.x + second[0], T_a_b.y + second[1], T_a_b.theta + second[2])
        end = one @ two
        ends.append((end.x, end.y, end.theta))
    drawn = np.cov(np.array(ends).T)
    assert np.allclose(
        covariance(fleet, "b"), drawn, rtol=0.1, atol=0.05 * np.sqrt(drawn[0, 0] * drawn[2, 2])
    )


def test_covariances_are_in_the_world_and_not_in_a_map() -> None:
    """The world hangs on b, turned by a quarter: vague along x of b's map is vague along the world's y."""
    join("b", "c", Pose2(5, 0, 0))
    fleet = Fleet(resume={"b": Pose2(7, 7, math.pi / 2)})
    for name in "bc":
        fleet.put(name, room(name))
    settled(fleet)
    turned = covariance(fleet, "c")
    assert np.array_equal(covariance(fleet, "b"), np.zeros((3, 3)))
    straight = covariance(fleet_of("b", "c"), "c")
    assert straight[0, 0] != pytest.approx(straight[1, 1])
    assert np.allclose(np.diag(turned), straight[[1, 0, 2], [1, 0, 2]])


def test_covariances_are_from_the_anchor_though_another_map_is_first() -> None:
    join("b", "c", Pose2(5, 0, 0))
    fleet = fleet_of("b", "c")
    join("a", "c", Pose2(0, 30, 1.0))
    fleet.put("a", room("a"))
    settled(fleet)
    assert fleet.state().anchor == "b"
    assert not covariance(fleet, "b").any()
    assert np.linalg.eigvalsh(covariance(fleet, "a")).min() > 0
    assert np.allclose(covariance(fleet, "c"), covariance(fleet_of("b", "c"), "c"), rtol=0.5)


# ---------------------------------------------------------------------- one world, and another
def test_groups_that_no_known_pose_reaches_are_told_of() -> None:
    join("a", "b", Pose2(3, 0, 0))
    fleet = fleet_of("a", "b", "z")
    fleet.know("z", KnownPose(Pose2(1, 1, 0), 0.5, 0.1))
    settled(fleet)
    assert set(fleet.state().poses) == {"z"}
    assert why(fleet) == {
        "a": "joined with b, but no known pose reaches them",
        "b": "joined with a, but no known pose reaches them",
        "z": "its pose is known",
    }
    fleet.know("z", None)
    settled(fleet)
    assert fleet.state().poses == {"a": Pose2(), "b": Pose2(3, 0, 0)}


def test_reasons_of_a_second_group_and_without_matching() -> None:
    join("a", "b", Pose2(3, 0, 0))
    join("c", "d", Pose2(3, 0, 0))
    fleet = fleet_of("a", "b", "c", "d")
    assert why(fleet)["c"] == "joined with d, but not with those in the world frame"
    fleet.change(FleetSettings(matching=False))
    settled(fleet)
    assert set(why(fleet).values()) == {"its pose is not known, and maps are not matched"}


def test_a_new_world_knows_nothing_of_the_one_before() -> None:
    join("a", "b", Pose2(3, 0, 0))
    fleet = fleet_of("a", "b", "c", "d")
    fleet.forbid("a", "b")
    settled(fleet)
    join("c", "d", Pose2(0, 2, 0.5))
    again(fleet, "c")
    settled(fleet)
    d = fleet.state().poses["d"]
    assert d == Pose2(0, 2, 0.5)
    join("a", "d", Pose2(7, 7, 1.0))
    again(fleet, "a")
    fleet.put("c", room("c2"))  # starts anew: the world has to hang on d, not on where a was in the first one
    settled(fleet)
    assert set(fleet.state().poses) == {"a", "d"}
    assert fleet.state().poses["d"] == d


def test_a_known_pose_far_away_is_drawn_on_a_canvas_of_its_own() -> None:
    join("a", "b", Pose2(3, 0, 0))
    fleet = fleet_of("a", "b")
    first = fleet.merged()
    assert first is not None
    for far in (Pose2(2000, 3000, 0), Pose2(-5000, 200, 1.0)):
        fleet.know("a", KnownPose(far))
        settled(fleet)
        merged = fleet.merged()
        assert merged is not None
        assert merged.known.any()
        assert max(merged.shape) < 1000
    fleet.know("a", None)
    fleet.forbid("a", "b")
    settled(fleet)
    merged = fleet.merged()
    assert merged is not None, "what was drawn before must not stay"
    assert not merged.known.any()


def test_a_canvas_has_the_cells_of_one_of_its_robots() -> None:
    fleet = Fleet(FleetSettings(matching=False))
    for resolution in (0.05, 0.1):
        for k, name in enumerate("ab"):
            fleet.put(name, room(name, resolution))
            fleet.know(name, KnownPose(Pose2(5 * k, 0, 0)))
        settled(fleet)
        merged = fleet.merged()
        assert merged is not None
        assert merged.resolution == resolution


def test_robots_that_leave_are_not_drawn_even_before_the_next_work() -> None:
    join("a", "b", Pose2(3, 0, 0))
    fleet = fleet_of("a", "b")
    both = fleet.merged()
    assert both is not None
    fleet.put("b", room("b2"))
    one = fleet.merged()
    fleet.forget("a")
    none = fleet.merged()
    assert one is not None
    assert none is not None
    assert 0 < one.known_area < both.known_area
    assert not none.known.any()


# ---------------------------------------------------------------------- what a user has confirmed
def test_what_was_confirmed_is_that_transform() -> None:
    join("a", "b", Pose2(3, 0, 0), Verdict.AMBIGUOUS)
    fleet = fleet_of("a", "b")
    assert not fleet.state().poses
    fleet.confirm("a", "b")
    settled(fleet)
    assert fleet.state().poses["b"] == Pose2(3, 0, 0)
    for T, verdict, expected in (
        (Pose2(-9, 4, 2), Verdict.ACCEPTED, Pose2(3, 0, 0)),  # another place
        (Pose2(3.2, 0, 0), Verdict.ACCEPTED, Pose2(3.2, 0, 0)),  # the same, better
        (Pose2(3.9, 0, 0), Verdict.ACCEPTED, Pose2(3, 0, 0)),  # too far in small steps, too
        (Pose2(3.2, 0, 0), Verdict.REJECTED, Pose2(3, 0, 0)),
    ):
        join("a", "b", T, verdict)
        again(fleet, "b", 0.05 + fleet._looks * 0.05)
        settled(fleet)
        assert fleet.state().pairs[0].decree is Decree.CONFIRMED
        there = fleet.state().poses["b"]
        assert there.distance_to(expected)[0] < 1e-6
    fleet.release("a", "b")
    settled(fleet)
    assert not fleet.state().poses


def test_a_match_that_fails_does_not_undo_what_was_confirmed(monkeypatch: pytest.MonkeyPatch) -> None:
    join("a", "b", Pose2(3, 0, 0))
    fleet = fleet_of("a", "b")
    fleet.confirm("a", "b")

    def fails(*_: object) -> Finding:
        raise FleetError("no")

    monkeypatch.setattr(Told, "update", fails)
    again(fleet, "b")
    settled(fleet)
    assert fleet.state().pairs[0].decree is Decree.CONFIRMED
    assert fleet.state().poses["b"] == Pose2(3, 0, 0)
