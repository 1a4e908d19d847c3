"""A robot whose link loses packets: publishes maps by cyclonedds, which throws packets away as it is told.

Arguments: domain, topic, packets lost of 1000, "reliable" or "best-effort"; each line of stdin names an .npz
file of a map to publish. Runs as a program of its own.
"""

import json
import os
import sys
import time
from dataclasses import dataclass

import numpy as np
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float32, float64, int8, sequence, uint32

from mapmeld.ros.dds_types import Header, Quaternion, Time


@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Point
    orientation: Quaternion


@dataclass
class MapMetaData(IdlStruct, typename="nav_msgs::msg::dds_::MapMetaData_"):
    map_load_time: Time
    resolution: float32
    width: uint32
    height: uint32
    origin: Pose


@dataclass
class OccupancyGrid(IdlStruct, typename="nav_msgs::msg::dds_::OccupancyGrid_"):
    header: Header
    info: MapMetaData
    data: sequence[int8]


def message_of(path: str) -> OccupancyGrid:
    stored = np.load(path)
    rows, cols = map(int, stored["cells"].shape)
    x, y, theta = map(float, stored["origin"])
    turn = Quaternion(0.0, 0.0, float(np.sin(theta / 2)), float(np.cos(theta / 2)))
    info = MapMetaData(Time(0, 0), float(stored["resolution"]), cols, rows, Pose(Point(x, y, 0.0), turn))
    header = Header(Time(int(time.time()), 0), str(stored["frame_id"]))
    return OccupancyGrid(header, info, stored["cells"].ravel().tolist())


def main() -> None:
    domain, topic, lost, reliable = sys.argv[1:]
    from mapmeld.ros import dds

    # The settings that the node itself has on the loopback, and packets that are thrown away.
    os.environ["CYCLONEDDS_URI"] = (
        f'<CycloneDDS><Domain Id="any">{dds.LOOPBACK}'
        f"<Internal><Test><XmitLossiness>{lost}</XmitLossiness></Test></Internal></Domain></CycloneDDS>"
    )
    from cyclonedds.pub import DataWriter
    from cyclonedds.topic import Topic

    participant = dds.participant(int(domain))
    quality = dds.quality(latched=False, reliable=reliable == "reliable")
    writer = DataWriter(
        participant, Topic(participant, f"rt{topic}", OccupancyGrid, qos=quality), qos=quality
    )
    for line in sys.stdin:
        writer.write(message_of(json.loads(line)["map"]))


if __name__ == "__main__":
    main()
