# SPDX-License-Identifier: Apache-2.0
"""The ground as it is drawn: the corners of a mesh, and the pixels of the picture on it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import ndimage

from rover_physics.numerics.arrays import Floats
from rover_physics.terrain.grid import Terrain

MAX_CELLS = 250
"""Most cells along a side of the mesh; of more, every second, third, ... is drawn."""
MAX_PIXELS, MOST_IN_CELL = 1200, 8
"""Most pixels along a side of the picture, and of a cell of the mesh."""


@dataclass(frozen=True, eq=False)
class GroundGrid:
    """Heights at some cells of a map, and between them; map frame."""

    x: Floats
    """(nx,) of the cells [m]."""
    y: Floats
    """(ny,) of the cells [m]."""
    heights: Floats
    """(ny, nx) of the cells [m], NaN where unknown."""

    @property
    def factor(self) -> int:
        """Number of pixels along a side of a cell."""
        return max(1, min(MOST_IN_CELL, MAX_PIXELS // max(self.heights.shape)))

    @cached_property
    def pixels(self) -> tuple[Floats, Floats]:
        """X (mx,) and y (my,) [m] of the pixels."""
        x, y = (
            at[0]
            + (at[1] - at[0]) * ((np.arange(self.factor * len(at)) + 0.5) / self.factor - 0.5)
            for at in (self.x, self.y)
        )
        return x, y

    @cached_property
    def fine_heights(self) -> Floats:
        """(my, mx) of the pixels [m], NaN next to unknown cells."""
        return np.asarray(
            ndimage.zoom(self.heights, self.factor, order=1, mode="nearest", grid_mode=True)
        )

    @cached_property
    def slopes(self) -> tuple[Floats, Floats]:
        """Rises (my, mx) of the pixels along x and along y."""
        x, y = self.pixels
        heights = self.fine_heights
        return np.gradient(heights, x, axis=1), np.gradient(heights, y, axis=0)


def make_grid(terrain: Terrain) -> GroundGrid:
    """Return at most MAX_CELLS cells a side of a ground."""
    stride = -(-max(terrain.elevation.shape) // MAX_CELLS)
    heights = terrain.elevation[::stride, ::stride]
    step, (x, y), (ny, nx) = stride * terrain.resolution, terrain.origin, heights.shape
    return GroundGrid(x + step * np.arange(nx), y + step * np.arange(ny), heights)
