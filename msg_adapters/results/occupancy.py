# SPDX-License-Identifier: Apache-2.0
"""Writes values of cells as an occupancy grid."""

from typing import Any

import numpy as np
from nav_msgs.msg import OccupancyGrid
from numpy.typing import NDArray


def occupancy_grid(
    values: NDArray[np.int8], cell: float, first: tuple[float, float], frame: str, stamp: Any
) -> OccupancyGrid:
    """Return values (rows, columns), row 0 at the smallest y, as an occupancy grid.

    Args:
        values: -1 to 100.
        cell: Cell size [m].
        first: x, y of the centre of cell [0, 0] [m], map frame.
        frame: Frame of the map.
        stamp: builtin_interfaces/Time.
    """
    message = OccupancyGrid()
    message.header.frame_id, message.header.stamp = frame, stamp
    message.info.map_load_time = stamp
    message.info.resolution = cell
    message.info.height, message.info.width = values.shape
    message.info.origin.position.x = first[0] - 0.5 * cell
    message.info.origin.position.y = first[1] - 0.5 * cell
    message.info.origin.orientation.w = 1.0
    message.data.frombytes(np.ascontiguousarray(values, np.int8).tobytes())
    return message
