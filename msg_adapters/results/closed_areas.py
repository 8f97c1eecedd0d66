# SPDX-License-Identifier: Apache-2.0
"""Writes the places that a search for a way could reach as an occupancy grid."""

from typing import Any

import numpy as np
from nav_msgs.msg import OccupancyGrid
from numpy.typing import NDArray

from msg_adapters.results.occupancy import occupancy_grid

REACHED, NOT_REACHED = 0, 100
"""Values of places inside and outside the area."""


def area_to_grid(
    places: NDArray[np.bool_], cell: float, first: tuple[float, float], frame: str, stamp: Any
) -> OccupancyGrid:
    """Return an area as an occupancy grid: REACHED inside, NOT_REACHED outside.

    Args:
        places: (rows, columns) True inside the area, row 0 at the smallest y.
        cell: Distance of neighbouring places [m].
        first: Position x, y of the first place [m], map frame.
        frame: Frame of the map.
        stamp: builtin_interfaces/Time.
    """
    values = np.where(places, REACHED, NOT_REACHED).astype(np.int8)
    return occupancy_grid(values, cell, first, frame, stamp)


def empty_area(frame: str, stamp: Any) -> OccupancyGrid:
    """Return the grid that is published where no area was searched: it has no places."""
    message = OccupancyGrid()
    message.header.frame_id, message.header.stamp = frame, stamp
    return message
