"""The node, robots and a listener as processes of their own, on a DDS domain of their own on the loopback."""

import fcntl
import itertools
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from mapmeld.grid import OccupancyGrid
from mapmeld.se2 import Pose2

PATIENCE = 60.0
"""[s] Only reached where something is wrong: what is waited for comes much sooner."""

os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"  # of the listener, too


@contextmanager
def reserved_domain() -> Iterator[int]:
    """A domain of one's own: no other test has it while the block runs, whatever process it is in.

    A lock that ends with its process tells tests apart; first ports that are taken, somebody else's nodes.
    """
    for number in range(80):
        domain = 10 + (os.getpid() + number) % 80
        with (Path(tempfile.gettempdir()) / f"mapmeld_test_domain_{domain}").open("w") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                for participant in (0, 1):
                    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
                        taken.bind(("", 7400 + 250 * domain + 10 + 2 * participant))
            except OSError:
                continue
            yield domain
            return
    raise AssertionError("no domain is free")


def environment(domain: int) -> dict[str, str]:
    return os.environ | {
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "OMP_NUM_THREADS": "1",
        "PYTHONUNBUFFERED": "1",
    }


class LiveNode:
    """``mapmeld ros`` as a process."""

    def __init__(self, domain: int, folder: Path, *arguments: str) -> None:
        self.log = folder / f"node_{time.monotonic_ns()}.log"
        command = [sys.executable, "-m", "mapmeld", "ros", *arguments]
        with self.log.open("w") as log:
            self.process = subprocess.Popen(
                command, env=environment(domain), stdout=log, stderr=log, cwd=folder
            )

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()

    def stop(self) -> int:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            return self.process.wait(timeout=20)
        except subprocess.TimeoutExpired:
            self.kill()
            raise

    def said(self) -> str:
        return self.log.read_text()

    def warnings(self) -> list[str]:
        return [line.partition("]: ")[2] for line in self.said().splitlines() if line.startswith("[WARN]")]


class Robots:
    """A process that publishes maps."""

    def __init__(self, domain: int, folder: Path, name: str = "all", program: Sequence[str] = ()) -> None:
        self._folder = folder
        self._count = itertools.count()
        self.name = name
        player, *arguments = program or ("player.py", str(domain), name)
        self.process = subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name(player)), *arguments],
            env=environment(domain),
            stdin=subprocess.PIPE,
            text=True,
        )

    def tell(self, **task: object) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps(task) + "\n")
        self.process.stdin.flush()

    def file(self, grid: OccupancyGrid, frame_id: str) -> str:
        path = self._folder / f"{self.name}_{next(self._count)}.npz"
        origin = (grid.origin.x, grid.origin.y, grid.origin.theta)
        np.savez(path, cells=grid.cells, resolution=grid.resolution, origin=origin, frame_id=frame_id)
        return str(path)

    def publish(self, robot: str, grid: OccupancyGrid, frame_id: str | None = None, **more: object) -> None:
        frame = f"{robot}/map" if frame_id is None else frame_id
        self.tell(topic=f"/{robot}/map", map=self.file(grid, frame), **more)

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()
        if self.process.stdin is not None:
            self.process.stdin.close()

    def wait(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait(timeout=PATIENCE)


class Listener:
    """Hears all that the node publishes: by rclpy, and /tf_static by a reader of cyclonedds."""

    def __init__(self, domain: int) -> None:
        import rclpy
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic
        from diagnostic_msgs.msg import DiagnosticArray
        from geometry_msgs.msg import PoseArray
        from nav_msgs.msg import OccupancyGrid as Message
        from rclpy.executors import SingleThreadedExecutor

        from mapmeld.ros import dds
        from mapmeld.ros.dds_types import TFMessage
        from mapmeld.ros.listening import profile

        self.merged: list[OccupancyGrid] = []
        self.statuses: list[dict[str, dict[str, str]]] = []
        self.levels: dict[str, int] = {}
        self.stamp = 0  # of the newest status [s]
        self.start_poses: list[Any] = []
        dds.prepare_fastdds()
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = rclpy.create_node(f"listener_{time.monotonic_ns()}", context=self._context)
        latched = profile(reliable=True, latched=True)
        self.node.create_subscription(Message, "/merged_map", self._on_map, latched)
        self.node.create_subscription(DiagnosticArray, "/mapmeld/status", self._on_status, latched)
        self.node.create_subscription(PoseArray, "/mapmeld/start_poses", self.start_poses.append, latched)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        quality = dds.quality(latched=True)
        self._participant = dds.participant(domain)
        topic = Topic(self._participant, "rt/tf_static", TFMessage, qos=quality)
        self._reader = DataReader(self._participant, topic, qos=quality)
        self.transforms: list[dict[str, tuple[str, Pose2]]] = []
        self._open = True
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _spin(self) -> None:
        while self._open:
            self._executor.spin_once(timeout_sec=0.05)
            for message in self._reader.take(10):
                if hasattr(message, "transforms"):
                    self.transforms.append(
                        {t.child_frame_id: _parent_and_pose(t) for t in message.transforms}
                    )

    def _on_map(self, message: Any) -> None:
        from mapmeld.io.recordings.messages import grid_from_message

        grid = grid_from_message(message, 0)
        assert grid is not None
        self.merged.append(grid)

    def _on_status(self, message: Any) -> None:
        self.stamp = message.header.stamp.sec
        self.statuses.append({s.name: {v.key: v.value for v in s.values} for s in message.status})
        self.levels = {s.name: s.level[0] for s in message.status}

    def robot(self, name: str) -> dict[str, str]:
        return self.statuses[-1].get(f"mapmeld robot: {name}", {}) if self.statuses else {}

    def pair(self, a: str, b: str) -> dict[str, str]:
        return self.statuses[-1].get(f"mapmeld pair: {a} {b}", {}) if self.statuses else {}

    @property
    def figures(self) -> dict[str, str]:
        return self.statuses[-1]["mapmeld"] if self.statuses else {}

    def joined(self) -> set[str]:
        return set(self.figures.get("joined", "").split())

    def ask(self, kind: Any, name: str, **fields: object) -> Any:
        client = self.node.create_client(kind, f"/mapmeld/{name}")
        assert client.wait_for_service(timeout_sec=PATIENCE)
        future = client.call_async(kind.Request(**fields))
        until(future.done, f"an answer of {name}")
        return future.result()

    def close(self) -> None:
        self._open = False
        self._thread.join()
        self._reader = None
        self.node.destroy_node()
        self._executor.shutdown()
        self._context.try_shutdown()


def _parent_and_pose(stamped: Any) -> tuple[str, Pose2]:
    T, turn = stamped.transform.translation, stamped.transform.rotation
    return stamped.header.frame_id, Pose2(T.x, T.y, float(2 * np.arctan2(turn.z, turn.w)))


def until(happens: Callable[[], object], what: str, patience: float = PATIENCE) -> None:
    ends = time.monotonic() + patience
    while not happens():
        assert time.monotonic() < ends, f"still waiting for {what} after {patience} s"
        time.sleep(0.05)


class LiveSystem:
    """A node, robots and a listener."""

    def __init__(self, domain: int, folder: Path, *arguments: str) -> None:
        self.domain, self.folder, self.arguments = domain, folder, arguments
        self._groups: list[Robots] = []
        self._listeners: list[Listener] = []
        self.node = LiveNode(self.domain, folder, *arguments)
        try:
            self.listener = self.another_listener()
        except BaseException:
            self.node.kill()
            raise

    def robots(self, name: str = "all") -> Robots:
        self._groups.append(Robots(self.domain, self.folder, name))
        return self._groups[-1]

    def lossy_robot(self, name: str, lost_of_1000: int, *, reliable: bool) -> Robots:
        quality = "reliable" if reliable else "best-effort"
        program = ("lossy_player.py", str(self.domain), f"/{name}/map", str(lost_of_1000), quality)
        self._groups.append(Robots(self.domain, self.folder, name, program))
        return self._groups[-1]

    def another_listener(self) -> Listener:
        self._listeners.append(Listener(self.domain))
        return self._listeners[-1]

    def restart_node(self) -> None:
        self.node = LiveNode(self.domain, self.folder, *self.arguments)

    def close(self) -> None:
        for robots in self._groups:
            robots.kill()
        for listener in self._listeners:
            listener.close()
        assert self.node.stop() == 0, self.node.said()


@contextmanager
def live_system(*arguments: str) -> Iterator[LiveSystem]:
    with tempfile.TemporaryDirectory() as folder, reserved_domain() as domain:
        system = LiveSystem(domain, Path(folder), *arguments)
        try:
            yield system
        except BaseException:
            print(system.node.said(), file=sys.stderr)
            print(system.listener.statuses[-1:], file=sys.stderr)
            raise
        finally:
            system.close()
