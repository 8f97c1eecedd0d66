"""Reads the messages that a traverse server needs from a rosbag2, in SQLite or MCAP."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nav_msgs.msg import Odometry
from nav_msgs.msg import Path as PathMessage
from rclpy.serialization import deserialize_message
from rosbags.rosbag2 import Reader, ReaderError
from sensor_msgs.msg import JointState, PointCloud2

from rover_physics.files.validation import show_file
from rover_planner.errors import PlanningError

MAP, JOINTS, ODOMETRY, PATH = "map", "joints", "odometry", "path"
"""Inputs of a replay."""
TYPES = {
    MAP: ("sensor_msgs/msg/PointCloud2", PointCloud2),
    JOINTS: ("sensor_msgs/msg/JointState", JointState),
    ODOMETRY: ("nav_msgs/msg/Odometry", Odometry),
    PATH: ("nav_msgs/msg/Path", PathMessage),
}
"""Type of each input: its name in bags, and its class."""
USUAL = {
    MAP: "elevation_cloud",
    JOINTS: "joint_states",
    ODOMETRY: "odometry",
    PATH: "traverse_server/path",
}
"""How the topic of each input usually ends."""


@dataclass(frozen=True)
class Recorded:
    """A recorded message."""

    kind: str
    """One of TYPES."""
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

    @property
    def count(self) -> int:
        """Number of messages."""
        return sum(c.msgcount for c in self._connections())

    def messages(self) -> Iterator[Recorded]:
        """Yield the messages in the order of their recording.

        Raises:
            PlanningError: The bag is damaged.
        """
        stream = self._reader.messages(self._connections())
        while True:
            try:
                connection, stamp, raw = next(stream)
                kind = self._kinds[connection.topic]
                message = deserialize_message(bytes(raw), TYPES[kind][1])
            except StopIteration:
                return
            except Exception as error:  # each storage has errors of its own
                raise PlanningError(
                    f"{show_file(self._reader.path)}: is damaged: {error}"
                ) from None
            yield Recorded(kind, connection.topic, stamp, message)

    def _connections(self) -> list[Any]:
        return [
            connection
            for connection in self._reader.connections
            if connection.msgtype == TYPES.get(self._kinds.get(connection.topic, ""), ("",))[0]
        ]


@contextmanager
def open_bag(path: Path, wanted: Mapping[str, str]) -> Iterator[BagReader]:
    """Open a bag: a folder with metadata.yaml, or a single .mcap or .db3 file.

    Args:
        path: The bag.
        wanted: Topics by input, empty to choose: the one that ends as USUAL, or the only one of
            its type; for PATH only the former.

    Raises:
        PlanningError: It cannot be read, a wanted topic is missing, or several topics are as good.
    """
    try:
        reader = Reader(path)
        reader.open()
    except (ReaderError, OSError, ValueError, KeyError) as error:
        raise PlanningError(f"{show_file(path)}: is no bag that can be read: {error}") from None
    try:
        topics = {kind: _choose(reader, kind, wanted.get(kind, "")) for kind in TYPES}
        yield BagReader(reader, {kind: topic for kind, topic in topics.items() if topic})
    finally:
        reader.close()


def _choose(reader: Reader, kind: str, wanted: str) -> str:
    """Return the topic of an input, empty if the bag has none."""
    name = TYPES[kind][0]
    topics = sorted({c.topic for c in reader.connections if c.msgtype == name and c.msgcount})
    if wanted:
        if f"/{wanted.lstrip('/')}" not in topics:
            raise PlanningError(
                f"no topic {wanted} of type {name} in the bag; it has "
                f"{', '.join(topics) or 'none'}"
            )
        return f"/{wanted.lstrip('/')}"
    usual = [topic for topic in topics if topic.endswith(f"/{USUAL[kind]}")]
    candidates = usual if usual or kind == PATH else topics
    if len(candidates) > 1:
        raise PlanningError(
            f"the bag has {len(candidates)} topics of type {name}: {', '.join(candidates)}; "
            f"choose one by --{kind}-topic"
        )
    return candidates[0] if candidates else ""
