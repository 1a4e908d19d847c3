"""Recordings for tests, written by the libraries themselves in every format that is read."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mcap.writer
import numpy as np
from numpy.typing import ArrayLike
from rosbags import rosbag1, rosbag2
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from mapmeld.grid import OccupancyGrid

GRID = "nav_msgs/msg/OccupancyGrid"
UPDATE = "map_msgs/msg/OccupancyGridUpdate"
TEXT = "std_msgs/msg/String"
START = 1_700_000_000

_DEFINITION = "std_msgs/Header header\nint32 x\nint32 y\nuint32 width\nuint32 height\nint8[] data\n"
STORES = {1: get_typestore(Stores.ROS1_NOETIC), 2: get_typestore(Stores.ROS2_HUMBLE)}
for _store in STORES.values():
    _store.register(get_types_from_msg(_DEFINITION, UPDATE))


@dataclass(frozen=True)
class Sent:
    """A message: when it is received [s after `START`], on which topic, and what it says."""

    after: float
    topic: str
    type: str
    fields: dict[str, Any] = field(repr=False)

    @property
    def received(self) -> int:
        return START * 10**9 + round(self.after * 1e9)


def sent_map(
    after: float,
    cells: ArrayLike,
    topic: str = "/map",
    *,
    resolution: float = 0.05,
    x: float = 0.0,
    y: float = 0.0,
    turn: float | tuple[float, float, float, float] = 0.0,
    stamp: float | None = None,
    frame: str = "map",
    size: tuple[int, int] | None = None,
) -> Sent:
    """A whole map; `turn` is a yaw [rad] or a quaternion, `stamp` as `after`, `size` (rows, cols) may lie."""
    values = np.asarray(cells, np.int8)
    rows, cols = size or values.shape
    quaternion = (0.0, 0.0, math.sin(turn / 2), math.cos(turn / 2)) if isinstance(turn, float) else turn
    return Sent(
        after,
        topic,
        GRID,
        {
            "stamp": after - 0.02 if stamp is None else stamp,
            "frame": frame,
            "resolution": resolution,
            "size": (rows, cols),
            "x": x,
            "y": y,
            "quaternion": quaternion,
            "values": values.reshape(-1),
        },
    )


def sent_update(
    after: float, row: int, col: int, cells: ArrayLike, topic: str = "/map_updates", frame: str = "map"
) -> Sent:
    """New values for a part of a map."""
    values = np.asarray(cells, np.int8)
    fields = {"stamp": after - 0.01, "frame": frame, "row": row, "col": col, "size": values.shape}
    return Sent(after, topic, UPDATE, fields | {"values": values.reshape(-1)})


def sent_text(after: float, text: str, topic: str = "/chatter") -> Sent:
    return Sent(after, topic, TEXT, {"text": text})


def encoded(sent: Sent, ros: int) -> bytes:
    store = STORES[ros]
    kinds: dict[str, Any] = store.types
    if sent.type == TEXT:
        message = kinds[TEXT](data=sent.fields["text"])
    else:
        stamp, f = sent.fields["stamp"], sent.fields
        nanoseconds = START * 10**9 + round(stamp * 1e9) if math.isfinite(stamp) else 0  # -inf: not set
        time = kinds["builtin_interfaces/msg/Time"](sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
        seq = {"seq": 0} if ros == 1 else {}
        header = kinds["std_msgs/msg/Header"](**seq, stamp=time, frame_id=f["frame"])
        rows, cols = f["size"]
        if sent.type == UPDATE:
            message = kinds[UPDATE](
                header=header, x=f["col"], y=f["row"], width=cols, height=rows, data=f["values"]
            )
        else:
            turn = dict(zip("xyzw", f["quaternion"], strict=True))
            pose = kinds["geometry_msgs/msg/Pose"](
                position=kinds["geometry_msgs/msg/Point"](x=f["x"], y=f["y"], z=0.0),
                orientation=kinds["geometry_msgs/msg/Quaternion"](**turn),
            )
            info = kinds["nav_msgs/msg/MapMetaData"](
                map_load_time=time, resolution=f["resolution"], width=cols, height=rows, origin=pose
            )
            message = kinds[GRID](header=header, info=info, data=f["values"])
    serialize = store.serialize_ros1 if ros == 1 else store.serialize_cdr
    return bytes(serialize(message, sent.type))


# ---------------------------------------------------------------------- the formats
def write_rosbag1(folder: Path, sent: Sequence[Sent], compression: str | None = None) -> Path:
    path = folder / "run.bag"
    writer = rosbag1.Writer(path)
    if compression:
        writer.set_compression(rosbag1.Writer.CompressionFormat[compression])
    with writer:
        connections = {s.topic: s.type for s in sent}
        made = {
            topic: writer.add_connection(topic, kind, typestore=STORES[1])
            for topic, kind in connections.items()
        }
        for s in sent:
            writer.write(made[s.topic], s.received, encoded(s, 1))
    return path


def write_rosbag2(
    folder: Path,
    sent: Sequence[Sent],
    storage: StoragePlugin,
    compression: CompressionMode = CompressionMode.NONE,
) -> Path:
    path = folder / "run"
    writer = rosbag2.Writer(path, version=9, storage_plugin=storage)
    writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        types = {s.topic: s.type for s in sent}
        made = {t: writer.add_connection(t, kind, typestore=STORES[2]) for t, kind in types.items()}
        for s in sent:
            writer.write(made[s.topic], s.received, encoded(s, 2))
    return path


def mcap_bytes(
    sent: Sequence[Sent],
    ros: int = 2,
    profile: str | None = None,
    encoding: str | None = None,
    chunk_size: int = 1 << 20,
    finished: bool = True,
    **options: Any,
) -> bytes:
    """An MCAP file; `finished` False leaves it as a recorder does that loses power."""
    out = io.BytesIO()
    writer = mcap.writer.Writer(out, chunk_size=chunk_size, **options)
    writer.start(profile=f"ros{ros}" if profile is None else profile, library="")
    channels: dict[str, int] = {}
    for s in sent:
        if s.topic not in channels:
            name = s.type.replace("/msg/", "/") if ros == 1 else s.type
            definition, _ = STORES[ros].generate_msgdef(s.type, ros_version=ros)
            schema = writer.register_schema(name, f"ros{ros}msg", definition.encode())
            kind = encoding or ("ros1" if ros == 1 else "cdr")
            channels[s.topic] = writer.register_channel(s.topic, kind, schema)
        writer.add_message(channels[s.topic], s.received, encoded(s, ros), s.received)
    if finished:
        writer.finish()  # type: ignore[no-untyped-call]
    return out.getvalue()


def write_mcap(folder: Path, sent: Sequence[Sent], **options: Any) -> Path:
    path = folder / "run.mcap"
    path.write_bytes(mcap_bytes(sent, **options))
    return path


def _db3(folder: Path, sent: Sequence[Sent]) -> Path:
    return write_rosbag2(folder, sent, StoragePlugin.SQLITE3) / "run.db3"


def _mcap_of_rosbag2(folder: Path, sent: Sequence[Sent]) -> Path:
    return write_rosbag2(folder, sent, StoragePlugin.MCAP) / "run.mcap"


_SQLITE, _MCAP, _Mode = StoragePlugin.SQLITE3, StoragePlugin.MCAP, CompressionMode
_Kind = mcap.writer.CompressionType
Writer = Callable[[Path, Sequence[Sent]], Path]

FORMATS: dict[str, Writer] = {
    "rosbag1": write_rosbag1,
    "rosbag1-bz2": lambda f, s: write_rosbag1(f, s, "BZ2"),
    "rosbag1-lz4": lambda f, s: write_rosbag1(f, s, "LZ4"),
    "rosbag2-sqlite3": lambda f, s: write_rosbag2(f, s, _SQLITE),
    "rosbag2-sqlite3-file": lambda f, s: write_rosbag2(f, s, _SQLITE, _Mode.FILE),
    "rosbag2-sqlite3-message": lambda f, s: write_rosbag2(f, s, _SQLITE, _Mode.MESSAGE),
    "rosbag2-mcap": lambda f, s: write_rosbag2(f, s, _MCAP),
    "rosbag2-mcap-file": lambda f, s: write_rosbag2(f, s, _MCAP, _Mode.FILE),
    "rosbag2-mcap-message": lambda f, s: write_rosbag2(f, s, _MCAP, _Mode.MESSAGE),
    "rosbag2-mcap-storage": lambda f, s: write_rosbag2(f, s, _MCAP, _Mode.STORAGE),
    "db3": _db3,
    "mcap-of-rosbag2": _mcap_of_rosbag2,
    "mcap-zstd": lambda f, s: write_mcap(f, s, compression=_Kind.ZSTD),
    "mcap-lz4": lambda f, s: write_mcap(f, s, compression=_Kind.LZ4),
    "mcap-plain": lambda f, s: write_mcap(f, s, compression=_Kind.NONE),
    "mcap-small-chunks": lambda f, s: write_mcap(f, s, chunk_size=200),
    "mcap-no-chunks": lambda f, s: write_mcap(f, s, use_chunking=False),
    "mcap-no-index": lambda f, s: write_mcap(f, s, index_types=mcap.writer.IndexType.NONE),
    "mcap-no-summary": lambda f, s: write_mcap(
        f, s, index_types=mcap.writer.IndexType.NONE, repeat_channels=False, repeat_schemas=False,
        use_statistics=False, use_summary_offsets=False,
    ),
    "mcap-ros1": lambda f, s: write_mcap(f, s, ros=1),
    "mcap-no-profile": lambda f, s: write_mcap(f, s, profile=""),
}  # fmt: skip


def story() -> list[Sent]:
    """Two robots' growing maps, updates of one of them, and messages of no interest in between."""
    small = [[-1, 0, 100], [0, 0, -1]]
    large = [[-1, 0, 100, 30], [0, 0, -1, 64], [100, 100, 100, 0]]
    return [
        sent_text(0.0, "hello"),
        sent_map(0.5, np.zeros((0, 0)), "/robot_1/map", frame="r1", resolution=0.0),
        sent_map(1.0, small, "/robot_1/map", frame="r1", x=-1.0, y=2.5, turn=0.5),
        sent_text(1.5, "still here"),
        sent_map(2.0, [[0]], "/robot_2/map", frame="r2", resolution=0.1),
        sent_update(3.0, 0, 1, [[50, 60]], "/robot_1/map_updates", frame="r1"),
        sent_map(4.0, large, "/robot_1/map", frame="r1", x=-1.5, y=2.5, turn=-3.0),
        sent_map(5.0, [[0, 100]], "/robot_2/map", frame="r2", resolution=0.1),
        sent_update(6.0, 1, 0, [[1], [2]], "/robot_1/map_updates", frame="r1"),
    ]


def same_states(found: Sequence[OccupancyGrid], expected: Sequence[OccupancyGrid]) -> bool:
    """Whether states are the same with their stamps; origins but for the rounding of quaternions."""
    return len(found) == len(expected) and all(
        np.array_equal(a.cells, b.cells)
        and (a.resolution, a.frame_id, a.stamp) == (b.resolution, b.frame_id, b.stamp)
        and np.allclose(
            (a.origin.x, a.origin.y, a.origin.theta), (b.origin.x, b.origin.y, b.origin.theta), atol=1e-12
        )
        for a, b in zip(found, expected, strict=True)
    )
