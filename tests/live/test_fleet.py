import math
from dataclasses import replace

import numpy as np
import pytest
from drawing import cut, office, school, seen_from
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmeld.grid import OccupancyGrid
from mapmeld.live import Decree, Fleet, FleetError, FleetSettings
from mapmeld.live.canvas import BLOCK, Canvas
from mapmeld.live.restart import started_anew
from mapmeld.merging.aligned import MergeError, merge_aligned
from mapmeld.merging.fusion import UnknownFusionError
from mapmeld.merging.graph import KnownPose
from mapmeld.se2 import Pose2

PLACE = office()
T_B = Pose2(3.0, -2.0, 0.7)  # b's frame from the place; a has that of the place itself
T_C = Pose2(-1.0, 4.0, -2.0)
A = cut(PLACE, 0.0, 0.0, 13.0, 12.0)
B = seen_from(cut(PLACE, 3.0, 0.0, 16.0, 12.0), T_B)
C = seen_from(cut(PLACE, 1.0, 0.0, 15.0, 11.0), T_C)


def settled(fleet: Fleet) -> None:
    while fleet.work():
        pass


def near(T: Pose2 | None, truth: Pose2) -> bool:
    return T is not None and T.distance_to(truth)[0] < 0.1 and T.distance_to(truth)[1] < 0.02


def fleet_of(**maps: OccupancyGrid) -> Fleet:
    fleet = Fleet()
    for name, grid in maps.items():
        fleet.put(name, grid)
    settled(fleet)
    return fleet


def test_nothing_comes_of_nothing_or_of_one() -> None:
    fleet = Fleet()
    assert not fleet.work()
    assert fleet.merged() is None
    assert fleet.state().robots == ()
    fleet.put("a", A)
    settled(fleet)
    assert fleet.merged() is None, "an unmerged map is no merged map"
    (robot,) = fleet.state().robots
    assert (robot.joined, robot.starts) == (False, 1)
    assert robot.covariance is None


def test_three_robots_are_joined_in_the_frame_of_the_first() -> None:
    fleet = fleet_of(b=B, a=A, c=C)
    poses = fleet.state().poses
    assert near(poses["a"], Pose2())
    assert near(poses["b"], T_B.inverse())
    assert near(poses["c"], T_C.inverse())
    assert fleet.state().anchor == "a"
    merged = fleet.merged()
    assert merged is not None
    assert merged.frame_id == "world"
    assert merged.known_area > 0.97 * PLACE.known_area
    assert [(p.a, p.b, p.standing) for p in fleet.state().pairs] == [
        ("a", "b", "accepted"), ("a", "c", "accepted"), ("b", "c", "accepted"),
    ]  # fmt: skip
    assert not fleet.work(), "there is nothing to do without new maps"


def test_another_building_stays_apart() -> None:
    fleet = fleet_of(a=A, b=B, z=school())
    assert set(fleet.state().poses) == {"a", "b"}
    z = fleet.state().robots[-1]
    assert "no match" in z.why


def test_one_match_is_made_at_a_time_of_the_pair_that_waited_longest() -> None:
    fleet = Fleet()
    for name, grid in (("a", A), ("b", B), ("c", C)):
        fleet.put(name, grid)
    assert fleet.waiting == 3
    assert fleet.work()
    assert fleet.waiting == 2
    fleet.put("a", replace(A, stamp=1.0))
    assert fleet.waiting == 2, "the same map is nothing new"


def test_a_robot_that_starts_anew_is_withdrawn_at_once_and_the_world_stays() -> None:
    fleet = fleet_of(a=A, b=B, c=C)
    before = fleet.state().poses
    sentence = fleet.put("a", seen_from(cut(PLACE, 0.0, 0.0, 4.0, 5.0), Pose2(-9, 4, 2.0)))
    assert sentence
    assert "anew" in sentence
    fleet.work()
    state = fleet.state()
    assert set(state.poses) == {"b", "c"}
    assert state.robots[0].starts == 2
    for name in ("b", "c"):
        assert near(state.poses[name], before[name]), "the world hung on a's map, and is where it was"
    assert state.anchor in ("b", "c")
    fleet.put("a", seen_from(A, Pose2(-9, 4, 2.0)))
    settled(fleet)
    assert near(fleet.state().poses["a"], Pose2(-9, 4, 2.0).inverse())


def test_when_the_last_match_is_withdrawn_the_merged_map_is_empty() -> None:
    fleet = fleet_of(a=A, b=B)
    first = fleet.merged()
    assert first is not None
    fleet.put("b", replace(school(), frame_id="b2"))
    settled(fleet)
    merged = fleet.merged()
    assert merged is not None
    assert merged.shape == first.shape
    assert not merged.known.any()
    assert fleet.state().pairs[0].standing == "withdrawn"


def test_a_map_that_no_match_vouches_for_is_not_drawn() -> None:
    """A new map is drawn only after it was matched."""
    fleet = fleet_of(a=A, b=B)
    shown, merged = fleet.shown, fleet.merged()
    fleet.put("b", seen_from(cut(PLACE, 2.0, 0.0, 16.0, 12.0), T_B))
    assert fleet.shown == shown
    assert fleet.merged() == merged
    settled(fleet)
    assert fleet.shown != shown


def test_decrees() -> None:
    fleet = fleet_of(a=A, b=B)
    for wrong in (("a", "x"), ("x", "a"), ("a", "a")):
        with pytest.raises(FleetError):
            fleet.confirm(*wrong)
    fleet.forbid("b", "a")
    settled(fleet)
    assert not fleet.state().poses
    assert fleet.state().pairs[0].decree is Decree.FORBIDDEN
    fleet.put("b", cut(B, 0.0, 0.0, 5.0, 5.0))
    settled(fleet)
    assert fleet.waiting == 0, "what is forbidden costs nothing"
    fleet.release("a", "b")
    fleet.put("b", B)
    settled(fleet)
    settled(fleet)
    assert fleet.state().poses


def test_confirming_needs_a_match_and_joins_what_is_not_sure() -> None:
    fleet = Fleet()
    fleet.put("a", A)
    fleet.put("b", B)
    with pytest.raises(FleetError, match="no match"):
        fleet.confirm("a", "b")
    apart = fleet_of(a=cut(PLACE, 0.0, 0.0, 7.5, 12.0), b=cut(PLACE, 5.5, 0.0, 16.0, 7.0))
    if not apart.state().poses:  # whatever the matcher says of so little
        apart.confirm("a", "b")
        settled(apart)
        assert set(apart.state().poses) == {"a", "b"}
    fleet = fleet_of(a=A, b=B)
    fleet.confirm("a", "b")
    settled(fleet)
    assert fleet.state().pairs[0].decree is Decree.CONFIRMED
    fleet.put("b", replace(B, frame_id="another"))
    assert fleet.state().pairs[0].decree is Decree.NONE, "it was said of the mapping before"


def test_known_poses_without_matching() -> None:
    fleet = Fleet(FleetSettings(matching=False))
    fleet.know("a", KnownPose(Pose2(10, -4, 1.5)))
    fleet.put("a", A)
    fleet.put("z", school())
    fleet.know("z", KnownPose(Pose2(-30, 2, -0.5)))
    settled(fleet)
    poses = fleet.state().poses
    assert near(poses["a"], Pose2(10, -4, 1.5))
    assert near(poses["z"], Pose2(-30, 2, -0.5))
    merged = fleet.merged()
    assert merged is not None
    both = A.known_area + school().known_area
    assert math.isclose(merged.known_area, both, rel_tol=0.02)
    fleet.know("z", None)
    settled(fleet)
    assert set(fleet.state().poses) == {"a"}


def test_a_known_pose_is_that_of_one_mapping() -> None:
    fleet = fleet_of(a=A, b=B)
    fleet.know("a", KnownPose(Pose2(1, 2, 0.5)))
    settled(fleet)
    assert near(fleet.state().poses["b"], Pose2(1, 2, 0.5) @ T_B.inverse())
    fleet.put("a", replace(school(), frame_id="a2"))
    settled(fleet)
    state = fleet.state()
    assert not state.robots[0].known
    assert "set it again" in state.robots[0].why


def test_forget_and_reset() -> None:
    fleet = fleet_of(a=A, b=B, c=C)
    fleet.forget("c")
    with pytest.raises(FleetError, match="there is no robot 'c'"):
        fleet.forget("c")
    settled(fleet)
    assert set(fleet.state().poses) == {"a", "b"}
    fleet.reset()
    assert fleet.merged() is None
    settled(fleet)
    assert set(fleet.state().poses) == {"a", "b"}


def test_settings() -> None:
    with pytest.raises(UnknownFusionError):
        FleetSettings(fusion="mud")
    with pytest.raises(ValueError, match="name"):
        FleetSettings(world_frame="")
    fleet = fleet_of(a=A, b=B)
    fleet.forbid("a", "b")
    fleet.change(FleetSettings(method="alphabet", world_frame="hall"))
    assert fleet.state().pairs[0].decree is Decree.FORBIDDEN
    fleet.change(FleetSettings(world_frame="hall"))
    fleet.release("a", "b")
    settled(fleet)
    merged = fleet.merged()
    assert merged is not None
    assert merged.frame_id == "hall"


def test_a_fleet_resumes_where_another_was() -> None:
    fleet = Fleet(resume={"a": Pose2(7, 7, 1.0)})
    fleet.put("a", A)
    fleet.put("b", B)
    settled(fleet)
    assert near(fleet.state().poses["a"], Pose2(7, 7, 1.0))
    assert near(fleet.state().poses["b"], Pose2(7, 7, 1.0) @ T_B.inverse())


def test_cell_sizes_that_cannot_both_be_right_are_told_of() -> None:
    fleet = fleet_of(a=A, b=replace(B, resolution=50.0))
    assert not fleet.state().poses
    assert "cannot be laid over" in fleet.state().pairs[0].why


# ---------------------------------------------------------------------- a mapping that starts anew
def test_growing_and_correcting_is_not_starting_anew() -> None:
    small = cut(PLACE, 0.0, 0.0, 6.0, 8.0)
    assert started_anew(small, PLACE) is None
    assert started_anew(A, A.extended(3, 4, 5, 6)) is None
    assert started_anew(A, A.moved(Pose2(0.2, -0.1, 0.01))) is None
    nothing = replace(A, cells=np.full(A.shape, -1, np.int8))
    assert started_anew(nothing, A) is None


@pytest.mark.parametrize(("theta", "x", "y"), [(0.51, 1.81, -1.55), (0.66, 3.43, -3.66)])
def test_walls_that_agree_by_chance_do_not_hide_a_new_start(theta: float, x: float, y: float) -> None:
    assert started_anew(PLACE, seen_from(PLACE, Pose2(x, y, theta))) is not None


def test_the_same_place_in_another_frame_is_nearly_always_seen_as_starting_anew() -> None:
    rng = np.random.default_rng(0)
    drawn = rng.uniform((-4, -4, 0.5), (4, 4, 5.7), (200, 3)).tolist()
    frames = [Pose2(x, y, theta) for x, y, theta in drawn]
    seen = sum(started_anew(PLACE, seen_from(PLACE, frame)) is not None for frame in frames)
    assert seen >= 180  # some frames lay rooms on like rooms; following the pair has to notice these


def test_another_frame_or_cell_size_is_starting_anew() -> None:
    assert "frame" in str(started_anew(A, replace(A, frame_id="other")))
    assert "cells" in str(started_anew(A, replace(A, resolution=0.1)))


# ---------------------------------------------------------------------- the canvas
def test_the_canvas_never_moves() -> None:
    canvas = Canvas(0.05, "world")
    assert canvas.blank() is None
    seen = []
    for x in (2.0, 6.0, 11.0, 4.0):
        drawn = canvas.draw({"a": (cut(PLACE, 0.0, 0.0, x, 12.0), Pose2(-3.3, 0.2, 0.0))}, "colour")
        assert drawn is not None
        seen.append(drawn)
    for drawn in seen:
        at = np.array([drawn.origin.x, drawn.origin.y]) / (BLOCK * 0.05)
        assert np.allclose(at, np.rint(at))
        assert drawn.shape[0] % BLOCK == drawn.shape[1] % BLOCK == 0
    assert seen[3].shape == seen[2].shape
    assert canvas.draw({}, "colour") is None


@settings(max_examples=30)
@given(T=st.builds(Pose2, st.floats(-20, 20), st.floats(-20, 20), st.floats(-3, 3)))
def test_the_canvas_draws_what_merging_draws(T: Pose2) -> None:
    room = cut(PLACE, 0.0, 0.0, 5.0, 4.0)
    drawn = Canvas(0.05, "world").draw({"a": (room, Pose2()), "b": (room, T)}, "colour")
    assert drawn is not None
    assert (
        abs(drawn.known_area - merge_aligned([room, room], [Pose2(), T]).known_area) < 0.05 * room.known_area
    )


def test_a_canvas_without_end_is_refused_and_the_old_one_stays() -> None:
    canvas = Canvas(0.05, "world")
    small = canvas.draw({"a": (A, Pose2())}, "newest")
    with pytest.raises(MergeError, match="merged map would have"):
        canvas.draw({"a": (A, Pose2()), "b": (B, Pose2(1e6, 1e6, 0))}, "newest")
    assert canvas.draw({"a": (A, Pose2())}, "newest") == small
    nothing = replace(A, cells=np.full(A.shape, -1, np.int8))
    assert Canvas(0.05, "w").draw({"a": (nothing, Pose2())}, "colour") is None
