# SPDX-License-Identifier: Apache-2.0
"""Writes messages to a rosbag2 with MCAP storage, which Foxglove and ros2 bag read."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

from rclpy.serialization import serialize_message
from rosbags.rosbag2 import StoragePlugin, Writer, WriterError
from rosbags.typesys import Stores, get_typestore

from rover_physics.files.validation import show_file
from rover_planner.errors import PlanningError

VERSION: Literal[9] = 9
"""Version of the bag's metadata: that of Jazzy."""


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
            package = type(message).__module__.partition(".")[0]
            name = f"{package}/msg/{type(message).__name__}"
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
