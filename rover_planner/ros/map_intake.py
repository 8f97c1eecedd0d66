"""Prepares maps in a thread of their own, so that a node goes on meanwhile."""

import threading
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any, Generic, TypeVar

from rclpy.serialization import deserialize_message
from sensor_msgs.msg import PointCloud2

from msg_adapters.errors import MessageError
from rover_planner.ros.refusals import INPUT_ERRORS

WAIT = 0.02
"""Time between two checks of who waits for a map [s]."""
END_TIME = 2.0
"""Longest wait for the map in work when the intake is closed [s]."""

Map = TypeVar("Map")


class MapIntake(Generic[Map]):
    """Takes serialised clouds, prepares a map of the latest one, and returns it on request."""

    def __init__(self, prepare: Callable[[PointCloud2], Map], refuse: Callable[[str], None]):
        """Start the thread.

        Args:
            prepare: Makes a map of a cloud; called in the thread; may raise INPUT_ERRORS.
            refuse: Called in the thread with the reason why a cloud cannot be used.
        """
        self._prepare, self._refuse = prepare, refuse
        self._changed = threading.Condition()
        self._last = b""
        self._jobs: deque[Callable[[], Any]] = deque()
        self._given, self._done, self._newest_cloud = 0, 0, 0
        self._ready: Map | None = None
        self._ending = False
        self._thread = threading.Thread(target=self._run, name="maps", daemon=True)
        self._thread.start()

    def offer(self, cloud: bytes) -> bool:
        """Take a serialised cloud; return False and ignore one with the same bytes as the last.

        A cloud that still waits is replaced by the new one.
        """
        if cloud == self._last:
            return False
        self._last = cloud
        self._do_latest(cloud)
        return True

    def repeat(self) -> None:
        """Prepare the last cloud again, if there is one, such as with other settings."""
        if self._last:
            self._do_latest(self._last)

    def forget(self) -> None:
        """Forget the last cloud, because another map replaces it."""
        self._last = b""

    def do(self, job: Callable[[], Any]) -> None:
        """Call a function in the thread after all that was given before."""
        with self._changed:
            self._given += 1
            self._jobs.append(job)
            self._changed.notify_all()

    def take(self) -> Map | None:
        """Return the map that was prepared since the last call, None if there is none."""
        ready, self._ready = self._ready, None
        return ready

    def ticket(self) -> int:
        """Return a number for `wait`: all that was given until now."""
        return self._given

    def wait(self, ticket: int, check: Callable[[], object]) -> None:
        """Wait until all that was given before a ticket is done; `check` may raise meanwhile."""
        with self._changed:
            while self._done < ticket and not self._ending:
                self._changed.wait(WAIT)
                check()

    def close(self) -> None:
        """End the thread after the map in work is prepared."""
        with self._changed:
            self._ending = True
            self._changed.notify_all()
        self._thread.join(END_TIME)

    def _do_latest(self, cloud: bytes) -> None:
        self._newest_cloud = self._given + 1
        self.do(partial(self._prepare_map, cloud, self._newest_cloud))

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
                self._refuse(f"internal error: {type(error).__name__}: {error}")
            with self._changed:
                self._done += 1
                self._changed.notify_all()

    def _prepare_map(self, cloud: bytes, number: int) -> None:
        if number < self._newest_cloud:
            return
        try:
            self._ready = self._prepare(read_cloud(cloud))
        except INPUT_ERRORS as error:
            self._refuse(str(error))


def read_cloud(cloud: bytes) -> PointCloud2:
    """Return the message of a serialised cloud.

    Raises:
        MessageError: The bytes are no PointCloud2.
    """
    try:
        return deserialize_message(cloud, PointCloud2)
    except Exception as error:  # RMWError, of a module that differs between distributions
        raise MessageError(
            f"{len(cloud)} bytes were received that are no PointCloud2; the publisher or the "
            f"connection is damaged: {error}"
        ) from None
