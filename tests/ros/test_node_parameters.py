import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmeld.live import FleetState, RobotReport
from mapmeld.ros.listening import GRID, Heard, robots_on
from mapmeld.ros.parameters import (
    PARAMETERS,
    ParameterError,
    fleet_settings,
    known_poses,
    limits,
    pose_in_words,
    robot_names,
    two_robots,
)
from mapmeld.ros.throttle import AGAIN, Throttle
from mapmeld.ros.transforms import APART, NOWHERE, frames_of, start_poses_of, transforms_of
from mapmeld.se2 import Pose2

DEFAULTS = {name: about.default for name, about in PARAMETERS.items()}


def test_the_defaults_are_possible() -> None:
    assert robot_names(DEFAULTS) is None
    assert known_poses(DEFAULTS) == {}
    assert fleet_settings(DEFAULTS).matching
    assert limits(DEFAULTS).cpu_share == 1.0


def test_robots_by_name() -> None:
    assert robot_names({"robots": ["/a/", " b", "a"]}) == ["a", "b"]
    with pytest.raises(ParameterError, match="not both"):
        robot_names({"robots": ["auto", "a"]})


@pytest.mark.parametrize("name", ["bad-name", "1st", "a//b", "a b", "a__b", "é", "~", "a/2"])
def test_names_that_ros_has_not_for_topics(name: str) -> None:
    with pytest.raises(ParameterError, match="is no namespace"):
        robot_names({"robots": ["good", name]})


@given(st.builds(Pose2), st.floats(0, 10), st.floats(0, 3))
def test_known_poses_in_words(pose: Pose2, metres: float, angle: float) -> None:
    text = f"/fleet/r1 {pose.x!r} {pose.y!r} {pose.theta!r}"
    name, known = pose_in_words(text)
    assert (name, known.T_w_i) == ("fleet/r1", pose)
    known = pose_in_words(f"{text} {metres!r} {angle!r}")[1]
    assert (known.sigma_metres, known.sigma_theta) == (metres, angle)


def test_degrees_must_be_named() -> None:
    assert math.isclose(pose_in_words("a 1 2 90deg")[1].T_w_i.theta, math.pi / 2)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a",
        "a 1 2",
        "a 1 2 3 4",
        "a 1 2 x",
        "a 1 2 nan",
        "a 1deg 2 3",
        "a 1 2 3 -1 0",
        "a 1 2 3 4 5 6",
        "a 1 2 90",
    ],
)
def test_what_is_no_pose(text: str) -> None:
    with pytest.raises(ParameterError, match="known pose"):
        pose_in_words(text)


def test_two_robots() -> None:
    assert two_robots("/a, b/") == ("a", "b")
    with pytest.raises(ParameterError):
        two_robots("a b c")


def test_robots_that_appear() -> None:
    topics = {"/r1/map": [GRID], "/x/r2/map": [GRID], "/map": [GRID], "/r3/map": ["std_msgs/msg/String"],
              "/own/map": [GRID], "/r4/costmap": [GRID]}  # fmt: skip
    assert robots_on(topics, "map", "", "/own/map") == ["r1", "x/r2"]
    assert robots_on(topics, "map", "x", "/own/map") == ["x/r2"]


def test_warnings_are_said_once_in_a_while() -> None:
    said: list[str] = []
    now = [0.0]
    say = Throttle(said.append, lambda: now[0])
    for _ in range(3):
        say("a", "bad")
    say("b", "worse")
    assert said == ["bad", "worse"]
    now[0] = AGAIN
    say("a", "bad")
    assert said[-1] == "bad (and 2 times before)"


def robot(name: str, frame: str, T: Pose2 | None) -> RobotReport:
    return RobotReport(name, frame, None, T, None if T is None else np.eye(3), False, 1, 0.0, "")


def test_frames_are_never_shared_and_who_leaves_is_hung_apart() -> None:
    T = Pose2(1, 2, 3)
    state = FleetState(
        (robot("a", "map", T), robot("b", "map", None), robot("c", "c/map", T), robot("d", "", T))
    )
    assert frames_of(state, "world") == {"a": "map", "b": "b/map", "c": "c/map", "d": "d/map"}
    both = FleetState((robot("a", "map", T), robot("b", "map", T), robot("c", "map", None)))
    assert frames_of(both, "world") == {"a": "a/map", "b": "b/map", "c": "c/map"}
    neither = FleetState((robot("a", "map", None), robot("b", "map", None)))
    assert frames_of(neither, "world") == {"a": "a/map", "b": "b/map"}
    joined: set[str] = set()
    assert [t[:2] for t in transforms_of(state, "world", joined)] == [
        ("world", "map"), ("world", "c/map"), ("world", "d/map"),
    ]  # fmt: skip
    left = FleetState((robot("c", "c/map", None), robot("d", "d2", T)))
    assert transforms_of(left, "world", joined) == [  # a is forgotten, d has started anew in another frame
        ("world", "d2", T), (APART, "c/map", Pose2()), (APART, "d/map", Pose2()), (APART, "map", Pose2()),
    ]  # fmt: skip
    again = FleetState((robot("c", "c/map", T),))
    assert [t[:2] for t in transforms_of(again, "d2", joined)] == [  # the world itself hangs nowhere
        ("d2", "c/map"), (APART, "d/map"), (APART, "map"),
    ]  # fmt: skip
    assert frames_of(FleetState((robot("a", "world", T),)), "world") == {"a": "a/world"}


def test_start_poses_of_robots_that_leave_hold_no_more() -> None:
    T = Pose2(1, 2, 3)
    once: set[str] = set()
    assert start_poses_of(FleetState((robot("a", "m", None),)), "world", once) == {}
    (told,) = start_poses_of(FleetState((robot("a", "m", T),)), "world", once).values()
    assert told[:2] == ("world", T)
    for state in (FleetState((robot("a", "m", None),)), FleetState()):
        frame, _, covariance = start_poses_of(state, "world", once)["a"]
        assert frame == APART
        assert covariance is NOWHERE
    assert start_poses_of(FleetState((robot("a", "m", T),)), "world", once)["a"][:2] == ("world", T)


def test_publishers_that_were_counted_before_the_first_map_make_none_stale() -> None:
    def heard(counted: float | None, last: float | None, publishers: int = 0) -> Heard:
        topics = ("/a/map", "/a/map_updates")
        return Heard("a", *topics, publishers=publishers, counted=counted, last=last)

    assert not heard(None, None).deserted, "not counted yet"
    assert heard(5.0, None).deserted
    assert heard(5.0, None).stale(6.0, 60.0) is None, "there is no map that could be stale"
    assert not heard(5.0, 5.5).deserted, "counted before the middleware told of any"
    assert heard(5.0, 5.5).stale(6.0, 60.0) is None
    assert "nobody publishes" in str(heard(6.0, 5.5).stale(6.0, 60.0))
    assert heard(6.0, 5.5, 1).stale(6.0, 60.0) is None
    assert "no map for 65 s" in str(heard(6.0, 5.5, 1).stale(70.5, 60.0))
