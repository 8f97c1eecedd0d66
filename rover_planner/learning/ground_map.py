# SPDX-License-Identifier: Apache-2.0
"""Friction of the ground where wheels have been and of its classes, as layers of a map."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.arrays import Floats
from rover_physics.terrain.grid import Terrain
from rover_planner.learning.friction_filter import FrictionEstimate


class GroundMap:
    """Writes what is learned below the wheels into layers of a terrain."""

    def __init__(self, terrain: Terrain, width: float, told: float):
        """Start with ground that no wheel of a width [m] has touched, and its told friction."""
        self._classes, self._told = terrain.ground_class, told
        self._origin, self._resolution = np.array(terrain.origin), terrain.resolution
        self.visited = np.full((2, *terrain.elevation.shape), np.nan)
        """(2, ny, nx) mean and standard deviation of the friction where wheels have been, NaN
        elsewhere; the last visit counts. What nothing bounds is at most what was told or proved.
        """
        reach = max(round(0.5 * width / terrain.resolution), 0)
        steps = np.arange(-reach, reach + 1)
        self._around = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)

    def visit(self, places: Floats, estimate: FrictionEstimate) -> None:
        """Take wheels at places (n, 2) [m] and what they tell."""
        cells = (self._cells_at(places)[:, None, :] + self._around).reshape(-1, 2)
        rows, columns = self.visited.shape[1:]
        inside = ((cells >= 0) & (cells < [columns, rows])).all(axis=1)
        columns, rows = cells[inside].T
        friction = estimate.mean
        if estimate.high is None:
            friction = min(friction, max(self._told, estimate.low))
        self.visited[:, rows, columns] = [[friction], [estimate.std]]

    def classes_at(self, places: Floats) -> Floats:
        """Return the classes (n,) of the ground at places (n, 2) [m] on the map; NaN for none."""
        if self._classes is None:
            return np.full(len(places), np.nan)
        most = np.array(self._classes.shape[::-1]) - 1
        columns, rows = np.clip(self._cells_at(places), 0, most).T
        return np.asarray(self._classes[rows, columns])

    def spread(self, by_class: Mapping[int, FrictionEstimate]) -> Floats:
        """Return `visited` with the estimates of its class on other ground.

        A class on which no wheel slipped enough has none.
        """
        layers = self.visited.copy()
        for number, estimate in by_class.items():
            if estimate.high is not None and self._classes is not None:
                cells = (self._classes == number) & np.isnan(self.visited[0])
                layers[:, cells] = [[estimate.mean], [estimate.std]]
        return layers

    def _cells_at(self, places: Floats) -> NDArray[np.intp]:
        """Return columns and rows (n, 2) of the cells at places (n, 2) [m]."""
        return np.rint((places - self._origin) / self._resolution).astype(np.intp)
