# SPDX-License-Identifier: Apache-2.0
"""Makes terrains of the messages of maps, wherever their frames are on the map."""

from dataclasses import dataclass
from typing import Any

from sensor_msgs.msg import PointCloud2

from msg_adapters.elevation import terrain_from_point_cloud
from msg_adapters.grid_map import GridMapLayers, terrain_from_grid_map
from rover_physics.terrain.grid import Terrain
from rover_planner.maps.map_keeper import MapKeeper
from rover_planner.maps.moved_map import MapMove
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.navigation.transforms import Rigid

LOOK_PERIOD = 0.5
"""Shortest time between two looks for unknown ground under the rover [s]."""


@dataclass(frozen=True)
class MapSettings:
    """Parameters by which messages become maps."""

    frame: str
    """Frame of the map."""
    resolution: float
    """Cell size [m]; 0 takes the spacing of the points."""
    cell_height: str
    """Height of a cell with several points."""
    layers: GridMapLayers
    """Names of the layers of a GridMap."""

    @staticmethod
    def of(values: TraverseServerParameters) -> "MapSettings":
        """Return the settings of the parameters."""
        layers = GridMapLayers(
            values.elevation_layer, values.variance_layer, values.friction_layer
        )
        return MapSettings(values.map_frame, values.map_resolution, values.cell_height, layers)


def read_map(
    message: Any, settings: MapSettings, source: Rigid | None, keeper: MapKeeper
) -> Terrain:
    """Return the terrain of a PointCloud2 or GridMap in the frame of the map.

    Args:
        message: The message.
        settings: How it becomes a map.
        source: Where the frame of the message is in that of the map; None if it is that.
        keeper: Lays a GridMap of another frame onto the cells of its map.

    Raises:
        MessageError: The message is no map.
        TerrainError: Its cells form no valid terrain.
        PlanningError: A GridMap leans.
    """
    move = None if source is None else source.matrix
    if isinstance(message, PointCloud2):
        return terrain_from_point_cloud(message, settings.resolution, settings.cell_height, move)
    terrain = terrain_from_grid_map(message, settings.layers)
    return terrain if move is None else keeper.place(terrain, MapMove(*move))
