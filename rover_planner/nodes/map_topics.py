"""The maps of a traverse server: a topic, a file at start, and files on request."""

from collections.abc import Callable
from dataclasses import dataclass

from rclpy.node import Node
from sensor_msgs.msg import PointCloud2

from msg_adapters.elevation import terrain_from_point_cloud
from msg_adapters.frames import check_frame
from msg_adapters.stamps import stamp_to_ns
from rover_physics.terrain.grid import Terrain, load_terrain
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.answering.traverse_service import TraverseService
from rover_planner.ros.guard import Guard
from rover_planner.ros.map_intake import MapIntake
from rover_planner.ros.qos import map_subscriptions
from rover_planner.ros.qos_warnings import warn_of_mismatch
from rover_planner.worlds.summary import describe_terrain

TOPIC = "elevation_cloud"


@dataclass(frozen=True)
class MapSettings:
    """How clouds become maps."""

    frame: str
    """Frame of the map."""
    resolution: float
    """Cell size [m]; 0 takes the spacing of the points."""
    cell_height: str
    """Height of a cell with several points."""


class MapTopics:
    """Keeps the map of a TraverseService up to date; maps are prepared in a thread."""

    def __init__(
        self,
        node: Node,
        service: TraverseService,
        parameters: TraverseServerParameters,
        guard: Guard,
        tell: Callable[[str], None],
    ):
        """Subscribe to the map and load the first one.

        Args:
            node: The node.
            service: Takes the maps.
            parameters: The parameters of the node.
            guard: Takes unexpected errors.
            tell: Called in the thread after each map: with the reason if it was refused, else
                with an empty text.

        Raises:
            TerrainError: The file of the parameter terrain_file cannot be loaded.
        """
        self._node, self._service, self._tell = node, service, tell
        self._settings = _settings_of(parameters)
        self._is_from_cloud = False
        if parameters.terrain_file:
            terrain = load_terrain(parameters.terrain_file, parameters.max_map_cells)
            service.take_terrain(terrain, parameters.terrain_file)
        self._intake = MapIntake(self._take_cloud, self._refuse)
        take = guard.around(self._offer)
        for qos, mends in map_subscriptions(
            parameters.map_durability, parameters.input_reliability
        ):
            events = warn_of_mismatch(node, TOPIC, mends)
            node.create_subscription(
                PointCloud2, TOPIC, take, qos, event_callbacks=events, raw=True
            )

    def ticket(self) -> int:
        """Return a number for `wait`: all maps that have come until now."""
        return self._intake.ticket()

    def wait(self, ticket: int, check: Callable[[], object]) -> None:
        """Wait until the maps before a ticket are taken; `check` may raise meanwhile."""
        self._intake.wait(ticket, check)

    def apply(self, parameters: TraverseServerParameters) -> None:
        """Make the present map anew if a parameter of maps has changed."""
        before, self._settings = self._settings, _settings_of(parameters)
        if self._is_from_cloud and before != self._settings:
            self._intake.repeat()
        else:
            self._intake.do(self._service.refresh_map)

    def do(self, job: Callable[[], None]) -> None:
        """Call a function in the thread of the maps."""
        self._intake.do(job)

    def take_file(self, terrain: Terrain, file: str) -> None:
        """Take the terrain of a file; call it in the thread of the maps."""
        self._intake.forget()
        self._is_from_cloud = False
        self._take(terrain, file, None)

    def close(self) -> None:
        """End the thread."""
        self._intake.close()

    def _offer(self, cloud: bytes) -> None:
        if not self._intake.offer(cloud):
            self._intake.do(self._renew)

    def _renew(self) -> None:
        """Note that the last cloud has arrived again, if it is the map in use."""
        if self._is_from_cloud:
            self._service.renew_map()

    def _take_cloud(self, cloud: PointCloud2) -> None:
        settings = self._settings
        check_frame(cloud.header.frame_id, settings.frame, TOPIC)
        terrain = terrain_from_point_cloud(cloud, settings.resolution, settings.cell_height)
        self._take(terrain, TOPIC, stamp_to_ns(cloud.header.stamp))
        self._is_from_cloud = True

    def _take(self, terrain: Terrain, source: str, stamp: int | None) -> None:
        is_new = self._service.take_terrain(terrain, source, stamp)
        self._tell("")
        if is_new:
            taken = self._service.terrain
            assert taken is not None
            self._node.get_logger().info(f"map from {source}: {describe_terrain(taken)}")

    def _refuse(self, error: str) -> None:
        there = self._service.known_map is not None
        kept = "the last good map stays" if there else "there is no map yet"
        self._node.get_logger().error(f"{TOPIC} refused, {kept}: {error}")
        self._tell(error)


def _settings_of(parameters: TraverseServerParameters) -> MapSettings:
    return MapSettings(parameters.map_frame, parameters.map_resolution, parameters.cell_height)
