"""The node: listens to the robots' maps, publishes what `mapmeld.live.Fleet` makes of them.

Callbacks only move bytes; maps are taken apart, matched, drawn and put together in the process of
`MatchingProcess`, and what it answers is published from that one's thread.
"""

from __future__ import annotations

import gc
import importlib.util
import threading
import time
import traceback
from collections.abc import Sequence
from typing import Any

from mapmeld.errors import MapmeldError
from mapmeld.extras import required
from mapmeld.io.recordings.messages import BadMessageError, Patch
from mapmeld.live import FleetState
from mapmeld.ros import dds, listening
from mapmeld.ros.latency import Latencies
from mapmeld.ros.listening import Heard
from mapmeld.ros.matching_process import Answer, MatchingProcess
from mapmeld.ros.messages import pose_array, pose_with_covariance
from mapmeld.ros.news import news
from mapmeld.ros.parameters import (
    PARAMETERS,
    ParameterError,
    fleet_settings,
    known_poses,
    limits,
    pose_in_words,
    robot_names,
    two_robots,
    unknown,
)
from mapmeld.ros.status import diagnostic_array, items_of
from mapmeld.ros.throttle import Throttle
from mapmeld.ros.transforms import frames_of, start_poses_of, static_transforms, transforms_of
from mapmeld.ros.work import Notice, Reply
from mapmeld.ros.worker import memory_of_process

HEARTBEAT = 0.05
"""[s] How often it is measured how late the node comes to its callbacks."""


class MergingNode:
    """Everything of the node but its spinning.

    Parameters
    ----------
    node
        An `rclpy.node.Node`, named and with its parameters' overrides.
    robots
        What parameter ``robots`` is by default.
    """

    def __init__(self, node: Any, robots: Sequence[str] = ("auto",)) -> None:
        self.node = node
        self._say = Throttle(lambda text: node.get_logger().warning(text), time.monotonic)
        self._latencies, self._lateness = Latencies(), Latencies()
        self._state = FleetState()
        self._reply: Reply | None = None
        self._heard: dict[str, Heard] = {}
        self._start_poses: dict[str, Any] = {}
        self._told_starts: dict[str, tuple[object, ...]] = {}
        self._once_joined: set[str] = set()  # frames
        self._once_placed: set[str] = set()  # robots
        self._told: Any = None
        self._logged: tuple[FleetState, dict[str, str]] = (self._state, {})
        self._publishing = threading.Lock()
        self._given_poses: dict[str, Any] = {}
        self._values = self._declared(list(robots))
        self._check(self._values)
        settings = fleet_settings(self._values)

        latched = listening.profile(reliable=True, latched=True)
        nav, geometry = required("nav_msgs.msg", "ros"), required("geometry_msgs.msg", "ros")
        diagnostics = required("diagnostic_msgs.msg", "ros").DiagnosticArray
        self._pose_type = geometry.PoseWithCovarianceStamped
        self._latched = latched
        self._merged = node.create_publisher(nav.OccupancyGrid, self._values["merged_map_topic"], latched)
        self._poses = node.create_publisher(geometry.PoseArray, "~/start_poses", latched)
        self._status = node.create_publisher(diagnostics, "~/status", latched)
        self._diagnostics = node.create_publisher(diagnostics, "/diagnostics", 10)
        self._transforms = static_transforms(node)
        if self._transforms is None:
            self._say("tf", "no transforms on /tf_static: neither tf2_msgs nor cyclonedds can be imported")
        self._update_type = listening.system_updates()
        self._updates: listening.UpdatesByCyclone | None = None

        self.matching = MatchingProcess(
            settings, limits(self._values), self._now, self._on_reply, self._on_notice
        )
        self._apply(self._values)
        self._serve()
        steady = required("rclpy.clock", "ros")
        clock = steady.Clock(clock_type=steady.ClockType.STEADY_TIME)  # goes on though simulated time stands
        timed = self._latencies.timed
        self._beat = time.monotonic()
        self._timers = [
            node.create_timer(1.0, timed(self._tell), clock=clock),
            node.create_timer(HEARTBEAT, self._on_beat, clock=clock),
        ]
        node.add_on_set_parameters_callback(timed(self._on_parameters))
        # Not a callback: the middleware takes its time to tell who is there, and to subscribe.
        self._closing = threading.Event()
        self._looking = threading.Thread(target=self._keep_looking, name="discovery", daemon=True)
        self._looking.start()
        node.get_logger().info(f"merging as {self._merged.topic_name}, transforms by {self._tf_name}")

    @property
    def _tf_name(self) -> str:
        return "nothing" if self._transforms is None else self._transforms.by

    def close(self) -> None:
        """End the process that matches, and all that listens besides the node."""
        self._closing.set()
        self._looking.join(timeout=10)
        self.matching.close()
        if self._updates is not None:
            self._updates.close()
        if self._transforms is not None:
            self._transforms.close()

    def _now(self) -> int:
        return int(self.node.get_clock().now().nanoseconds)

    # ------------------------------------------------------------------ parameters
    def _declared(self, robots: list[str]) -> dict[str, Any]:
        interfaces = required("rcl_interfaces.msg", "ros")
        values = {}
        for name, about in PARAMETERS.items():
            descriptor = interfaces.ParameterDescriptor(
                name=name, description=about.text, read_only=about.fixed
            )
            if isinstance(about.default, float) and about.low is not None:
                descriptor.floating_point_range = [
                    interfaces.FloatingPointRange(from_value=about.low, to_value=about.high, step=0.0)
                ]
            elif isinstance(about.default, int) and about.low is not None and about.high is not None:
                descriptor.integer_range = [
                    interfaces.IntegerRange(from_value=int(about.low), to_value=int(about.high), step=1)
                ]
            default = robots if name == "robots" else about.default
            values[name] = _plain(self.node.declare_parameter(name, default, descriptor).value)
        # ROS itself passes over what a node does not declare.
        given = _given_parameters(self.node)
        for sentence in unknown(name for name in given if not self.node.has_parameter(name)):
            self.node.get_logger().warning(sentence)
        return values

    def _on_parameters(self, parameters: Any) -> Any:
        result = required("rcl_interfaces.msg", "ros").SetParametersResult
        changed = {p.name: _plain(p.value) for p in parameters if p.name in PARAMETERS}
        values = self._values | changed
        try:
            self._check(values)
        except MapmeldError as error:
            return result(successful=False, reason=str(error))
        self._values = values
        if changed:
            self._apply(changed)
        return result(successful=True)

    @staticmethod
    def _check(values: dict[str, Any]) -> None:
        robot_names(values)
        known_poses(values)
        fleet_settings(values)

    def _apply(self, changed: dict[str, Any]) -> None:
        values = self._values
        self.matching.period = 1 / values["estimation_rate"]
        self.matching.draw_period = 1 / values["merging_rate"]
        if changed is not values and changed.keys() & {
            "method", "known_init_poses", "fusion", "world_frame", "max_cells", "max_robots", "cpu_share",
        }:  # fmt: skip
            self.matching.change(fleet_settings(values), limits(values))
        if "known_poses" in changed:
            poses = known_poses(values)
            for name in self._given_poses.keys() - poses.keys():
                self.matching.wish("know", name, None)
            for name, pose in poses.items():
                if self._given_poses.get(name) != pose:
                    self.matching.wish("know", name, pose)
            self._given_poses = poses

    # ------------------------------------------------------------------ robots
    def _keep_looking(self) -> None:
        while True:
            try:
                self._look()
            except Exception:
                if self.node.context.ok():
                    self.node.get_logger().error(f"looking for robots failed: {traceback.format_exc()}")
            if self._closing.wait(1 / self._values["discovery_rate"]) or not self.node.context.ok():
                return

    def _look(self) -> None:
        """Find robots, and listen to each as its publishers allow."""
        topics = dict(self.node.get_topic_names_and_types())
        named = robot_names(self._values)
        if named is not None:
            for name in self._heard.keys() - set(named):
                self._leave(name)
            for robot in self._state.robots:
                if robot.name not in named:
                    self.matching.wish("forget", robot.name)
        fragment, map_topic = self._values["robot_namespace"], self._values["robot_map_topic"]
        names = listening.robots_on(topics, map_topic, fragment, self._merged.topic_name)
        for name in names if named is None else named:
            if name not in self._heard and self._has_room(name, anybody=named is None):
                base = f"/{name}/"
                self._heard[name] = Heard(
                    name,
                    base + map_topic.strip("/"),
                    base + self._values["robot_map_updates_topic"].strip("/"),
                )
                self.node.get_logger().info(f"listening to {self._heard[name].map_topic}")
        for heard in self._heard.values():
            try:
                self._listen(heard, topics)
            except Exception as error:  # what is wrong with one robot is no other's harm
                if not self.node.context.ok():
                    raise
                self._say(f"{heard.name} listening", f"{heard.name} cannot be listened to: {error}")

    def _has_room(self, name: str, *, anybody: bool) -> bool:
        """Whether one more robot may be listened to; anybody takes the place of one that has gone."""
        if len(self._heard) < self._values["max_robots"]:
            return True
        map_topic = f"/{name}/{self._values['robot_map_topic'].strip('/')}"
        gone = [h for h in self._heard.values() if h.deserted and h.name not in self._state.poses]
        if anybody and not self.node.count_publishers(map_topic):
            return False  # others listen to it as well, that is why there is the topic
        if anybody and gone:
            self._leave(min(gone, key=lambda heard: heard.last or 0.0).name)
            return True
        self._say("robots", f"{name} is left out: there are max_robots, {len(self._heard)}, already")
        return False

    def _leave(self, name: str) -> None:
        """Listen to a robot no more, and forget it."""
        heard = self._heard.pop(name)
        if heard.subscription is not None:
            self.node.destroy_subscription(heard.subscription)
        if self._updates is not None and heard.updates is self._updates:
            self._updates.leave(name)
        elif heard.updates is not None:
            self.node.destroy_subscription(heard.updates)
        self.matching.wish("forget", name)
        self.node.get_logger().info(f"listening no more to {heard.map_topic}")

    def _listen(self, heard: Heard, topics: dict[str, list[str]]) -> None:
        now = time.monotonic()
        publishers = self.node.get_publishers_info_by_topic(heard.map_topic)
        publishers = [p for p in publishers if p.topic_type == listening.GRID]
        heard.publishers, heard.counted = len(publishers), now
        if len(publishers) > 1:
            said = f"{len(publishers)} publish {heard.map_topic}; a robot's map is to have one publisher"
            self._say(f"{heard.name} publishers", said)
        quality = listening.quality_of(publishers)
        if heard.subscription is None or (publishers and quality != heard.quality):
            if heard.subscription is not None:
                self.node.destroy_subscription(heard.subscription)
            heard.quality = quality
            heard.subscription = self.node.create_subscription(
                required("nav_msgs.msg", "ros").OccupancyGrid,
                heard.map_topic,
                self._latencies.timed(lambda data, heard=heard: self._on_map(heard, data)),
                listening.profile(*quality),
                raw=True,
            )
        if heard.updates is None and listening.UPDATE in topics.get(heard.updates_topic, ()):
            self._listen_to_updates(heard)

    def _listen_to_updates(self, heard: Heard) -> None:
        publishers = self.node.get_publishers_info_by_topic(heard.updates_topic)
        reliable, _ = listening.quality_of(publishers)
        if self._update_type is not None:
            heard.updates = self.node.create_subscription(
                self._update_type,
                heard.updates_topic,
                self._latencies.timed(lambda data, heard=heard: self._on_update(heard, bytes(data))),
                listening.profile(reliable, latched=False, depth=100),
                raw=True,
            )
        elif dds.available():
            if self._updates is None:
                self._updates = listening.UpdatesByCyclone(self.node.context.get_domain_id(), self._on_patch)
            self._updates.listen(heard.name, heard.updates_topic, reliable)
            heard.updates = self._updates
        else:
            self._say(
                f"{heard.name} updates",
                f"{heard.updates_topic} is not read: neither map_msgs nor cyclonedds can be imported",
            )

    def _on_map(self, heard: Heard, data: bytes) -> None:
        if self._heard.get(heard.name) is not heard:
            return  # on its way when it was listened to for the last time
        now = time.monotonic()
        heard.last = now
        began, count = heard.second
        if now - began >= 1.0:
            rate = count / (now - began)
            if rate > self._values["max_rate"]:
                self._say(
                    f"{heard.name} rate",
                    f"{heard.name} publishes {rate:.0f} maps per second; only the newest are looked at",
                )
            heard.second = (now, 1)
        else:
            heard.second = (began, count + 1)
        self.matching.put_map(heard.name, bytes(data), time.time_ns())

    def _on_update(self, heard: Heard, data: bytes) -> None:
        if self._heard.get(heard.name) is not heard:
            return
        heard.last = time.monotonic()
        self.matching.put_patch(heard.name, data, time.time_ns())

    def _on_patch(self, name: str, patch: Patch | BadMessageError) -> None:
        if isinstance(patch, BadMessageError):
            self._on_notice(Notice(f"{name} map", f"{name}: ignored {patch}"))
            return
        heard = self._heard.get(name)
        if heard is None:
            return
        heard.last = time.monotonic()
        self.matching.put_patch(name, patch, time.time_ns())

    def _stale(self) -> dict[str, str]:
        now, after = time.monotonic(), self._values["stale_after"]
        found = {name: heard.stale(now, after) for name, heard in list(self._heard.items())}
        return {name: why for name, why in found.items() if why is not None}

    # ------------------------------------------------------------------ what comes of it
    def _on_notice(self, notice: Notice) -> None:
        self._say(notice.about, notice.text)

    def _on_reply(self, reply: Reply) -> None:
        """Publish what has changed; called in the thread of `MatchingProcess`."""
        world, now = self._values["world_frame"], self._now()
        self._state, self._reply = reply.state, reply
        if reply.merged is not None:
            self._merged.publish(reply.merged)
        self._tell_start_poses(reply.state, world, now)
        transforms = transforms_of(reply.state, world, self._once_joined)
        told = (world, transforms, self._values["publish_tf"])
        if told == self._told:
            return
        if self._transforms is not None and self._values["publish_tf"] and transforms:
            self._transforms.send(transforms, now)
        self._poses.publish(pose_array(list(reply.state.poses.values()), world, now))
        self._told = told
        self._tell()

    def _tell_start_poses(self, state: FleetState, world: str, now: int) -> None:
        for name, (frame, T, covariance) in start_poses_of(state, world, self._once_placed).items():
            told = (frame, T, covariance.tobytes())
            if told == self._told_starts.get(name):
                continue
            publisher = self._start_poses.get(name)
            if publisher is None:
                topic = f"/{name}/start_pose"
                publisher = self.node.create_publisher(self._pose_type, topic, self._latched)
                self._start_poses[name] = publisher
            publisher.publish(pose_with_covariance(T, covariance, frame, now))
            self._told_starts[name] = told

    def _tell(self) -> None:
        """Publish the status."""
        reply, state = self._reply, self._state
        frames = frames_of(state, self._values["world_frame"])
        figures = {
            "world_frame": self._values["world_frame"],
            "anchor": state.anchor or "",
            "robots": " ".join(robot.name for robot in state.robots),
            "joined": " ".join(state.poses),
            "frames": " ".join(frames.values()),
            "transforms_by": self._tf_name,
            "pairs_waiting": "" if reply is None else str(reply.waiting),
            "round_seconds": "" if reply is None else f"{reply.seconds:.3f}",
            "matching_pid": str(self.matching.process_id or ""),
            "matching_cpu_seconds": "" if reply is None else f"{reply.cpu_seconds:.2f}",
            "matching_memory_mb": "" if reply is None else f"{reply.memory / 1e6:.1f}",
            "node_cpu_seconds": f"{time.process_time():.2f}",
            "node_memory_mb": f"{memory_of_process() / 1e6:.1f}",
            "callbacks": str(self._latencies.count),
            "callback_ms_99": f"{1e3 * self._latencies.percentile(99):.2f}",
            "callback_ms_max": f"{1e3 * self._latencies.longest:.2f}",
            "callback_cpu_ms_max": f"{1e3 * self._latencies.busiest:.2f}",
            "callback_ms_max_of": " ".join(
                f"{name.strip('_<>')}={1e3 * s:.1f}" for name, s in list(self._latencies.longest_of.items())
            ),
            "late_ms_99": f"{1e3 * self._lateness.percentile(99):.2f}",
            "late_ms_max": f"{1e3 * self._lateness.longest:.2f}",
        }
        stale = self._stale()
        items = items_of(state, stale, list(self._heard), figures)
        message = diagnostic_array(items, self._now())
        with self._publishing:
            for sentence in news(self._logged[0], state, self._logged[1], stale):
                self.node.get_logger().info(sentence)
            self._logged = state, stale
            self._status.publish(message)
            self._diagnostics.publish(message)

    def _on_beat(self) -> None:
        now = time.monotonic()
        self._lateness.add(max(0.0, now - self._beat - HEARTBEAT))
        self._beat = now

    # ------------------------------------------------------------------ services
    def _serve(self) -> None:
        services = required("std_srvs.srv", "ros")
        texts = required("diagnostic_msgs.srv", "ros").AddDiagnostics
        # Of their own group: while one waits for its answer, the node's other callbacks go on.
        group = required("rclpy.callback_groups", "ros").ReentrantCallbackGroup()
        self._services = [
            self.node.create_service(kind, f"~/{name}", handler, callback_group=group)
            for kind, name, handler in (
                (services.Trigger, "save_map", self._save),
                (services.Trigger, "reset", self._reset),
                (texts, "confirm_pair", self._asking(lambda text: ("confirm", *two_robots(text)))),
                (texts, "forbid_pair", self._asking(lambda text: ("forbid", *two_robots(text)))),
                (texts, "release_pair", self._asking(lambda text: ("release", *two_robots(text)))),
                (texts, "set_known_pose", self._asking(lambda text: ("know", *pose_in_words(text)))),
                (texts, "clear_known_pose", self._asking(lambda text: ("know", _one(text), None))),
                (texts, "forget_robot", self._asking(lambda text: ("forget", _one(text)))),
            )
        ]

    def _asking(self, read: Any) -> Any:
        async def handle(request: Any, response: Any) -> Any:
            try:
                kind, *arguments = read(request.load_namespace)
            except ParameterError as error:
                response.success, response.message = False, str(error)
                return response
            return await self._answered(self.matching.wish(kind, *arguments), response)

        return handle

    async def _save(self, _: Any, response: Any) -> Any:
        path, overwrite = time.strftime(self._values["save_path"]), self._values["save_overwrite"]
        return await self._answered(self.matching.wish("save", path, overwrite), response)

    async def _reset(self, _: Any, response: Any) -> Any:
        return await self._answered(self.matching.wish("reset"), response)

    async def _answered(self, answer: Answer, response: Any) -> Any:
        executor = self.node.executor
        future = required("rclpy.task", "ros").Future(executor=executor)

        def resume(done: Answer) -> None:
            future.set_result(done.result())
            executor.wake()  # it only looks again at what waits when something wakes it

        answer.add_done_callback(resume)
        response.success, response.message = await future
        return response


def _given_parameters(node: Any) -> dict[str, Any]:
    """Return what was given on the command line and in files, for which rclpy has no public name."""
    return dict(getattr(node, "_parameter_overrides", {}))


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, list | tuple) else value


def _one(text: str) -> str:
    name = text.strip().strip("/")
    if not name or " " in name:
        raise ParameterError(f"the name of one robot is needed, not {text[:80]!r}")
    return name


def run(robots: Sequence[str] = ("auto",), ros_arguments: Sequence[str] = (), name: str = "mapmeld") -> None:
    """Run the node until it is interrupted.

    Raises
    ------
    MissingExtraError
        ROS is neither installed nor there as the extra ``ros``.
    ParameterError, MapmeldError
        A parameter is none that is possible.
    """
    rclpy = required("rclpy", "ros")
    for module in ("nav_msgs.msg", "geometry_msgs.msg", "diagnostic_msgs.msg", "std_srvs.srv"):
        required(module, "ros")
    executors, external = required("rclpy.executors", "ros"), rclpy.exceptions
    if importlib.util.find_spec("tf2_msgs") is None:
        dds.prepare_fastdds()
    try:
        rclpy.init(args=["mapmeld", *ros_arguments])
    except RuntimeError as error:  # rclpy's own, which have no public name
        raise ParameterError(f"ROS does not take its arguments: {str(error).splitlines()[0]}") from error
    try:
        node = rclpy.create_node(name)
        # ROS itself passes over sections of other nodes; that there is none for this one is a slip.
        if "--params-file" in ros_arguments and not _given_parameters(node):
            node.get_logger().warning(
                f"no parameter in the file is for this node, whose section is {node.get_name()}:"
            )
        _spin(node, robots, executors)
    except (external.InvalidParameterTypeException, external.InvalidParameterValueException) as error:
        raise ParameterError(str(error)) from error
    except (executors.ExternalShutdownException, KeyboardInterrupt):
        pass  # SIGTERM, Ctrl-C: how a node ends
    except Exception:
        if rclpy.ok():
            raise  # else it was ended while it was starting
    finally:
        rclpy.try_shutdown()


def _spin(node: Any, robots: Sequence[str], executors: Any) -> None:
    try:
        merging = MergingNode(node, robots)
        try:
            executor = executors.SingleThreadedExecutor()
            executor.add_node(node)
            # A collection of all that the start has left would hold a callback up for up to 0.1 s.
            gc.collect()
            gc.freeze()
            executor.spin()
        finally:
            merging.close()
    finally:
        node.destroy_node()
