# SPDX-License-Identifier: Apache-2.0
"""A question for a way between two poses."""

from dataclasses import dataclass

from numpy.typing import ArrayLike

from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.planning.lattice.blind_check import BlindCheck
from rover_planner.planning.path_query import PathQueryOptions


@dataclass(frozen=True, eq=False)
class WayQuestion:
    """A question for a way."""

    rover: Rover
    """The rover."""
    terrain: Terrain
    """The ground, map frame."""
    start: ArrayLike
    """(3,) x, y [m] and yaw [rad] of the body origin, map frame."""
    goal: ArrayLike
    """(3,) as `start`."""
    options: PathQueryOptions
    """How paths are judged."""
    blind: BlindCheck | None = None
    """Refuses ground under the belly that was never seen; None allows it."""
