# SPDX-License-Identifier: Apache-2.0
"""The frame in which the scene is drawn: the map frame with an origin near the ground."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.numerics.arrays import Floats
from rover_physics.terrain.grid import Terrain

MAX_PLAIN = 1000.0
"""Largest coordinate of the middle of the ground that is drawn as it is [m].

A browser draws with 32-bit floats: beyond this they are coarser than 0.06 mm, and at the
coordinates of a UTM map than 0.25 m.
"""
MAX_AWAY = 1000.0
"""Distance of the middle of another ground from the origin from which it gets its own [m]."""


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
        """Move the origin near a ground that is far from it; return whether it has moved.

        What was drawn before must then be drawn again.
        """
        middle = _find_middle(terrain)
        if np.abs(middle - self.origin).max() <= MAX_AWAY:
            return False
        self.origin = np.where(np.abs(middle) > MAX_PLAIN, np.round(middle), 0.0)
        return True


def _find_middle(terrain: Terrain) -> Floats:
    """Return the middle of a ground and its median height (3,) [m]."""
    x_low, x_high, y_low, y_high = terrain.bounds
    known = terrain.elevation[np.isfinite(terrain.elevation)]
    height = float(np.median(known)) if known.size else 0.0
    return np.array([0.5 * (x_low + x_high), 0.5 * (y_low + y_high), height])
