# SPDX-License-Identifier: Apache-2.0
"""The frame in which the scene is drawn: the map frame with an origin near the ground."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.numerics.arrays import Floats
from rover_physics.terrain.grid import Terrain

STEP = 1000.0
"""Distance of the origins to choose from, the first of which is that of the map frame [m].

A browser draws with 32-bit floats: at 1 km they are coarser than 0.06 mm, and at the coordinates
of a UTM map than 0.25 m.
"""


@dataclass
class LocalFrame:
    """Turns points of the map frame into points of the scene and back.

    Everything that is drawn goes through `to_scene`; rays and cameras of visitors come back
    through `to_map`. Directions and sizes are the same in both.
    """

    origin: Floats = field(default_factory=lambda: np.zeros(3))
    """(3,) origin of the scene [m], map frame."""

    def to_scene(self, points: ArrayLike) -> Floats:
        """Return points (..., 3) of the map frame in the scene [m]."""
        return np.asarray(points, dtype=float) - self.origin

    def to_map(self, points: ArrayLike) -> Floats:
        """Return points (..., 3) of the scene in the map frame [m]."""
        return np.asarray(points, dtype=float) + self.origin

    def move_to(self, terrain: Terrain) -> bool:
        """Move the origin near a ground and its median height; return whether it has moved.

        What was drawn before must then be drawn again.
        """
        x_low, x_high, y_low, y_high = terrain.bounds
        known = terrain.elevation[np.isfinite(terrain.elevation)]
        height = float(np.median(known)) if known.size else 0.0
        middle = np.array([0.5 * (x_low + x_high), 0.5 * (y_low + y_high), height])
        before, self.origin = self.origin, STEP * np.round(middle / STEP)
        return not np.array_equal(self.origin, before)
