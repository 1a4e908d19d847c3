from mapmeld.live import FleetState, RobotReport
from mapmeld.ros.news import news
from mapmeld.ros.parameters import unknown
from mapmeld.se2 import Pose2


def robot(name: str, T: Pose2 | None = None) -> RobotReport:
    return RobotReport(name, "map", None, T, None, False, 1, 40.0, "joined by matches" if T else "no match")


NOTHING = FleetState()
ALONE = FleetState((robot("a"),))
BOTH = FleetState((robot("a", Pose2()), robot("b", Pose2(1.0, -2.0, 0.5))))


def test_robots_that_appear_and_are_joined() -> None:
    assert news(NOTHING, ALONE, {}, {}) == ["a: first map, 40 m2"]
    assert news(ALONE, BOTH, {}, {}) == [
        "a: joined, x 0.00 m, y 0.00 m, yaw 0.000 rad; joined by matches",
        "b: first map, 40 m2",
        "b: joined, x 1.00 m, y -2.00 m, yaw 0.500 rad; joined by matches",
    ]


def test_robots_that_part_and_are_forgotten() -> None:
    assert news(BOTH, ALONE, {}, {}) == ["a: joined no more; no match", "b: forgotten"]


def test_stale_and_back() -> None:
    assert news(BOTH, BOTH, {}, {"a": "no map for 60 s"}) == ["a: stale, no map for 60 s"]
    assert news(BOTH, BOTH, {"a": "no map for 60 s"}, {"a": "no map for 61 s"}) == []
    assert news(BOTH, BOTH, {"a": "no map for 61 s"}, {}) == ["a: sends maps again"]
    assert news(BOTH, ALONE, {"b": "gone"}, {}) == ["a: joined no more; no match", "b: forgotten"]


def test_nothing_new_is_nothing_said() -> None:
    assert news(BOTH, BOTH, {}, {}) == []


def test_parameters_that_are_none() -> None:
    assert unknown(["known_pose", "merging_rte", "nonsense", "qos_overrides./map.depth"]) == [
        "there is no parameter known_pose, it is not used; did you mean known_poses?",
        "there is no parameter merging_rte, it is not used; did you mean merging_rate?",
        "there is no parameter nonsense, it is not used",
    ]
