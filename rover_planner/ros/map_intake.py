"""Maps for a loop that must not wait: taken as bytes, made ready once in their own thread."""

import threading
from collections.abc import Callable
from dataclasses import dataclass

from rclpy.serialization import deserialize_message
from sensor_msgs.msg import PointCloud2

from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traction.map_contacts import MapContactFinder
from rover_planner.ros.refusals import INPUT_ERRORS


@dataclass(frozen=True, eq=False)
class PreparedMap:
    """A map, and what finds contact angles on it."""

    rover: Rover
    """The rover that it was made ready for."""
    terrain: Terrain
    """The map."""
    finder: MapContactFinder
    """What looks up the contacts of that rover."""


def prepare_map(rover: Rover, terrain: Terrain) -> PreparedMap:
    """Make a map ready for a rover; that takes some ms."""
    return PreparedMap(rover, terrain, MapContactFinder(rover, terrain))


class MapIntake:
    """Takes clouds as they come over the wire, and has the latest map ready when asked."""

    def __init__(
        self, prepare: Callable[[PointCloud2], PreparedMap], refuse: Callable[[str], None]
    ):
        """Start the thread.

        Args:
            prepare: Makes a map of a cloud; INPUT_ERRORS is what it may raise.
            refuse: Told why a cloud cannot be used. Both are called in the thread.
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
        """Take a serialised cloud; one that is like the last, byte by byte, is passed over."""
        if cloud == self._last:
            return
        self._last = cloud
        with self._changed:
            self._waiting = cloud
            self._changed.notify()

    def take(self) -> PreparedMap | None:
        """Return a map that has become ready since the last call, if any."""
        ready, self._ready = self._ready, None
        return ready

    def close(self) -> None:
        """End the thread once it has finished what it is at."""
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
                # A fault of this program must not end the thread: the next map may be better.
                self._refuse(f"internal error: {type(error).__name__}: {error}")
