"""The service ~/load_map of a traverse server: loads a terrain file on request."""

from functools import partial
from pathlib import Path
from urllib.parse import unquote, urlparse

from nav_msgs.srv import LoadMap
from rclpy.node import Node

from msg_adapters.elevation import terrain_to_occupancy_grid
from rover_physics.terrain.grid import load_terrain
from rover_planner.nodes.map_topics import MapTopics
from rover_planner.ros.deferred_service import Reply, serve_later
from rover_planner.ros.guard import Guard
from rover_planner.ros.handover import Handover
from rover_planner.ros.refusals import INPUT_ERRORS


class MapFileService:
    """Serves ~/load_map; files are read in the thread of the maps."""

    def __init__(self, node: Node, maps: MapTopics, map_frame: str, guard: Guard):
        self._node, self._maps, self._frame, self._guard = node, maps, map_frame, guard
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
        file = _file_of_url(url)
        if file is None or not file.is_file():
            self._node.get_logger().error(
                f"load_map: no file {url!r}; it must be the path or file:// URL of a "
                "terrain file on this machine"
            )
            response.result = LoadMap.Response.RESULT_MAP_DOES_NOT_EXIST
            return
        try:
            terrain = load_terrain(file)
            self._maps.take_file(terrain, str(file))
        except INPUT_ERRORS as error:
            self._node.get_logger().error(f"load_map: {error}")
            response.result = LoadMap.Response.RESULT_INVALID_MAP_DATA
            return
        stamp = self._node.get_clock().now().to_msg()
        response.map = terrain_to_occupancy_grid(terrain, self._frame, stamp)
        response.result = LoadMap.Response.RESULT_SUCCESS


def _file_of_url(url: str) -> Path | None:
    """Return the file of a path or a file:// URL, None for other URLs."""
    parts = urlparse(url)
    if parts.scheme == "file":
        return Path(unquote(parts.path)) if parts.netloc in ("", "localhost") else None
    return Path(url) if "://" not in url else None
