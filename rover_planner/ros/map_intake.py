# SPDX-License-Identifier: Apache-2.0
"""Prepares maps in a thread of their own, so that a node goes on meanwhile."""

import contextlib
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from typing import Any

from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from msg_adapters.raw_messages import DamagedMessageError, read_raw
from msg_adapters.stamps import stamp_to_ns
from rover_physics.errors import RoverError
from rover_planner.planning.navigation.transforms import Rigid, TransformError
from rover_planner.ros.frames import Frames
from rover_planner.ros.logs import RepeatLog

CLOUD, GRID_MAP = "elevation_cloud", "elevation_map"
"""Topics of maps: PointCloud2, and GridMap where its package is installed."""


class MapIntake(ABC):
    """Takes serialised messages, and has a map made of the latest of each type.

    `prepare` and `refuse` are called in the thread.
    """

    def __init__(self, logger: RcutilsLogger, frames: Frames):
        """Begin without a map.

        Args:
            logger: Logs refusals, those of one kind once in a while.
            frames: Knows where frames are on the map; asked in the thread.
        """
        self.topic = CLOUD
        """Topic of the map in work."""
        self._logger, self._frames, self._refusals = logger, frames, RepeatLog()
        self._unplaced: tuple[Header, bytes, type] | None = None
        self._last: tuple[bytes, type] | None = None  # that was taken, or refused before any was
        self._is_taken = False
        self._waiting: dict[type, bytes] = {}
        self._pool = ThreadPoolExecutor(1, "maps")
        self.last_job: Future[None] = self.do(lambda: None)
        """Last job given to the thread; it is done after all that were given before."""

    @abstractmethod
    def prepare(self, message: Any, source: Rigid | None) -> None:
        """Make a map of a message.

        Args:
            message: The message.
            source: Where its frame is in that of the map; None if it is that.

        Raises:
            RoverError: The message cannot be used.
        """

    def describe_kept(self) -> str:
        """Return what stays where a map is refused."""
        return "the last map stays"

    def refuse(self, error: str) -> None:
        """Take the reason why a message cannot be used."""
        text = f"{self.topic} refused, {self.describe_kept()}: {error}"
        line = self._refusals.line(text, time.monotonic())
        if line:
            self._logger.error(line)

    def offer(self, message: bytes, kind: type = PointCloud2) -> None:
        """Take a serialised message; one of its type that still waits is replaced."""
        self._waiting[kind] = message
        self.do(partial(self._prepare_latest, kind))

    def repeat(self) -> None:
        """Prepare the last message again, if there is one, such as with other settings."""

        def prepare_last() -> None:
            if self._last is not None:
                self._prepare(*self._last)

        self.do(prepare_last)

    def retry(self) -> None:
        """Prepare a message again if its transform has come meanwhile; call it each second.

        A map that is published once may arrive before the first transform.
        """
        unplaced = self._unplaced
        if unplaced is not None:
            self._frames.listen()  # only then: /tf of a whole robot costs a loop its time
            with contextlib.suppress(TransformError):
                self._find_source(unplaced[0])
                self._unplaced = None
                self.do(partial(self._prepare, *unplaced[1:]))

    def forget(self) -> None:
        """Forget the last message, because another map replaces it; call it in the thread."""
        self._last = self._unplaced = None
        self._is_taken = False

    def do(self, job: Callable[[], Any]) -> Future[None]:
        """Call a function in the thread after all that was given before."""
        self.last_job = self._pool.submit(self._run, job)
        return self.last_job

    def close(self) -> None:
        """End the thread after the map in work is prepared."""
        self._pool.shutdown(cancel_futures=True)

    def _run(self, job: Callable[[], Any]) -> None:
        try:
            job()
        except Exception as error:
            self.refuse(f"internal error: {type(error).__name__}: {error}")

    def _prepare_latest(self, kind: type) -> None:
        message = self._waiting.pop(kind, None)
        if message is not None:  # else it was the latest in an earlier turn
            self._prepare(message, kind)

    def _prepare(self, message: bytes, kind: type) -> None:
        self.topic = CLOUD if kind is PointCloud2 else GRID_MAP
        self._unplaced = None
        try:
            read = read_message(message, kind)
            try:
                source = self._find_source(read.header)
            except TransformError:
                self._unplaced = read.header, message, kind
                raise
            self.prepare(read, source)
            self._last, self._is_taken = (message, kind), True
        except RoverError as error:
            if not self._is_taken:
                self._last = message, kind
            self.refuse(str(error))

    def _find_source(self, header: Header) -> Rigid | None:
        stamp = stamp_to_ns(header.stamp)
        return self._frames.find_source(header.frame_id, stamp, self.topic)


def are_gridded_alike(before: Any, now: Any) -> bool:
    """Return whether two tables of parameters agree in those by which clouds are gridded."""
    return before.map_resolution == now.map_resolution and before.cell_height == now.cell_height


def read_message(message: bytes, kind: type) -> Any:
    """Return the message of a type from its serialised bytes.

    Raises:
        MessageError: The bytes are no such message.
    """
    if kind is PointCloud2:
        return read_raw(message, kind)
    try:
        return deserialize_message(message, kind)
    except Exception as error:  # RMWError, of a module that differs between distributions
        raise DamagedMessageError(message, kind, error) from None
