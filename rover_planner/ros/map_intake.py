"""Receives maps for a control loop and prepares them in a separate thread."""

import threading
from collections.abc import Callable

from rclpy.serialization import deserialize_message
from sensor_msgs.msg import PointCloud2

from rover_planner.ros.refusals import INPUT_ERRORS
from rover_planner.traction.prepared_map import PreparedMap


class MapIntake:
    """Takes serialised clouds, prepares a map of the latest one, and returns it on request."""

    def __init__(
        self, prepare: Callable[[PointCloud2], PreparedMap], refuse: Callable[[str], None]
    ):
        """Start the thread.

        Args:
            prepare: Makes a map of a cloud; called in the thread; may raise INPUT_ERRORS.
            refuse: Called in the thread with the reason why a cloud cannot be used.
        """
        self._prepare, self._refuse = prepare, refuse
        self._changed = threading.Condition()
        self._last = b""
        self._waiting: bytes | None = None
        self._ready: PreparedMap | None = None
        self._ending = False
        self._thread = threading.Thread(target=self._run, name="maps", daemon=True)
        self._thread.start()

    def offer(self, cloud: bytes) -> None:
        """Take a serialised cloud; one with the same bytes as the last is ignored."""
        if cloud == self._last:
            return
        self._last = cloud
        with self._changed:
            self._waiting = cloud
            self._changed.notify()

    def take(self) -> PreparedMap | None:
        """Return the map that was prepared since the last call, None if there is none."""
        ready, self._ready = self._ready, None
        return ready

    def close(self) -> None:
        """End the thread after the map in work is prepared."""
        with self._changed:
            self._ending = True
            self._changed.notify()
        self._thread.join()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting is not None or self._ending)
                cloud, self._waiting = self._waiting, None
            if self._ending or cloud is None:
                return
            try:
                self._ready = self._prepare(deserialize_message(cloud, PointCloud2))
            except INPUT_ERRORS as error:
                self._refuse(str(error))
            except Exception as error:
                # An internal error must not end the thread: the next map may work.
                self._refuse(f"internal error: {type(error).__name__}: {error}")
