# SPDX-License-Identifier: Apache-2.0
"""The service ~/load_map of a traverse server: loads a terrain file on request."""

from collections.abc import Callable
from functools import partial

from nav_msgs.srv import LoadMap
from rclpy.node import Node

from msg_adapters.elevation import terrain_to_occupancy_grid
from rover_physics.files.validation import show_file
from rover_planner.maps.map_file import MapFileError, MapLimits, open_map
from rover_planner.nodes.maps.map_topics import MapTopics
from rover_planner.ros.deferred_service import Reply, serve_later
from rover_planner.ros.guard import Guard
from rover_planner.ros.handover import Handover
from rover_planner.ros.refusals import INPUT_ERRORS


class MapFileService:
    """Serves ~/load_map; files are read in the thread of the maps."""

    def __init__(
        self,
        node: Node,
        maps: MapTopics,
        map_frame: str,
        guard: Guard,
        limits: Callable[[], MapLimits],
    ):
        """Serve; `limits` returns what may be loaded at the time."""
        self._node, self._maps, self._frame, self._guard = node, maps, map_frame, guard
        self._limits = limits
        self._handover = Handover(node, guard)
        serve_later(node, LoadMap, "~/load_map", self._take)

    def _take(self, request: LoadMap.Request, response: LoadMap.Response, reply: Reply) -> None:
        def load() -> None:
            try:
                self._load(request.map_url, response)
            except Exception as error:
                self._guard.report("load_map", error)
                response.result = LoadMap.Response.RESULT_INVALID_MAP_DATA
            self._handover.call(partial(reply, response))

        self._maps.do(load)

    def _load(self, url: str, response: LoadMap.Response) -> None:
        """Take the map of a file and fill the response."""
        try:
            terrain = open_map(url, self._limits())
            self._maps.take_file(terrain, show_file(url))
        except MapFileError as error:
            self._node.get_logger().error(f"load_map: {error}")
            response.result = LoadMap.Response.RESULT_MAP_DOES_NOT_EXIST
            return
        except INPUT_ERRORS as error:
            self._node.get_logger().error(f"load_map: {error}")
            response.result = LoadMap.Response.RESULT_INVALID_MAP_DATA
            return
        stamp = self._node.get_clock().now().to_msg()
        response.map = terrain_to_occupancy_grid(terrain, self._frame, stamp)
        response.result = LoadMap.Response.RESULT_SUCCESS
