# SPDX-License-Identifier: Apache-2.0
"""Tells whether any marked cell of a map is near a place, by one look at sums over the map."""

import numpy as np
from numpy.typing import NDArray

from rover_physics.terrain.grid import Terrain


class CellCounts:
    """Numbers of marked cells of a map, to tell whether any is near a place."""

    def __init__(self, terrain: Terrain, marked: NDArray[np.bool_]):
        self._terrain, self._any = terrain, bool(marked.any())
        ny, nx = marked.shape
        self._before = np.zeros((ny + 1, nx + 1), np.int32)
        if self._any:
            np.cumsum(marked, axis=0, out=self._before[1:, 1:])
            np.cumsum(self._before, axis=1, out=self._before)

    def are_near(self, places: NDArray[np.float64], reach: float) -> NDArray[np.bool_]:
        """Return (n,) whether a marked cell is within `reach` [m] of places (n, 2) in x or y."""
        if not self._any:
            return np.zeros(len(places), bool)
        cells = (places - self._terrain.origin) / self._terrain.resolution
        size, far = np.array(self._terrain.elevation.shape[::-1]), reach / self._terrain.resolution
        x, y = np.clip(np.floor(cells - far), 0, size).astype(int).T
        right, up = np.clip(np.ceil(cells + far) + 1, 0, size).astype(int).T
        before = self._before
        return (before[up, right] - before[y, right] - before[up, x] + before[y, x]) > 0
