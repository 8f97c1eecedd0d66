# SPDX-License-Identifier: Apache-2.0
"""The maps of a traverse server: topics, files, what the rover itself knows; and its ~/map."""

import contextlib
import math
import time
from collections.abc import Callable
from concurrent import futures
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
from nav_msgs.msg import OccupancyGrid
from nav_msgs.srv import LoadMap
from rclpy.exceptions import InvalidHandle
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from msg_adapters.elevation import terrain_to_point_cloud
from msg_adapters.results.grids import terrain_to_occupancy_grid
from rover_physics.errors import RoverError
from rover_physics.files.validation import show_file
from rover_planner.maps.known_map import KnownMap, describe_terrain
from rover_planner.maps.map_file import MapFileError, open_map
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.answering.traverse_service import TraverseService
from rover_planner.planning.navigation.transforms import Rigid
from rover_planner.ros.deferred import Reply, serve_later
from rover_planner.ros.lazy_publisher import LazyPublisher
from rover_planner.ros.map_intake import CLOUD, GRID_MAP, MapIntake, are_gridded_alike
from rover_planner.ros.node import RoverNode
from rover_planner.ros.server_inputs import ServerInputs
from rover_planner.ros.subscriptions import subscribe_to_map
from rover_planner.shell.extras import find_type

LOG_PERIOD = 10.0
"""Shortest time between two log lines about maps that merge, or come again and again [s]."""
FIRST_MAPS = 20
"""Maps that replace each other of which each has a line in the log."""
WAIT = 0.02
"""Time between two checks of a question that waits for a map [s]."""
MERGE_WAIT = 0.005
"""Longest wait of a question for a map that is to be merged into the one that is there [s]. A busy
machine may take 15 ms more to wake the thread until it is 20 ms."""


class MapTopics(MapIntake):
    """Keeps the map of a TraverseService up to date; maps are prepared in a thread."""

    def __init__(
        self,
        node: RoverNode[TraverseServerParameters],
        inputs: ServerInputs,
        report: Callable[[str], None],
    ):
        """Subscribe to the maps and serve ~/load_map.

        Args:
            node: The node.
            inputs: Takes the maps, in the thread.
            report: Called in the thread after each map: with the reason if it was refused, else
                with an empty text.
        """
        self._node, self._inputs, self._report = node, inputs, report
        self._service = inputs.service
        self._is_from_topic = False
        self._logged_at, self._logged_kind = -float("inf"), ("", False)
        self._map_count = 0
        super().__init__(node.get_logger(), inputs.frames)
        self._subscribe(CLOUD, PointCloud2)
        serve_later(node, LoadMap, "~/load_map", self._load_map)
        grid_map = find_type("grid_map_msgs.msg:GridMap")
        if grid_map is not None:
            self._subscribe(GRID_MAP, grid_map)

    def _subscribe(self, topic: str, kind: type) -> None:
        def offer(message: bytes) -> None:
            self._node.heard.poll()
            self.offer(message, kind)

        subscribe_to_map(self._node, kind, topic, offer)

    def wait(self, job: Future[None], check: Callable[[], object]) -> None:
        """Wait until a job is done, such as `last_job`; `check` may raise meanwhile.

        Where maps merge, the wait is no longer than MERGE_WAIT, as there is a good map.
        """
        merges = self._inputs.keeper.merges and self._service.known_map is not None
        end = time.monotonic() + (MERGE_WAIT if merges else math.inf)
        while not job.done() and (left := end - time.monotonic()) > 0.0:
            futures.wait([job], min(WAIT, left))
            check()

    def apply(self, before: TraverseServerParameters) -> None:
        """Make the present map anew if a parameter of messages has changed.

        Those of merging and filling count from the next map on.
        """
        settings = self._service.settings
        self.do(partial(self._inputs.keeper.apply, settings.rover, settings.parameters))
        self.do(self._service.refresh_map)
        if self._is_from_topic and not are_gridded_alike(before, settings.parameters):
            self.repeat()

    def _load_map(
        self, request: LoadMap.Request, response: LoadMap.Response, reply: Reply
    ) -> None:
        """Load the map of a file in the thread, then reply."""

        def load() -> None:
            try:
                response.map = self._load(request.map_url)
                response.result = LoadMap.Response.RESULT_SUCCESS
            except RoverError as error:
                self._node.get_logger().error(f"load_map: {error}")
                response.result = LoadMap.Response.RESULT_INVALID_MAP_DATA
                if isinstance(error, MapFileError):
                    response.result = LoadMap.Response.RESULT_MAP_DOES_NOT_EXIST
            except Exception as error:
                self._node.guard.report("load_map", error)
                response.result = LoadMap.Response.RESULT_INVALID_MAP_DATA
            self._node.handover.call(partial(reply, response))

        self.do(load)

    def _load(self, url: str) -> OccupancyGrid:
        """Take the map of a file; return its known cells."""
        values = self._service.settings.parameters
        limits = values.map_folder, values.max_map_bytes, values.max_map_cells
        terrain = open_map(url, *limits)
        standing, now = self._service.standing(), self._node.seconds
        snapshot = self._inputs.keeper.load(terrain, now, standing)
        self.forget()
        self._is_from_topic = False
        source = show_file(url)
        self._note(source, self._inputs.keep(snapshot, source))
        stamp = self._node.get_clock().now().to_msg()
        return terrain_to_occupancy_grid(terrain, Header(frame_id=values.map_frame, stamp=stamp))

    def look_under_rover(self) -> None:
        """Have unknown ground under the rover filled, if that is due."""
        if self._inputs.may_fill_under_rover():
            self.do(self._fill_under_rover)

    def prepare(self, message: Any, source: Rigid | None) -> None:
        """Take a PointCloud2 or GridMap into the map."""
        self._note(self.topic, self._inputs.take_map(message, source, self.topic))
        self._is_from_topic = True

    def _fill_under_rover(self) -> None:
        filled = self._inputs.fill_under_rover()
        if filled is not None:
            self._node.get_logger().info(
                f"ground under the rover filled: {filled.sources.count()} cells by source"
            )

    def _note(self, source: str, is_new: bool) -> None:
        """Report that a map was taken, prepare it for questions, and log one that is new."""
        self._report("")
        self._service.prepare()
        if is_new:
            taken, now = self._service.terrain, time.monotonic()
            assert taken is not None
            kind = source, self._inputs.keeper.merges
            self._map_count += not kind[1]
            is_due = now - self._logged_at >= LOG_PERIOD or kind != self._logged_kind
            if is_due or (not kind[1] and self._map_count <= FIRST_MAPS):
                self._logged_at, self._logged_kind = now, kind
                self._node.get_logger().info(f"map from {source}: {describe_terrain(taken)}")

    def describe_kept(self) -> str:
        """Return what stays where a map is refused."""
        there = self._service.known_map is not None
        return "the last good map stays" if there else "there is no map yet"

    def refuse(self, error: str) -> None:
        """Log and report why a map is refused."""
        super().refuse(error)
        self._report(error)


class MapCloud:
    """Publishes the map of a service while someone subscribes; clouds are made in a thread."""

    def __init__(self, node: RoverNode[TraverseServerParameters], service: TraverseService):
        """Create the publisher."""
        self._node, self._service = node, service
        self._publisher = LazyPublisher(node, PointCloud2, "~/map")
        self._shown = ""  # fingerprint
        self._pool = ThreadPoolExecutor(1, "map_cloud")
        self._work: Future[None] | None = None

    def update(self) -> None:
        """Publish the map if it is new and someone subscribes; call it about once a second."""
        known = self._service.known_map
        is_free = self._work is None or self._work.done()
        if known is None or known.fingerprint == self._shown or not is_free:
            return
        if not self._publisher.has_listeners:
            self._publisher.withdraw()
        else:
            self._shown = known.fingerprint
            publish = partial(self._publish_map, known)
            self._work = self._pool.submit(self._node.guard.call, publish)

    def close(self) -> None:
        """End the thread."""
        self._pool.shutdown(cancel_futures=True)

    def _publish_map(self, known: KnownMap) -> None:
        more: dict[str, np.ndarray] = {}
        if known.cells is not None:
            age = self._node.seconds - known.cells.time
            more = {
                "source": known.cells.source,
                "age": np.where(np.isfinite(known.received.elevation), age, np.nan),
            }
        frame, stamp = self._node.values.map_frame, self._node.get_clock().now()
        cloud = terrain_to_point_cloud(known.received, frame, stamp.to_msg(), more=more)
        with contextlib.suppress(InvalidHandle):  # the node has ended meanwhile
            self._publisher.send(cloud)
