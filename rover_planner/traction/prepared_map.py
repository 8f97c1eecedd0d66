# SPDX-License-Identifier: Apache-2.0
"""A map that is prepared for the traction controller, so that updates are not delayed.

Preparing a map takes several milliseconds, longer than an update may take. A separate thread does
it (`ros/map_intake.py`), and the next update takes the result.
"""

from dataclasses import dataclass

from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traction.map_contacts import MapContactFinder


@dataclass(frozen=True, eq=False)
class PreparedMap:
    """A map and the finder of contact angles on it."""

    rover: Rover
    """The rover for which the map was prepared."""
    terrain: Terrain
    """The map."""
    finder: MapContactFinder
    """Finds the contact angles of that rover on the map."""


def prepare_map(rover: Rover, terrain: Terrain) -> PreparedMap:
    """Prepare a map for a rover; takes several milliseconds."""
    return PreparedMap(rover, terrain, MapContactFinder(rover, terrain))
