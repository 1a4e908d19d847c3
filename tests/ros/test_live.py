"""The node on real middleware: it, the robots and who listens are processes of their own."""

import importlib.util
import itertools
import json
import math
import os
import signal
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from drawing import cut, office, school, seen_from
from live_system import Listener, live_system, until

import mapmeld
from mapmeld.grid import OccupancyGrid
from mapmeld.se2 import Pose2

NEEDED = ("rclpy", "nav_msgs", "diagnostic_msgs", "std_srvs", "cyclonedds")
missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(bool(missing), reason='needs ROS 2 middleware: pip install "mapmeld[ros]"'),
]

EXAMPLES = Path(__file__).parents[2] / "examples"
FONG = Path(__file__).parents[2].parent / "shared/data/fong/turtlebot3_1.5_normal"
T_1_2 = Pose2(*yaml.safe_load((EXAMPLES / "maps/truth.yaml").read_text())["transforms"]["T_1_2"])
RIGHT = 0.3
"""[m] At the origin of the other's frame, metres from what both mapped; SLAM has bent the maps a little."""


def off(T: Pose2, truth: Pose2, at: tuple[float, float] = (0.0, 0.0)) -> tuple[float, float]:
    """Metres at a point of the second map, and degrees."""
    dx, dy = T.apply(at) - truth.apply(at)
    return math.hypot(dx, dy), math.degrees(T.distance_to(truth)[1])


def told(transforms: dict[str, tuple[str, Pose2]], a: str, b: str) -> Pose2 | None:
    """T_a_b by /tf_static, if both hang below the world."""
    poses = {name: T for name, (parent, T) in transforms.items() if parent == "world"}
    if f"{a}/map" not in poses or f"{b}/map" not in poses:
        return None
    return poses[f"{a}/map"].inverse() @ poses[f"{b}/map"]


def pair_in_world(listener: Listener, a: str, b: str) -> Pose2 | None:
    return told(listener.transforms[-1], a, b) if listener.transforms else None


def never_jumped(merged: list[OccupancyGrid]) -> bool:
    """Whether all lie on one lattice: origins that differ by whole cells only, and never shrank."""
    first = merged[0]
    for before, now in itertools.pairwise(merged):
        steps = (
            (now.origin.x - first.origin.x) / first.resolution,
            (now.origin.y - first.origin.y) / first.resolution,
        )
        whole = all(abs(step - round(step)) < 1e-3 for step in steps)
        lower = now.origin.x <= before.origin.x + 1e-6 and now.origin.y <= before.origin.y + 1e-6
        if not (whole and lower and now.resolution == first.resolution and now.origin.theta == 0):
            return False
    return True


def shows(merged: OccupancyGrid, grid: OccupancyGrid, T_world_grid: Pose2) -> float:
    """Share of a map's walls that the merged map has, to within a cell or two, where they should be."""
    from scipy.ndimage import binary_dilation

    near = binary_dilation(merged.occupied, iterations=3)
    col, row = np.floor(merged.metres_to_lattice(T_world_grid.apply(grid.centres(grid.occupied)))).T.astype(
        int
    )
    inside = (col >= 0) & (col < merged.shape[1]) & (row >= 0) & (row < merged.shape[0])
    return float(np.count_nonzero(near[row[inside], col[inside]]) / len(col))


def example_states() -> dict[str, list[OccupancyGrid]]:
    pytest.importorskip("rosbags")
    from mapmeld.io.recordings import map_states

    recording = EXAMPLES / "recording/two_robots.mcap"
    return {name: list(map_states(recording, f"/{name}/map")) for name in ("robot_1", "robot_2")}


def test_a_recording_is_replayed_and_nothing_that_is_killed_does_harm() -> None:
    states = example_states()
    with live_system("-p", "estimation_rate:=10.0", "-p", "merging_rate:=5.0") as system:
        listener = system.listener
        first, second = system.robots("first"), system.robots("second")
        for k in range(max(map(len, states.values()))):
            for robots, name in ((first, "robot_1"), (second, "robot_2")):
                if k < len(states[name]):
                    robots.publish(name, states[name][k])
                    robots.tell(sleep=0.3)
        last = {name: grids[-1] for name, grids in states.items()}
        until(lambda: shown(listener, last), "the last maps in the merged one")

        # No wrong merge at any time, by what the transforms said; right at the end.
        matched = [T for T in (told(t, "robot_1", "robot_2") for t in listener.transforms) if T is not None]
        assert matched
        assert all(off(T, T_1_2)[0] < 0.5 and off(T, T_1_2)[1] < 5 for T in matched)
        assert off(matched[-1], T_1_2)[0] < RIGHT
        assert never_jumped(listener.merged)
        assert all(m.frame_id == "world" for m in listener.merged)
        pair = listener.pair("robot_1", "robot_2")
        assert (pair["standing"], pair["state"]) == ("accepted", "used")
        assert float(pair["probability"]) > 0.9
        assert pair["reason"]

        # Who comes late gets what is latched.
        late = system.another_listener()
        until(
            lambda: late.merged and late.transforms and late.statuses and late.start_poses, "what is latched"
        )
        until(lambda: late.merged[-1] == listener.merged[-1], "the same merged map")
        until(lambda: late.transforms[-1] == listener.transforms[-1], "the same transforms")
        assert len(late.start_poses[0].poses) == 2

        # The node is killed, and another one finds the same again from the robots' latched maps.
        before = pair_in_world(listener, "robot_1", "robot_2")
        system.node.kill()
        count = len(listener.transforms)
        system.restart_node()
        until(lambda: len(listener.transforms) > count, "transforms of the node that was started again")
        after = pair_in_world(listener, "robot_1", "robot_2")
        assert before is not None
        assert after is not None
        assert off(before, after)[0] < 0.2
        until(lambda: shown(listener, last), "the merged map of the node that was started again")

        # A robot is killed: it stays with its last map, and is marked.
        second.kill()
        until(lambda: listener.robot("robot_2").get("stale") == "true", "robot_2 to be stale")
        assert listener.robot("robot_1")["stale"] == "false"
        until(
            lambda: "robot_2: stale, nobody publishes its map" in system.node.said(), "a line on the terminal"
        )
        for line in ("robot_1: first map, ", "robot_1: joined, x 0.00 m", "robot_2: joined, x "):
            assert system.node.said().count(line) == 1, "said once"
        assert listener.joined() == {"robot_1", "robot_2"}
        assert shown(listener, last)


def shown(listener: Listener, last: dict[str, OccupancyGrid]) -> bool:
    if not (listener.merged and listener.transforms):
        return False
    poses = listener.transforms[-1]
    return all(
        f"{name}/map" in poses
        and shows(listener.merged[-1], grid, poses[f"{name}/map"][1]) > 0.95
        and listener.robot(name).get("joined") == "true"
        for name, grid in last.items()
    )


@pytest.mark.skipif(not FONG.exists(), reason="the recordings of three robots are not here")
def test_three_robots_that_map_one_house() -> None:
    truth = {key: Pose2(*numbers) for key, numbers in json.loads((FONG / "truth.json").read_text()).items()}
    names = ("tb3_0", "tb3_1", "tb3_2")
    with live_system("-p", "estimation_rate:=10.0", "-p", "merging_rate:=5.0") as system:
        listener, robots = system.listener, system.robots()
        last = {}
        for k in range(80, 2401, 160):
            for name in names:
                path = FONG / name / f"{k:05}.yaml"
                if path.exists():
                    last[name] = mapmeld.load(path)
                    robots.publish(name, last[name])
            robots.tell(sleep=0.5)
        until(lambda: shown(listener, last) and listener.figures["pairs_waiting"] == "0", "the last maps")
        for key, T in truth.items():
            a, b = key.split("__")
            # SLAM's own frames turn and bend while these robots map: up to 0.6 m and 7 degrees, and back.
            found = [T for T in (told(t, a, b) for t in listener.transforms) if T is not None]
            assert found
            assert all(off(guess, T)[0] < 1.0 and off(guess, T)[1] < 10 for guess in found)
            assert off(found[-1], T)[0] < 0.5
            assert off(found[-1], T)[1] < 5
        assert never_jumped(listener.merged)


def example_maps() -> dict[str, OccupancyGrid]:
    return {name: mapmeld.load(EXAMPLES / f"maps/{name}.yaml") for name in ("robot_1", "robot_2")}


def test_services_and_parameters() -> None:
    from diagnostic_msgs.srv import AddDiagnostics
    from rcl_interfaces.srv import DescribeParameters
    from std_srvs.srv import Trigger

    with live_system("-p", "known_pose:=['robot_1 1 2 3']") as system:
        listener, robots = system.listener, system.robots()
        until(lambda: listener.statuses, "the node")
        (warning,) = system.node.warnings()
        assert warning == "there is no parameter known_pose, it is not used; did you mean known_poses?"
        answer = listener.ask(Trigger, "save_map")
        assert not answer.success
        assert "no robots are joined" in answer.message
        for name, grid in example_maps().items():
            robots.publish(name, grid)
        until(lambda: shown(listener, example_maps()), "the merged map")

        answer = listener.ask(Trigger, "save_map")
        assert answer.success, answer.message
        saved = mapmeld.load(system.folder / "merged_map.yaml")
        assert np.array_equal(saved.cells, listener.merged[-1].cells)
        answer = listener.ask(Trigger, "save_map")
        assert not answer.success, "nothing is overwritten unasked"
        assert "choose another save_path, or set save_overwrite to true" in answer.message
        assert set_parameter(listener, "save_path", "floor_%Y") == ""
        assert listener.ask(Trigger, "save_map").success
        assert (system.folder / time.strftime("floor_%Y.yaml")).exists()
        assert set_parameter(listener, "save_overwrite", True) == ""
        assert listener.ask(Trigger, "save_map").success

        # Forbidden: the two come apart, for late joiners too; released, they are joined again.
        for wrong in ("robot_1", "robot_1 robot_9", "robot_1 robot_1"):
            assert not listener.ask(AddDiagnostics, "forbid_pair", load_namespace=wrong).success
        assert listener.ask(AddDiagnostics, "forbid_pair", load_namespace="robot_1 robot_2").success
        until(lambda: not listener.joined(), "the two to be apart")
        until(lambda: not listener.merged[-1].known.any(), "a merged map of nothing")
        assert {parent for parent, _ in listener.transforms[-1].values()} == {"mapmeld_apart"}
        assert listener.pair("robot_1", "robot_2")["decree"] == "forbidden"
        assert listener.ask(AddDiagnostics, "release_pair", load_namespace="robot_1 robot_2").success
        until(lambda: shown(listener, example_maps()), "the merged map again")
        assert listener.ask(AddDiagnostics, "confirm_pair", load_namespace="robot_2 robot_1").success
        until(lambda: listener.pair("robot_1", "robot_2")["decree"] == "confirmed", "the confirmation")

        # Known poses, by service and by parameter; metres and radians, and the yaw.
        assert not listener.ask(AddDiagnostics, "set_known_pose", load_namespace="robot_1 1 2").success
        asked = listener.ask(AddDiagnostics, "set_known_pose", load_namespace="robot_1 1.3 6.9 0.4")
        assert asked.success, asked.message
        until(lambda: world(listener, "robot_1", Pose2(1.3, 6.9, 0.4)) < 1e-6, "the known pose")
        until(
            lambda: world(listener, "robot_2", Pose2(1.3, 6.9, 0.4) @ T_1_2) < 1.0, "the other by its match"
        )
        assert set_parameter(listener, "known_poses", ["robot_1 -2.0 3.0 90deg"]) == ""
        until(lambda: world(listener, "robot_1", Pose2(-2, 3, math.pi / 2)) < 1e-6, "the new known pose")
        assert listener.robot("robot_1")["known_pose"] == "true"

        # Wrong values are refused with a reason; all are described.
        assert "choose from" in set_parameter(listener, "fusion", "mud")
        assert "known pose" in set_parameter(listener, "known_poses", ["robot_1 here"])
        assert set_parameter(listener, "merging_rate", -1.0)
        assert set_parameter(listener, "robot_map_topic", "other")
        assert set_parameter(listener, "fusion", "log-odds") == ""
        assert set_parameter(listener, "world_frame", "hall") == ""
        until(lambda: listener.merged[-1].frame_id == "hall", "the world's new name")
        described = listener.ask(DescribeParameters, "describe_parameters", names=["known_poses"])
        assert "metres" in described.descriptors[0].description

        assert listener.ask(Trigger, "reset").success
        assert listener.ask(AddDiagnostics, "forget_robot", load_namespace="robot_2").success
        until(lambda: listener.joined() == {"robot_1"}, "robot_2 to be forgotten")
        parent, _ = listener.transforms[-1]["robot_2/map"]
        assert parent == "mapmeld_apart"

        # Robots that are named while the node runs: the others go, and come back when they are named again.
        assert "is no namespace" in set_parameter(listener, "robots", ["bad-name"])
        assert set_parameter(listener, "robots", ["robot_2"]) == ""
        until(lambda: not listener.robot("robot_1") and not listener.joined(), "robot_1 to go")
        assert set_parameter(listener, "robots", ["robot_1", "robot_2"]) == ""
        until(lambda: "robot_1" in listener.joined(), "robot_1 to come back by its latched map")


def world(listener: Listener, name: str, truth: Pose2) -> float:
    there = listener.transforms[-1].get(f"{name}/map")
    return math.inf if there is None else sum(off(there[1], truth))


def set_parameter(listener: Listener, name: str, value: object) -> str:
    """Set it by the node's own service; why not, or nothing."""
    from rcl_interfaces.srv import SetParameters
    from rclpy.parameter import Parameter

    parameter = Parameter(name, value=value).to_parameter_msg()
    (result,) = listener.ask(SetParameters, "set_parameters", parameters=[parameter]).results
    return "" if result.successful else str(result.reason) or "refused"


def test_hostile_maps_are_warned_of_once_and_the_others_go_on() -> None:
    with live_system("-p", "max_rate:=8.0", "-p", "estimation_rate:=5.0") as system:
        listener, robots = system.listener, system.robots()
        until(lambda: listener.statuses, "the node")
        good = example_maps()["robot_1"]
        for _ in range(3):
            robots.publish("short", good, changes={"data": [0, 100, 0]})
            robots.publish("nan", good, changes={"resolution": math.nan})
            robots.publish("empty", good, changes={"width": 0, "height": 0, "data": []})
            robots.publish("huge", good, changes={"width": 31_623, "height": 31_623})
            robots.tell(sleep=1.0)
        stranger = mapmeld.load(EXAMPLES / "maps/other_building.yaml")
        robots.publish("stranger", stranger)
        changing = example_maps()["robot_2"]
        robots.publish("changing", changing)
        robots.publish("robot_1", good)
        flood = system.robots("flood")
        flood.tell(flood=["/flood/map", flood.file(school(), "flood/map"), 50, 6])
        robots.publish("robot_2", example_maps()["robot_2"], volatile=True)
        until(lambda: shown(listener, {"robot_1": good}), "the good robots")
        robots.publish("changing", changing, changes={"resolution": 0.1})
        until(lambda: listener.robot("changing").get("starts") == "2", "the change of resolution")
        flood.wait()
        # Best effort, volatile: a map of robot_2 may be lost, and is sent again as robots do.
        ends = iter(range(40))
        while "robot_2" not in listener.joined() and next(ends, None) is not None:
            robots.publish("robot_2", example_maps()["robot_2"], volatile=True)
            robots.tell(sleep=0.5)
            time.sleep(0.5)
        until(lambda: {"robot_1", "robot_2"} <= listener.joined(), "the two good robots")
        pair = pair_in_world(listener, "robot_1", "robot_2")
        assert pair is not None
        assert off(pair, T_1_2)[0] < RIGHT
        assert not listener.joined() & {"short", "nan", "empty", "huge", "changing"}
        assert not listener.joined() & {"stranger", "flood"}
        warnings = system.node.warnings()
        for name in ("short", "nan", "empty", "huge"):
            assert len([w for w in warnings if w.startswith(f"{name}: ignored")]) == 1, warnings
        assert len([w for w in warnings if "cells of 0.1 m now" in w and w.startswith("changing: ")]) == 1
        assert len([w for w in warnings if w.startswith("flood publishes")]) == 1, warnings
        assert "Traceback" not in system.node.said()


def test_a_robot_that_starts_anew_and_updates_of_maps() -> None:
    """Withdrawn when its frame changes, joined again by a new match; patches are laid on the newest map."""
    place = office()
    T_b = Pose2(3.0, -2.0, 0.7)  # b's frame from the place
    with live_system("-p", "estimation_rate:=10.0", "-p", "merging_rate:=5.0") as system:
        listener, robots = system.listener, system.robots()
        part = cut(place, 0.0, 0.0, 13.0, 12.0)
        robots.publish("a", part)
        robots.publish("b", seen_from(cut(place, 3.0, 0.0, 16.0, 12.0), T_b))
        until(lambda: listener.joined() == {"a", "b"}, "a and b to be joined")
        until(lambda: pair_in_world(listener, "a", "b"), "their transforms")
        T = pair_in_world(listener, "a", "b")
        assert T is not None
        assert off(T, T_b.inverse())[0] < 0.1

        # b starts its map anew elsewhere: withdrawn at once, also below the merged map's name.
        T_anew = Pose2(-8.0, 5.0, -1.9)
        robots.publish("b", seen_from(cut(place, 12.0, 8.0, 16.0, 12.0), T_anew))
        until(lambda: listener.robot("b").get("starts") == "2", "b to be seen to start anew")
        until(lambda: not listener.joined(), "the match to be withdrawn")
        assert listener.pair("a", "b")["standing"] == "withdrawn"
        until(lambda: not listener.merged[-1].known.any(), "a merged map of nothing")
        robots.publish("b", seen_from(cut(place, 5.0, 0.0, 16.0, 12.0), T_anew))
        until(lambda: listener.joined() == {"a", "b"}, "b to be joined again")
        until(lambda: pair_in_world(listener, "a", "b"), "their transforms again")
        T = pair_in_world(listener, "a", "b")
        assert T is not None
        assert off(T, T_anew.inverse())[0] < 0.1

        # An update of a's map arrives, though no wheel has its type.
        until(lambda: shown(listener, {"a": part}), "a's map")
        rows = [[100] * 8] * 4
        x, y = 40, 40
        robots.tell(patch="/a/map_updates", x=x, y=y, cells=rows)
        spot = part.lattice_to_metres((x + 4, y + 2))

        def arrived() -> bool:
            merged = listener.merged[-1]
            at = listener.transforms[-1]["a/map"][1].apply(spot)
            col, row = np.floor(merged.metres_to_lattice(at)).astype(int)
            return bool(merged.occupied[row, col])

        assert not arrived()
        until(arrived, "the update in the merged map")


def test_a_matching_process_that_is_killed_is_started_again_and_nothing_is_lost() -> None:
    """Maps that were published once, what was confirmed, forbidden and known, and the world frame."""
    from diagnostic_msgs.srv import AddDiagnostics

    maps = example_maps()
    start = Pose2(1.3, 6.9, 0.4)
    with live_system() as system:
        listener, robots = system.listener, system.robots()
        for name, grid in maps.items():
            robots.publish(name, grid)
        robots.publish("other", maps["robot_2"])
        until(lambda: shown(listener, maps) and "other" in listener.joined(), "all three")
        for service, words in (
            ("set_known_pose", "robot_1 1.3 6.9 0.4"),
            ("confirm_pair", "robot_1 robot_2"),
            ("forbid_pair", "robot_1 other"),
            ("forbid_pair", "robot_2 other"),
        ):
            answer = listener.ask(AddDiagnostics, service, load_namespace=words)
            assert answer.success, answer.message

        def as_told() -> bool:
            decrees = {
                names: listener.pair(*names).get("decree")
                for names in (("robot_1", "robot_2"), ("other", "robot_1"), ("other", "robot_2"))
            }
            return (
                listener.joined() == {"robot_1", "robot_2"}
                and list(decrees.values()) == ["confirmed", "forbidden", "forbidden"]
                and world(listener, "robot_1", start) < 1e-6
                and shown(listener, maps)
            )

        until(as_told, "what was said")
        said = len(listener.transforms)
        for _ in range(2):
            before = listener.figures["matching_pid"]
            os.kill(int(before), signal.SIGKILL)
            # It is on new maps that the node finds the process dead; these are not published again either.
            robots.publish("other", maps["robot_2"])
            until(another_than(before, listener), "another process")
            until(as_told, "all as it was")
        for transforms in listener.transforms[said:]:
            T = told(transforms, "robot_1", "robot_2")
            assert T is None or off(T, T_1_2)[0] < RIGHT, "never anything wrong in between"
        warnings = [w for w in system.node.warnings() if "the matching process died" in w]
        assert len(warnings) == 1, "said once, though it happened twice"
        assert "Traceback" not in system.node.said()


def another_than(pid: str, listener: Listener) -> Callable[[], bool]:
    return lambda: listener.figures["matching_pid"] not in (pid, "")


def test_simulated_time() -> None:
    """Stamps are of /clock; with a clock that stands still, or none at all, maps are merged all the same."""
    with live_system("-p", "use_sim_time:=true") as system:
        listener, robots = system.listener, system.robots()
        maps = example_maps()
        for name, grid in maps.items():
            robots.publish(name, grid)
        until(lambda: shown(listener, maps), "the merged map, without a clock")
        assert listener.merged[-1].stamp in (None, 0.0)
        time_of_day = system.robots("clock")
        time_of_day.tell(clock=[5000, 30, 20])
        until(lambda: listener.stamp > 5000, "the clock to be heard")
        time_of_day.kill()
        before = len(listener.merged)
        cells = maps["robot_1"].cells.copy()
        cells[40:44, 40:48] = 100
        robots.publish("robot_1", replace(maps["robot_1"], cells=cells))
        until(lambda: len(listener.merged) > before, "another merged map, though time stands still")
        stamp = listener.merged[-1].stamp
        assert stamp is not None
        assert 5000 < stamp <= 5300
        assert listener.robot("robot_2")["stale"] == "false"


def test_links_that_lose_packets() -> None:
    """Reliable maps arrive though three of ten packets are lost; others once all of one comes through."""
    maps = example_maps()
    with live_system() as system:
        listener = system.listener
        lossy = {
            "robot_1": system.lossy_robot("robot_1", 300, reliable=True),
            "robot_2": system.lossy_robot("robot_2", 10, reliable=False),
        }
        ends = time.monotonic() + 60
        while listener.joined() != set(maps) and time.monotonic() < ends:
            for name, robot in lossy.items():
                robot.publish(name, maps[name])
            time.sleep(1)
        until(lambda: shown(listener, maps), "both maps, whole")
        pair = pair_in_world(listener, "robot_1", "robot_2")
        assert pair is not None
        assert off(pair, T_1_2)[0] < RIGHT
        assert not system.node.warnings(), "half a map is no map, and nothing to warn of"


def test_known_start_poses_without_matching_lay_maps_with_yaw_and_origins() -> None:
    """Metres, radians, the yaw of the pose and the origins (with yaw) of the maps, all at once."""
    arguments = (
        "-p", "known_init_poses:=true", "-p", "known_poses:=['a 10.0 -4.0 1.5708', 'b -3.0 2.5 -0.7']",
        "-p", "robots:=[a, b]",
    )  # fmt: skip
    a, b = office(), school()
    a = replace(a, origin=Pose2(-2.0, -1.0, 0.3))
    b = replace(b, origin=Pose2(1.0, -6.0, -0.2))
    with live_system(*arguments) as system:
        listener, robots = system.listener, system.robots()
        robots.publish("a", a, frame_id="map")
        robots.publish("b", b, frame_id="map")
        until(lambda: listener.joined() == {"a", "b"} and listener.merged, "the known poses")
        poses = {"a": Pose2(10, -4, 1.5708), "b": Pose2(-3, 2.5, -0.7)}

        def all_there() -> bool:
            pairs = ((a, poses["a"]), (b, poses["b"]))
            return all(shows(listener.merged[-1], grid, T) > 0.99 for grid, T in pairs)

        until(all_there, "both maps where they belong")
        # Both maps call their frame "map": each gets one of its own.
        until(lambda: listener.transforms and len(listener.transforms[-1]) == 2, "both transforms")
        for name, T in poses.items():
            parent, there = listener.transforms[-1][f"{name}/map"]
            assert parent == "world"
            assert sum(off(there, T)) < 1e-6


def test_node_that_is_asked_to_end_does_so_quietly(tmp_path: Path) -> None:
    file = tmp_path / "other.yaml"
    file.write_text("map_merge:\n  ros__parameters:\n    merging_rate: 2.0\n")
    with live_system("--robots", "nobody", "--params-file", str(file)) as system:
        until(lambda: system.listener.statuses, "a status")
        assert system.listener.figures["joined"] == ""
        assert system.node.stop() == 0
        assert "Traceback" not in system.node.said()
        (warning,) = system.node.warnings()
        assert warning == "no parameter in the file is for this node, whose section is mapmeld:"
