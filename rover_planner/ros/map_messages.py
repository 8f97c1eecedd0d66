# SPDX-License-Identifier: Apache-2.0
"""Makes terrains of the messages of maps, wherever their frames are on the map."""

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


def read_map(
    message: Any, values: TraverseServerParameters, source: Rigid | None, keeper: MapKeeper
) -> Terrain:
    """Return the terrain of a PointCloud2 or GridMap in the frame of the map.

    Args:
        message: The message.
        values: Parameters by which it becomes a map.
        source: Where the frame of the message is in that of the map; None if it is that.
        keeper: Lays a GridMap of another frame onto the cells of its map.

    Raises:
        MessageError: The message is no map.
        TerrainError: Its cells form no valid terrain.
        PlanningError: A GridMap leans.
    """
    move = None if source is None else source.matrix
    if isinstance(message, PointCloud2):
        return terrain_from_point_cloud(message, values.map_resolution, values.cell_height, move)
    layers = GridMapLayers(values.elevation_layer, values.variance_layer, values.friction_layer)
    terrain = terrain_from_grid_map(message, layers)
    return terrain if move is None else keeper.place(terrain, MapMove(*move))
