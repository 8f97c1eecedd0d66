# SPDX-License-Identifier: Apache-2.0
"""Reads what a traverse server needs from a rosbag2, in SQLite or MCAP; writes one in MCAP.

Foxglove and ros2 bag read what is written.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.rosbag2 import Reader, ReaderError, StoragePlugin, Writer, WriterError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from msg_adapters.errors import MessageError
from msg_adapters.stamps import NANOSECONDS
from rover_physics.files.validation import show_file
from rover_physics.numerics.arrays import Floats
from rover_planner.errors import PlanningError
from rover_planner.learning.drive_log import WIDTH, check_rows
from rover_planner.ros.row_collector import RowCollector
from rover_planner.shell.extras import find_type, name_type

MAP, JOINTS, ODOMETRY, IMU, PATH = "map", "joints", "odometry", "imu", "path"
TF, TF_STATIC = "tf", "tf_static"
"""Inputs of a replay; the last two have the topics of the same names."""
GRID_MAP = "grid_map_msgs/msg/GridMap"
INPUTS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    MAP: (("sensor_msgs/msg/PointCloud2", GRID_MAP), ("elevation_cloud", "elevation_map")),
    JOINTS: (("sensor_msgs/msg/JointState",), ("joint_states",)),
    ODOMETRY: (("nav_msgs/msg/Odometry",), ("odometry",)),
    IMU: (("sensor_msgs/msg/Imu",), ("imu",)),
    TF: (("tf2_msgs/msg/TFMessage",), ()),
    TF_STATIC: (("tf2_msgs/msg/TFMessage",), ()),
    PATH: (("nav_msgs/msg/Path",), ("traverse_server/path",)),
}
"""Types of each input, as bags name them, and usual ends of its topics."""
GRID_MAP_INFO_FIELDS = """
float64 resolution
float64 length_x
float64 length_y
geometry_msgs/Pose pose
"""
GRID_MAP_FIELDS = """
std_msgs/Header header
grid_map_msgs/GridMapInfo info
string[] layers
string[] basic_layers
std_msgs/Float32MultiArray[] data
uint16 outer_start_index
uint16 inner_start_index
"""
"""Fields of a GridMap, which is read without its package."""
VERSION: Literal[9] = 9
"""Version of the bag's metadata: that of Jazzy."""


@dataclass(frozen=True)
class Recorded:
    """A recorded message."""

    kind: str
    """One of INPUTS."""
    topic: str
    """Its topic."""
    stamp: int
    """Time of its recording [ns]."""
    message: Any
    """The ROS message."""


class BagReader:
    """The inputs of a replay in an open bag."""

    def __init__(self, reader: Reader, topics: Mapping[str, str]):
        self._reader, self.topics = reader, topics
        """Topics by input; without inputs that the bag does not have."""
        self._kinds = {topic: kind for kind, topic in topics.items()}
        self._store = get_typestore(Stores.ROS2_JAZZY)
        for name, fields in (("GridMapInfo", GRID_MAP_INFO_FIELDS), ("GridMap", GRID_MAP_FIELDS)):
            self._store.register(get_types_from_msg(fields, f"grid_map_msgs/msg/{name}"))

    @property
    def count(self) -> int:
        """Number of messages."""
        return sum(c.msgcount for c in self._connections())

    def messages(self) -> Iterator[Recorded]:
        """Yield the messages in the order of their recording.

        Raises:
            PlanningError: The bag is damaged.
        """
        try:
            for connection, stamp, raw in self._reader.messages(self._connections()):
                topic = connection.topic
                message = self._deserialize(bytes(raw), connection.msgtype)
                yield Recorded(self._kinds[topic], topic, stamp, message)
        except Exception as error:  # each storage has errors of its own
            raise PlanningError(f"{show_file(self._reader.path)}: is damaged: {error}") from None

    def _connections(self) -> list[Any]:
        return [
            one
            for one in self._reader.connections
            if one.topic in self._kinds and one.msgtype in INPUTS[self._kinds[one.topic]][0]
        ]

    def _deserialize(self, raw: bytes, name: str) -> Any:
        kind = find_type(name.replace("/msg/", ".msg:"))
        if kind is not None:
            return deserialize_message(raw, kind)
        return self._store.deserialize_cdr(raw, name)


@contextmanager
def open_bag(path: Path, wanted: Mapping[str, str]) -> Iterator[BagReader]:
    """Open a bag: a folder with metadata.yaml, or a single .mcap or .db3 file.

    Args:
        path: The bag.
        wanted: Topics by input, empty to choose: the one that ends as usual, or the only one of
            its type; for IMU and PATH only the former. TF and TF_STATIC are always /tf and
            /tf_static.

    Raises:
        PlanningError: It cannot be read, a wanted topic is missing, or several topics are as good.
    """
    try:
        reader = Reader(path)
        reader.open()
    except (ReaderError, OSError, ValueError, KeyError) as error:
        raise PlanningError(f"{show_file(path)}: is no bag that can be read: {error}") from None
    try:
        topics = {kind: _choose(reader, kind, wanted.get(kind, "")) for kind in INPUTS}
        yield BagReader(reader, {kind: topic for kind, topic in topics.items() if topic})
    finally:
        reader.close()


def _choose(reader: Reader, kind: str, wanted: str) -> str:
    """Return the topic of an input, empty if the bag has none."""
    names, ends = INPUTS[kind]
    name = " or ".join(names)
    topics = sorted({c.topic for c in reader.connections if c.msgtype in names and c.msgcount})
    if wanted:
        if f"/{wanted.lstrip('/')}" not in topics:
            raise PlanningError(
                f"no topic {wanted} of type {name} in the bag; it has "
                f"{', '.join(topics) or 'none'}"
            )
        return f"/{wanted.lstrip('/')}"
    if kind in (TF, TF_STATIC):
        return f"/{kind}" if f"/{kind}" in topics else ""
    usual = [topic for topic in topics if topic.endswith(tuple(f"/{end}" for end in ends))]
    candidates = usual if usual or kind in (IMU, PATH) else topics
    if len(candidates) > 1:
        raise PlanningError(
            f"the bag has {len(candidates)} topics of type {name}: {', '.join(candidates)}; "
            f"choose one by --{kind}-topic"
        )
    return candidates[0] if candidates else ""


class BagWriter:
    """An open bag."""

    def __init__(self, writer: Writer):
        self._writer = writer
        self._types = get_typestore(Stores.ROS2_JAZZY)
        self._connections: dict[str, Any] = {}

    def write(self, topic: str, message: Any, stamp: int) -> None:
        """Write a message.

        Args:
            topic: Its topic.
            message: A ROS message; each topic has one type.
            stamp: Time of its recording [ns].
        """
        if topic not in self._connections:
            name = name_type(type(message))
            self._connections[topic] = self._writer.add_connection(
                topic, name, typestore=self._types
            )
        self._writer.write(self._connections[topic], stamp, serialize_message(message))


@contextmanager
def write_bag(folder: Path) -> Iterator[BagWriter]:
    """Create a bag.

    Args:
        folder: Folder of the bag; must not exist.

    Raises:
        PlanningError: It exists already or cannot be written.
    """
    try:
        with Writer(folder, version=VERSION, storage_plugin=StoragePlugin.MCAP) as writer:
            yield BagWriter(writer)
    except (WriterError, OSError) as error:
        raise PlanningError(f"{show_file(folder)}: cannot be written: {error}") from None


def read_rows(path: Path, odometry_topic: str) -> Floats:
    """Return the rows (n, WIDTH) of a bag; times are those of the recording, from 0.

    Args:
        path: The bag, with joint states and with odometry that does not come from the wheels, in
            the frame of the map.
        odometry_topic: Topic of this odometry; empty to choose.

    Raises:
        PlanningError: It cannot be read, or lacks joint states or odometry.
    """
    collector, rows, begin = RowCollector(), [], -1
    with open_bag(path, {ODOMETRY: odometry_topic}) as bag:
        for kind in (JOINTS, ODOMETRY):
            if kind not in bag.topics:
                raise PlanningError(f"{show_file(path)}: has no {kind}")
        for recorded in bag.messages():
            begin = recorded.stamp if begin < 0 else begin
            time = (recorded.stamp - begin) / NANOSECONDS
            with suppress(MessageError):
                if recorded.kind == JOINTS:
                    collector.take_joints(recorded.message, time)
                elif recorded.kind == IMU:
                    collector.take_imu(recorded.message, time)
                elif recorded.kind == ODOMETRY:
                    rows.append(collector.take_odometry(recorded.message, time, time))
    return check_rows(np.array(rows).reshape(-1, WIDTH), str(show_file(path)))
