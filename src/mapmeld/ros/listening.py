"""Which robots there are, and listening to their maps."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np

from mapmeld.extras import MissingExtraError, required
from mapmeld.io.recordings.messages import BadMessageError, Patch, patch_from_message
from mapmeld.ros import dds

GRID = "nav_msgs/msg/OccupancyGrid"
UPDATE = "map_msgs/msg/OccupancyGridUpdate"


@dataclass(slots=True)
class Heard:
    """A robot that is listened to."""

    name: str
    map_topic: str
    updates_topic: str
    subscription: Any = None
    quality: tuple[bool, bool] | None = None  # of the subscription: reliable, latched
    updates: Any = None
    publishers: int = 0
    counted: float | None = None  # when these were counted [s, steady]
    last: float | None = None  # when its last map came [s, steady]
    second: tuple[float, int] = field(default=(0.0, 0))  # when this second began, and maps since

    @property
    def deserted(self) -> bool:
        """Whether nobody publishes its map; what was counted before its last map came says nothing."""
        if self.counted is None or self.publishers:
            return False
        return self.last is None or self.counted > self.last

    def stale(self, now: float, after: float) -> str | None:
        """Return why its map is stale; None if it is not, or there is none.

        Parameters
        ----------
        now
            [s, steady]
        after
            So long a robot may be silent [s].
        """
        if self.last is None:
            return None
        if self.deserted:
            return "nobody publishes its map any more; the last one is kept"
        if now - self.last > after:
            return f"no map for {now - self.last:.0f} s; the last one is kept"
        return None


def robots_on(topics: Mapping[str, list[str]], map_topic: str, fragment: str, own: str) -> list[str]:
    """Return the namespaces, without slashes around, in which a map is published; none that has no name.

    Parameters
    ----------
    topics
        The types of every topic.
    map_topic
        Name of the maps' topics within a namespace.
    fragment
        What the namespace must hold.
    own
        Topic of the merged map, which is no robot's.
    """
    ending = f"/{map_topic.strip('/')}"
    names = [
        topic.removesuffix(ending).strip("/")
        for topic, types in topics.items()
        if topic.endswith(ending) and GRID in types and topic != own
    ]
    return sorted(name for name in names if name and fragment.strip("/") in name)


def quality_of(publishers: list[Any]) -> tuple[bool, bool]:
    """Return (reliable, latched) as all publishers of a topic can serve it; both where there is none yet.

    A subscription that asks for more than a publisher offers gets nothing of it at all.
    """
    qos = required("rclpy.qos", "ros")
    reliable = all(p.qos_profile.reliability != qos.ReliabilityPolicy.BEST_EFFORT for p in publishers)
    latched = all(p.qos_profile.durability != qos.DurabilityPolicy.VOLATILE for p in publishers)
    return reliable, latched


def profile(reliable: bool, latched: bool, depth: int = 1) -> Any:
    """Return a quality of service profile."""
    qos = required("rclpy.qos", "ros")
    return qos.QoSProfile(
        depth=depth,
        reliability=qos.ReliabilityPolicy.RELIABLE if reliable else qos.ReliabilityPolicy.BEST_EFFORT,
        durability=qos.DurabilityPolicy.TRANSIENT_LOCAL if latched else qos.DurabilityPolicy.VOLATILE,
    )


# ---------------------------------------------------------------------- updates
def system_updates() -> Any:
    """Return the type of updates of the ROS installation; None if it has none."""
    try:
        return required("map_msgs.msg", "ros").OccupancyGridUpdate
    except MissingExtraError:
        return None


class UpdatesByCyclone:
    """Reads updates of maps in a thread, where the ROS at hand does not know their type.

    Parameters
    ----------
    domain_id
        Of the DDS domain.
    on_patch
        Called in the thread with the robot's name and the update, or with what is wrong with it.
    """

    def __init__(self, domain_id: int, on_patch: Callable[[str, Patch | BadMessageError], object]) -> None:
        self._participant = dds.participant(domain_id)
        self._on_patch = on_patch
        self._readers: dict[str, Any] = {}
        self._open = True
        self._thread = threading.Thread(target=self._run, name="updates", daemon=True)
        self._thread.start()

    def listen(self, name: str, topic: str, reliable: bool) -> None:
        """Listen to a robot, too."""
        if name in self._readers:
            return
        from mapmeld.ros.dds_types import OccupancyGridUpdate

        topics, subscribing = required("cyclonedds.topic", "ros"), required("cyclonedds.sub", "ros")
        quality = dds.quality(latched=False, reliable=reliable)
        on = topics.Topic(self._participant, f"rt{topic}", OccupancyGridUpdate, qos=quality)
        self._readers[name] = subscribing.DataReader(self._participant, on, qos=quality)

    def leave(self, name: str) -> None:
        """Listen to a robot no more."""
        self._readers.pop(name, None)

    def close(self) -> None:
        """End the thread."""
        self._open = False
        self._thread.join(timeout=5)

    def _run(self) -> None:
        while self._open:
            for name, reader in list(self._readers.items()):
                for message in reader.take(100):
                    if hasattr(message, "data"):  # else it is the news that a writer has gone
                        self._on_patch(name, _patch_of(message))
            time.sleep(0.05)


def _patch_of(message: Any) -> Patch | BadMessageError:
    fields = SimpleNamespace(
        header=message.header,
        x=message.x,
        y=message.y,
        width=message.width,
        height=message.height,
        data=np.array(message.data, np.int8),
    )
    try:
        return patch_from_message(fields, time.time_ns())
    except BadMessageError as error:
        return error
