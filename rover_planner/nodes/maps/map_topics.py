# SPDX-License-Identifier: Apache-2.0
"""The maps of a traverse server: topics, files, and what the rover itself knows."""

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rclpy.node import Node
from sensor_msgs.msg import Imu, PointCloud2

from msg_adapters.elevation import PointMove, terrain_from_point_cloud
from msg_adapters.errors import MessageError
from msg_adapters.frames import check_frame
from msg_adapters.grid_map import GridMapLayers, terrain_from_grid_map
from msg_adapters.imu import ImuMounting, imu_to_attitude
from msg_adapters.sensing import BASE_FRAME
from msg_adapters.stamps import NANOSECONDS, stamp_to_ns
from rover_physics.terrain.grid import Terrain, load_terrain
from rover_planner.maps.living_map import MapSnapshot
from rover_planner.maps.map_keeper import MapKeeper
from rover_planner.maps.moved_map import MapMove
from rover_planner.maps.summary import describe_terrain
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.answering.service_settings import keeper_settings
from rover_planner.planning.answering.traverse_service import TraverseService
from rover_planner.planning.navigation.transforms import Rigid, TransformError
from rover_planner.ros.logs.repeat_log import RepeatLog
from rover_planner.ros.map_intake import MapIntake
from rover_planner.ros.qos import map_subscriptions, sensor_qos
from rover_planner.ros.qos_warnings import warn_of_mismatch

CLOUD, GRID_MAP = "elevation_cloud", "elevation_map"
"""Topics of maps: PointCloud2, and GridMap where its package is installed."""
LOOK_PERIOD = 0.5
"""Shortest time between two looks for unknown ground under the rover [s]."""
LOG_PERIOD = 10.0
"""Shortest time between two log lines about maps that merge, or come again and again [s]."""
FIRST_MAPS = 20
"""Maps that replace each other of which each is told in the log."""
MERGE_WAIT = 0.005
"""Longest wait of a question for a map that is to be merged into the one that is there [s]. A busy
machine may take 15 ms more to wake the thread until it is 20 ms."""


@dataclass(frozen=True)
class MapSettings:
    """How messages become maps."""

    frame: str
    """Frame of the map."""
    resolution: float
    """Cell size [m]; 0 takes the spacing of the points."""
    cell_height: str
    """Height of a cell with several points."""
    layers: GridMapLayers
    """Names of the layers of a GridMap."""


def grid_map_type() -> type | None:
    """Return grid_map_msgs/GridMap; None where it is not installed."""
    try:
        from grid_map_msgs.msg import GridMap
    except ImportError:
        return None
    kind: type = GridMap
    return kind


class MapTopics:
    """Keeps the map of a TraverseService up to date; maps are prepared in a thread."""

    def __init__(
        self,
        node: Node,
        service: TraverseService,
        parameters: TraverseServerParameters,
        tell: Callable[[str], None],
        find_sensor: Callable[[str, int | None], Rigid],
    ):
        """Subscribe to the maps and load the first one.

        Args:
            node: The node.
            service: Takes the maps.
            parameters: The parameters of the node.
            tell: Called in the thread after each map: with the reason if it was refused, else
                with an empty text.
            find_sensor: Returns where a sensor's frame was in the map frame at a time [ns];
                called in the thread; may raise INPUT_ERRORS.

        Raises:
            TerrainError: The file of the parameter terrain_file cannot be loaded.
        """
        self._node, self._service, self._tell = node, service, tell
        self._find_sensor = find_sensor
        self._settings = _settings_of(parameters)
        self._fills = parameters.fill_under_rover
        self._keeper = MapKeeper(service.settings.rover, keeper_settings(parameters))
        self._is_from_topic = False
        self._topic, self._looked = CLOUD, -float("inf")
        self._told, self._told_kind = -float("inf"), ("", False)
        self._map_count, self._refusals = 0, RepeatLog()
        self._unplaced: tuple[str, int | None] | None = None
        if parameters.terrain_file:
            terrain = load_terrain(parameters.terrain_file, parameters.max_map_cells)
            self._keep(self._keeper.load(terrain, self._now(), None), parameters.terrain_file)
        self._intake: MapIntake[None] = MapIntake(self._take_message, self._refuse)
        self._subscribe(CLOUD, PointCloud2, parameters)
        if parameters.imu_attitude:
            self._subscribe_to_imu(parameters)
        grid_map = grid_map_type()
        if grid_map is not None:
            self._subscribe(GRID_MAP, grid_map, parameters)

    def _subscribe(self, topic: str, kind: type, parameters: TraverseServerParameters) -> None:
        def offer(message: bytes) -> None:
            if not self._intake.offer(message, kind):
                self._intake.do(self._renew)

        for qos, mends in map_subscriptions(
            parameters.map_durability, parameters.input_reliability
        ):
            events = warn_of_mismatch(self._node, topic, mends)
            self._node.create_subscription(
                kind, topic, offer, qos, event_callbacks=events, raw=True
            )

    def _subscribe_to_imu(self, parameters: TraverseServerParameters) -> None:
        mounting = ImuMounting(parameters.imu_frame or BASE_FRAME, parameters.imu_mounting)

        def take(imu: Imu) -> None:
            try:
                attitude = imu_to_attitude(imu, mounting)
            except MessageError as error:
                logger = self._node.get_logger()
                logger.warning(f"imu not used: {error}", throttle_duration_sec=LOG_PERIOD)
                return
            self._service.take_tilt(attitude.roll, attitude.pitch)

        self._node.create_subscription(Imu, "imu", take, sensor_qos())

    def ticket(self) -> int:
        """Return a number for `wait`: all maps that have come until now."""
        return self._intake.ticket()

    def wait(self, ticket: int, check: Callable[[], object]) -> None:
        """Wait until the maps before a ticket are taken; `check` may raise meanwhile.

        Where maps merge, the wait is no longer than MERGE_WAIT, as there is a good map.
        """
        merges = self._keeper.merges and self._service.known_map is not None
        self._intake.wait(ticket, check, MERGE_WAIT if merges else float("inf"))

    def apply(self, parameters: TraverseServerParameters) -> None:
        """Make the present map anew if a parameter of messages has changed.

        Those of merging and filling count from the next map on.
        """
        before, self._settings = self._settings, _settings_of(parameters)
        self._fills = parameters.fill_under_rover
        settings, rover = keeper_settings(parameters), self._service.settings.rover
        self._intake.do(lambda: self._keeper.apply(rover, settings))
        if self._is_from_topic and before != self._settings:
            self._intake.repeat()
        else:
            self._intake.do(self._service.refresh_map)

    def do(self, job: Callable[[], None]) -> None:
        """Call a function in the thread of the maps."""
        self._intake.do(job)

    def take_file(self, terrain: Terrain, file: str) -> None:
        """Take the terrain of a file; call it in the thread of the maps."""
        self._intake.forget()
        self._is_from_topic = False
        self._take(self._keeper.load(terrain, self._now(), self._service.standing()), file, None)

    def look_under_rover(self) -> None:
        """Have unknown ground under the rover filled, at most every LOOK_PERIOD."""
        now = time.monotonic()
        is_due = self._fills and now - self._looked >= LOOK_PERIOD
        if is_due and self._service.standing() is not None:
            self._looked = now
            self._intake.do(self._fill_under_rover)

    def retry(self) -> None:
        """Take the last message again if its transform has come meanwhile; call it each second.

        A map that is published once may arrive before the first transform.
        """
        if self._unplaced is None:
            return
        with contextlib.suppress(TransformError):
            self._find_sensor(*self._unplaced)
            self._unplaced = None
            self._intake.repeat()

    def close(self) -> None:
        """End the thread."""
        self._intake.close()

    def _renew(self) -> None:
        """Note that the last message has arrived again, if it is the map in use."""
        if self._is_from_topic:
            self._service.renew_map()

    def _take_message(self, message: Any) -> None:
        settings = self._settings
        self._topic = CLOUD if isinstance(message, PointCloud2) else GRID_MAP
        stamp = stamp_to_ns(message.header.stamp)
        self._unplaced = None
        source = self._find_source(message.header.frame_id, stamp)
        if self._topic == CLOUD:
            move = None if source is None else PointMove(*source.matrix)
            terrain = terrain_from_point_cloud(
                message, settings.resolution, settings.cell_height, move
            )
        else:
            terrain = terrain_from_grid_map(message, settings.layers)
            if source is not None:
                terrain = self._keeper.place(terrain, MapMove(*source.matrix))
        since = self._now() if stamp is None else stamp / NANOSECONDS
        kept = self._keeper.take(terrain, self._topic, since, self._service.standing())
        self._take(kept, self._topic, stamp)
        self._is_from_topic = True

    def _find_source(self, frame: str, stamp: int | None) -> Rigid | None:
        """Return where the frame of a map was in the map frame; None if it is that."""
        if frame == self._settings.frame:
            return None
        if not frame:
            check_frame(frame, self._settings.frame, self._topic)
        try:
            return self._find_sensor(frame, stamp)
        except TransformError:
            self._unplaced = frame, stamp
            raise

    def _fill_under_rover(self) -> None:
        standing = self._service.standing()
        if standing is None or self._service.known_map is None:
            return
        filled = self._keeper.fill(standing, self._now())
        if filled is not None:
            self._service.amend_map(filled.terrain, filled.sources)
            self._node.get_logger().info(
                f"ground under the rover filled: {filled.sources.count()} cells by source"
            )

    def _take(self, snapshot: MapSnapshot, source: str, stamp: int | None) -> None:
        is_new = self._keep(snapshot, source, stamp)
        self._tell("")
        if is_new:
            taken, now = self._service.terrain, time.monotonic()
            assert taken is not None
            kind = source, self._keeper.merges
            self._map_count += not kind[1]
            is_due = now - self._told >= LOG_PERIOD or kind != self._told_kind
            if is_due or (not kind[1] and self._map_count <= FIRST_MAPS):
                self._told, self._told_kind = now, kind
                self._node.get_logger().info(f"map from {source}: {describe_terrain(taken)}")

    def _keep(self, snapshot: MapSnapshot, source: str, stamp: int | None = None) -> bool:
        return self._service.take_terrain(
            snapshot.terrain, source, stamp, snapshot.sources, self._settings.frame
        )

    def _now(self) -> float:
        """Return the ROS time [s]."""
        now: float = self._node.get_clock().now().nanoseconds / NANOSECONDS
        return now

    def _refuse(self, error: str) -> None:
        there = self._service.known_map is not None
        kept = "the last good map stays" if there else "there is no map yet"
        line = self._refusals.line(f"{self._topic} refused, {kept}: {error}", time.monotonic())
        if line:
            self._node.get_logger().error(line)
        self._tell(error)


def _settings_of(parameters: TraverseServerParameters) -> MapSettings:
    layers = GridMapLayers(
        parameters.elevation_layer, parameters.variance_layer, parameters.friction_layer
    )
    return MapSettings(
        parameters.map_frame,
        parameters.map_resolution,
        parameters.cell_height,
        layers,
    )
