"""Robots for the tests: publishes maps as it is told on stdin, until stdin ends.

Each line is a JSON object: {"topic": ..., "map": FILE.npz} publishes a map; {"sleep": seconds} waits;
{"flood": [topic, FILE.npz, hertz, seconds]} again and again; {"patch": ...} an update (by cyclonedds);
{"clock": [start, seconds, hertz]} simulated time, ten times as fast as real time.
Runs as a program of its own.
"""

import array
import json
import sys
import time
from typing import Any

import numpy as np
import rclpy
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from mapmeld.ros import dds


def message_of(path: str, changes: dict[str, Any]) -> OccupancyGrid:
    stored = np.load(path)
    message = OccupancyGrid()
    message.header.frame_id = str(stored["frame_id"])
    message.info.height, message.info.width = map(int, stored["cells"].shape)
    message.info.resolution = float(stored["resolution"])
    x, y, theta = map(float, stored["origin"])
    message.info.origin.position.x, message.info.origin.position.y = x, y
    message.info.origin.orientation.z = float(np.sin(theta / 2))
    message.info.origin.orientation.w = float(np.cos(theta / 2))
    message.data = array.array("b", stored["cells"].tobytes())
    for name in ("width", "height"):
        if name in changes:
            setattr(message.info, name, changes[name])
    if "resolution" in changes:
        message.info.resolution = float(changes["resolution"])
    if "data" in changes:
        message.data = array.array("b", bytes(changes["data"]))
    return message


def main() -> None:
    domain = int(sys.argv[1])
    dds.prepare_fastdds()
    rclpy.init(domain_id=domain)
    node = rclpy.create_node(f"player_{sys.argv[2]}")
    publishers: dict[str, Any] = {}
    writers: dict[str, Any] = {}

    def publisher(topic: str, volatile: bool = False) -> Any:
        if topic not in publishers:
            durability = DurabilityPolicy.VOLATILE if volatile else DurabilityPolicy.TRANSIENT_LOCAL
            reliability = ReliabilityPolicy.BEST_EFFORT if volatile else ReliabilityPolicy.RELIABLE
            profile = QoSProfile(depth=1, durability=durability, reliability=reliability)
            publishers[topic] = node.create_publisher(OccupancyGrid, topic, profile)
        return publishers[topic]

    for line in sys.stdin:
        task = json.loads(line)
        if "sleep" in task:
            time.sleep(task["sleep"])
        elif "flood" in task:
            topic, path, hertz, seconds = task["flood"]
            message = message_of(path, {})
            for _ in range(int(hertz * seconds)):
                publisher(topic).publish(message)
                time.sleep(1 / hertz)
        elif "clock" in task:
            start, lasts, hertz = task["clock"]
            for step in range(int(lasts * hertz)):
                clock = Clock()
                seconds, rest = divmod(start + 10 * step / hertz, 1)
                clock.clock.sec, clock.clock.nanosec = int(seconds), int(rest * 1e9)
                if "/clock" not in publishers:
                    publishers["/clock"] = node.create_publisher(Clock, "/clock", 1)
                publishers["/clock"].publish(clock)
                time.sleep(1 / hertz)
        elif "patch" in task:
            write_patch(domain, writers, task)
        else:
            message = message_of(task["map"], task.get("changes", {}))
            message.header.stamp = node.get_clock().now().to_msg()
            publisher(task["topic"], task.get("volatile", False)).publish(message)
    node.destroy_node()
    rclpy.shutdown()


def write_patch(domain: int, writers: dict[str, Any], task: dict[str, Any]) -> None:
    from cyclonedds.pub import DataWriter
    from cyclonedds.topic import Topic

    from mapmeld.ros import dds_types

    topic = task["patch"]
    if topic not in writers:
        participant, quality = dds.participant(domain), dds.quality(latched=False)
        on = Topic(participant, f"rt{topic}", dds_types.OccupancyGridUpdate, qos=quality)
        writers[topic] = DataWriter(participant, on, qos=quality)
        time.sleep(3)  # until it is found: updates are not latched
    header = dds_types.Header(dds_types.Time(int(time.time()), 0), "")
    x, y, cells = task["x"], task["y"], task["cells"]
    data = [value for row in cells for value in row]
    writers[topic].write(dds_types.OccupancyGridUpdate(header, x, y, len(cells[0]), len(cells), data))
    time.sleep(0.2)


if __name__ == "__main__":
    main()
