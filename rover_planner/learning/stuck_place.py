# SPDX-License-Identifier: Apache-2.0
"""The place that a rover that is stuck cannot pass: ahead of it, with the reason and the date."""

from datetime import UTC, datetime

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_planner.learning.drive_log import TIME, YAW, X, Y
from rover_planner.planning.marked_places import MarkedPlace


def find_place_ahead(rover: Rover, row: Floats, rolling: float, reason: str) -> MarkedPlace:
    """Return a disc of half a wheelbase, whose rim the body's origin has reached.

    Args:
        rover: The rover.
        row: What was measured last, as in `drive_log`; its time is that of the epoch.
        rolling: Speed at which the wheels roll; below 0 the disc is behind the rover.
        reason: Why it is stuck.
    """
    radius = 0.5 * rover.wheelbase
    ahead = np.copysign(radius, rolling)
    x = float(row[X] + ahead * np.cos(row[YAW]))
    y = float(row[Y] + ahead * np.sin(row[YAW]))
    date = datetime.fromtimestamp(float(row[TIME]), UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    return MarkedPlace(round(x, 3), round(y, 3), round(radius, 3), f"{reason} there", date)
