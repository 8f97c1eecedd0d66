"""A map with everything that the traction controller needs of it, so that an update need not wait.

Preparing a map takes some milliseconds, longer than an update may. So a thread of its own prepares
it (`ros/map_intake.py`), and the next update takes it over.
"""

from dataclasses import dataclass

from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traction.map_contacts import MapContactFinder


@dataclass(frozen=True, eq=False)
class PreparedMap:
    """A map, and what finds contact angles on it."""

    rover: Rover
    """The rover that it was prepared for."""
    terrain: Terrain
    """The map."""
    finder: MapContactFinder
    """Finds the contact angles of that rover on the map."""


def prepare_map(rover: Rover, terrain: Terrain) -> PreparedMap:
    """Prepare a map for a rover; that takes some milliseconds."""
    return PreparedMap(rover, terrain, MapContactFinder(rover, terrain))
