# SPDX-License-Identifier: Apache-2.0
"""Writes values of cells as occupancy grids: known ground, classes, areas that were reached."""

import numpy as np
from nav_msgs.msg import OccupancyGrid
from numpy.typing import NDArray
from std_msgs.msg import Header

from rover_physics.terrain.grid import Terrain

REACHED, NOT_REACHED = 0, 100
"""Values of places inside and outside of an area."""
UNKNOWN = -1
"""Value of unknown ground."""
VALUES = np.array([0, 33, 66, 100, UNKNOWN], np.int8)
"""Values of the classes 0 to 3: passable, with speed servos, with traction control, impassable;
and, as the last one, of the class -1: unknown."""


def occupancy_grid(
    values: NDArray[np.integer], cell: float, first: tuple[float, float], header: Header
) -> OccupancyGrid:
    """Return values (rows, columns), row 0 at the smallest y, as an occupancy grid.

    Args:
        values: -1 to 100.
        cell: Cell size [m].
        first: x, y of the centre of cell [0, 0] [m], map frame; the grid has that of its corner.
        header: Frame of the map, and stamp.
    """
    message = OccupancyGrid(header=header)
    message.info.map_load_time = header.stamp
    message.info.resolution = float(cell)
    message.info.height, message.info.width = values.shape
    message.info.origin.position.x = first[0] - 0.5 * cell
    message.info.origin.position.y = first[1] - 0.5 * cell
    message.info.origin.orientation.w = 1.0
    message.data.frombytes(np.ascontiguousarray(values, np.int8).tobytes())
    return message


def terrain_to_occupancy_grid(terrain: Terrain, header: Header) -> OccupancyGrid:
    """Convert a terrain into a grid of known (0) and unknown (-1) cells."""
    values = np.where(np.isnan(terrain.elevation), UNKNOWN, 0)
    return occupancy_grid(values, terrain.resolution, terrain.origin, header)
