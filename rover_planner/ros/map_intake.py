# SPDX-License-Identifier: Apache-2.0
"""Prepares maps in a thread of their own, so that a node goes on meanwhile."""

import contextlib
import math
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from msg_adapters.elevation import is_same_cloud
from msg_adapters.raw_messages import DamagedMessageError, SensorReader
from msg_adapters.stamps import stamp_to_ns
from rover_physics.errors import RoverError
from rover_planner.planning.navigation.transforms import Rigid, TransformError
from rover_planner.ros.frames import Frames
from rover_planner.ros.logs import RepeatLog

WAIT = 0.02
"""Time between two checks of who waits for a map [s]."""
END_TIME = 2.0
"""Longest wait for the map in work when the intake is closed [s]."""

CLOUD, GRID_MAP = "elevation_cloud", "elevation_map"
"""Topics of maps: PointCloud2, and GridMap where its package is installed."""

CELL_PARAMETERS = ("map_resolution", "cell_height")
"""Parameters by which clouds are gridded."""


class MapIntake(ABC):
    """Takes serialised messages, and has a map made of the latest of each type.

    `prepare`, `renew` and `refuse` are called in the thread.
    """

    def __init__(self, logger: RcutilsLogger, values: Any, frames: Frames):
        """Start the thread.

        Args:
            logger: Logs refusals, those of one kind once in a while.
            values: A table with the CELL_PARAMETERS.
            frames: Knows where frames are on the map; asked in the thread.
        """
        self.values = values
        """The parameters in force."""
        self.topic = CLOUD
        """Topic of the map in work."""
        self._logger, self._frames, self._refusals = logger, frames, RepeatLog()
        self._unplaced: tuple[str, int | None] | None = None
        self._changed = threading.Condition()
        self._last: tuple[bytes, type] | None = None
        self._used: Any = None
        self._newest: dict[type, int] = {}
        self._jobs: deque[Callable[[], Any]] = deque()
        self._given, self._done = 0, 0
        self._ending = False
        self._thread = threading.Thread(target=self._run, name="maps", daemon=True)
        self._thread.start()

    @abstractmethod
    def prepare(self, message: Any, source: Rigid | None) -> None:
        """Make a map of a message.

        Args:
            message: The message.
            source: Where its frame is in that of the map; None if it is that.

        Raises:
            RoverError: The message cannot be used.
        """

    def renew(self, cloud: Any) -> None:  # noqa: B027, the map that is there may stay as it is
        """Take a cloud in the map frame from which the last one differs in its stamp at most."""

    def describe_kept(self) -> str:
        """Return what stays where a map is refused."""
        return "the last map stays"

    def refuse(self, error: str) -> None:
        """Take the reason why a message cannot be used."""
        text = f"{self.topic} refused, {self.describe_kept()}: {error}"
        line = self._refusals.line(text, time.monotonic())
        if line:
            self._logger.error(line)

    def take_parameters(self, values: Any) -> bool:
        """Take new parameters; return whether clouds are gridded otherwise from now on."""
        before, self.values = self.values, values
        return any(getattr(before, name) != getattr(values, name) for name in CELL_PARAMETERS)

    def offer(self, message: bytes, kind: type = PointCloud2) -> None:
        """Take a serialised message; one of its type that still waits is replaced."""
        self._last = message, kind
        self._do_latest(message, kind)

    def repeat(self) -> None:
        """Prepare the last message again, if there is one, such as with other settings."""
        self.do(self.expect_other)
        last = self._last  # the thread may forget it meanwhile
        if last is not None:
            self._do_latest(*last)

    @property
    def waits_for_frame(self) -> bool:
        """True if no transform was known for the last message."""
        return self._unplaced is not None

    def retry(self) -> None:
        """Prepare the last message again if its transform has come meanwhile; call it each second.

        A map that is published once may arrive before the first transform.
        """
        if self._unplaced is not None:
            with contextlib.suppress(TransformError):
                self._frames.find(*self._unplaced)
                self._unplaced = None
                self.repeat()

    def expect_other(self) -> None:
        """Prepare the next message whatever it says; to be called in the thread."""
        self._used = None

    def forget(self) -> None:
        """Forget the last message, because another map replaces it; call it in the thread."""
        self._last = None
        self.expect_other()

    def do(self, job: Callable[[], Any]) -> None:
        """Call a function in the thread after all that was given before."""
        with self._changed:
            self._given += 1
            self._jobs.append(job)
            self._changed.notify_all()

    def ticket(self) -> int:
        """Return a number for `wait`: all that was given until now."""
        return self._given

    def wait(self, ticket: int, check: Callable[[], object], longest: float = math.inf) -> None:
        """Wait until all that was given before a ticket is done; `check` may raise meanwhile.

        Args:
            ticket: What `ticket` returned.
            check: Called every WAIT.
            longest: Time after which the wait ends whatever is done [s].
        """
        end = time.monotonic() + longest
        with self._changed:
            while self._done < ticket and not self._ending:
                left = end - time.monotonic()
                if left <= 0.0:
                    return
                self._changed.wait(min(WAIT, left))
                check()

    def close(self) -> None:
        """End the thread after the map in work is prepared."""
        with self._changed:
            self._ending = True
            self._changed.notify_all()
        self._thread.join(END_TIME)

    def _do_latest(self, message: bytes, kind: type) -> None:
        self._newest[kind] = self._given + 1
        self.do(partial(self._prepare_map, message, kind, self._newest[kind]))

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._jobs or self._ending)
                if self._ending:
                    return
                job = self._jobs.popleft()
            try:
                job()
            except Exception as error:
                # An internal error must not end the thread: the next map may work.
                self.refuse(f"internal error: {type(error).__name__}: {error}")
            with self._changed:
                self._done += 1
                self._changed.notify_all()

    def _prepare_map(self, message: bytes, kind: type, number: int) -> None:
        if number < self._newest[kind]:
            return
        self.topic = CLOUD if kind is PointCloud2 else GRID_MAP
        self._unplaced = None
        used, self._used = self._used, None
        try:
            read = read_message(message, kind)
            source = self._find_source(read.header)
            is_plain = kind is PointCloud2 and source is None
            if is_plain and used is not None and is_same_cloud(read, used):
                self.renew(read)
            else:
                self.prepare(read, source)
            self._used = read if is_plain else None
        except RoverError as error:
            self.refuse(str(error))

    def _find_source(self, header: Header) -> Rigid | None:
        stamp = stamp_to_ns(header.stamp)
        try:
            return self._frames.find_source(header.frame_id, stamp, self.topic)
        except TransformError:
            self._unplaced = header.frame_id, stamp
            raise


def read_message(message: bytes, kind: type) -> Any:
    """Return the message of a type from its serialised bytes.

    Raises:
        MessageError: The bytes are no such message.
    """
    if kind is PointCloud2:
        return SensorReader().read(message, kind)
    try:
        return deserialize_message(message, kind)
    except Exception as error:  # RMWError, of a module that differs between distributions
        raise DamagedMessageError(message, kind, error) from None
