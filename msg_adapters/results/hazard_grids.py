# SPDX-License-Identifier: Apache-2.0
"""Writes traversability classes of cells as occupancy grids."""

from typing import Any

import numpy as np
from nav_msgs.msg import OccupancyGrid
from numpy.typing import NDArray

from msg_adapters.results.occupancy import occupancy_grid

VALUES = (0, 33, 66, 100)
"""Values of the classes 0 to 3: passable, with speed servos, with traction control, impassable."""
UNKNOWN = -1
"""Value of cells whose class, a negative number, is unknown."""
_TABLE = np.array([*VALUES, UNKNOWN], np.int8)


def classes_to_grid(
    classes: NDArray[np.int8], cell: float, first: tuple[float, float], frame: str, stamp: Any
) -> OccupancyGrid:
    """Return classes as an occupancy grid with VALUES and UNKNOWN.

    Args:
        classes: (ny, nx) class of each cell, row 0 at the smallest y; -1 is unknown.
        cell: Cell size [m].
        first: x, y of the centre of cell [0, 0] [m], map frame.
        frame: Frame of the map.
        stamp: builtin_interfaces/Time.
    """
    values = _TABLE[classes]  # -1 is the last of the table
    return occupancy_grid(values, cell, first, frame, stamp)
