# SPDX-License-Identifier: Apache-2.0
"""Friction of the ground where wheels have been, as layers of a map."""

from dataclasses import dataclass

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_physics.terrain.grid import Terrain
from rover_planner.learning.friction_filter import FrictionEstimate


@dataclass(frozen=True, eq=False)
class GroundLayers:
    """Layers (ny, nx) of a terrain; NaN where no wheel has been."""

    friction: Floats
    """Mean of the friction."""
    friction_std: Floats
    """Standard deviation of it."""


class GroundMap:
    """Writes what is learned below the wheels into layers of a terrain."""

    def __init__(self, terrain: Terrain, width: float):
        """Start with ground that no wheel of a width [m] has touched."""
        self._origin, self._resolution = np.array(terrain.origin), terrain.resolution
        shape = terrain.elevation.shape
        self.layers = GroundLayers(np.full(shape, np.nan), np.full(shape, np.nan))
        """The estimates; the last visit counts."""
        reach = max(round(0.5 * width / terrain.resolution), 0)
        steps = np.arange(-reach, reach + 1)
        self._around = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)

    def visit(self, places: Floats, estimate: FrictionEstimate) -> None:
        """Take wheels at places (n, 2) [m] and what they tell."""
        cells = np.rint((places - self._origin) / self._resolution).astype(int)
        cells = (cells[:, None, :] + self._around).reshape(-1, 2)
        rows, columns = self.layers.friction.shape
        inside = ((cells >= 0) & (cells < [columns, rows])).all(axis=1)
        at = cells[inside, 1], cells[inside, 0]
        self.layers.friction[at], self.layers.friction_std[at] = estimate.mean, estimate.std
