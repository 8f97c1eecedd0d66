# SPDX-License-Identifier: Apache-2.0
"""The topic ~/map of a traverse server: its map, with source and age of each cell."""

import contextlib
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
from rclpy.exceptions import InvalidHandle
from sensor_msgs.msg import PointCloud2

from msg_adapters.elevation import terrain_to_point_cloud
from rover_planner.maps.known_map import KnownMap
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.answering.traverse_service import TraverseService
from rover_planner.ros.lazy_publisher import LazyPublisher
from rover_planner.ros.node import RoverNode

TOPIC = "~/map"


class MapCloud:
    """Publishes the map of a service while someone subscribes; clouds are made in a thread."""

    def __init__(self, node: RoverNode[TraverseServerParameters], service: TraverseService):
        """Create the publisher."""
        self._node, self._service = node, service
        self._publisher = LazyPublisher(node, PointCloud2, TOPIC)
        self._shown: KnownMap | None = None
        self._pool = ThreadPoolExecutor(1, "map_cloud")
        self._work: Future[None] | None = None

    def update(self) -> None:
        """Publish the map if it is new and someone subscribes; call it about once a second."""
        known = self._service.known_map
        is_new = known is not None and known.fingerprint != getattr(
            self._shown, "fingerprint", None
        )
        is_free = self._work is None or self._work.done()
        if known is None or not is_new or not is_free:
            return
        if not self._publisher.has_listeners:
            self._publisher.withdraw()
        else:
            self._shown = known
            self._work = self._pool.submit(self._publish, known)

    def close(self) -> None:
        """End the thread."""
        self._pool.shutdown(cancel_futures=True)

    def _publish(self, known: KnownMap) -> None:
        more: dict[str, np.ndarray] = {}
        if known.cells is not None:
            age = self._node.seconds - known.cells.time
            more = {
                "source": known.cells.source,
                "age": np.where(np.isfinite(known.received.elevation), age, np.nan),
            }
        frame, stamp = known.frame or self._node.values.map_frame, self._node.get_clock().now()
        cloud = terrain_to_point_cloud(known.received, frame, stamp.to_msg(), more=more)
        with contextlib.suppress(InvalidHandle):  # the node has ended meanwhile
            self._publisher.send(cloud)
