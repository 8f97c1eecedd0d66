# SPDX-License-Identifier: Apache-2.0
"""The ground that decides whether a rover can stand: how far it reaches from the body origin."""

import itertools
import math
from dataclasses import dataclass

from rover_physics.rover.model import Rover

MAX_ROLL = 1.0
"""Roll of a body that still stands [rad]; limits of tilt are far below it."""


@dataclass(frozen=True)
class Footprint:
    """A rectangle around the body origin that the rover never leaves, however it stands."""

    ahead: float
    """Largest distance along the heading, ahead and behind [m]."""
    aside: float
    """Largest distance across it [m]."""

    def half_sides(self, yaw: float) -> tuple[float, float]:
        """Return half the sides [m] along x and y of the box around the turned rectangle."""
        c, s = abs(math.cos(yaw)), abs(math.sin(yaw))
        return c * self.ahead + s * self.aside, s * self.ahead + c * self.aside


def find_footprint(rover: Rover) -> Footprint:
    """Return the footprint of a rover, whatever the angles of its suspension.

    A wheel is never further from its pivots than its links are long. A body that rolls by up to
    MAX_ROLL moves it sideways by that length times the sine.
    """
    suspension, wheel = rover.suspension, rover.wheel
    rocker, bogie = suspension.rocker_pivot, suspension.bogie_pivot
    ahead = aside = 0.0
    steep = math.sin(MAX_ROLL)
    for name, centre in suspension.wheels.items():
        chain = [(0.0, 0.0, 0.0), rocker, centre]
        if name != suspension.rocker_wheel:
            chain.insert(2, bogie)
        links = itertools.pairwise(chain)
        along = sum(math.hypot(b[0] - a[0], b[2] - a[2]) for a, b in links)
        across = abs(centre[1]) + 0.5 * wheel.width
        reach = along + wheel.radius
        ahead, aside = max(ahead, reach), max(aside, math.hypot(across, steep * reach))
    x, y, z = (max(map(abs, side)) for side in (rover.belly.x, rover.belly.y, (rover.belly.z,)))
    return Footprint(max(ahead, math.hypot(x, z)), max(aside, math.hypot(y, z)))
