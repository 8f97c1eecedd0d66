# SPDX-License-Identifier: Apache-2.0
"""The grid of square cells that all parts of a living map share, and rectangles of its cells."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_physics.terrain.grid import Terrain

SAME_PLACE = 1e-6
"""Distance from the centre of a cell at which its height alone counts [cells]."""


@dataclass(frozen=True)
class CellGrid:
    """An endless grid of square cells along x and y."""

    anchor: tuple[float, float]
    """Centre (x, y) of cell [0, 0] [m], map frame."""
    resolution: float
    """Cell size [m]."""

    def coordinates(self, x: Any, y: Any) -> tuple[Any, Any]:
        """Return fractional column and row of points [m]."""
        return (x - self.anchor[0]) / self.resolution, (y - self.anchor[1]) / self.resolution

    def places(self, columns: Any, rows: Any) -> tuple[Any, Any]:
        """Return x and y of the centres of cells [m]; their numbers may be fractions."""
        x, y = self.anchor
        return x + self.resolution * columns, y + self.resolution * rows

    def centres_of(self, box: "CellBox") -> tuple[Any, Any]:
        """Return x (columns,) and y (rows, 1) of the centres of a box of cells [m]."""
        rows = (box.row + np.arange(box.rows))[:, None]
        return self.places(box.column + np.arange(box.columns), rows)

    def box_around(self, middle: Floats, half: Floats, yaw: float = 0.0) -> "CellBox":
        """Return the cells with their centres in the upright rectangle around a turned one.

        Args:
            middle: (2,) middle of the turned rectangle [m].
            half: (2,) half of its length and width [m].
            yaw: Angle of its length from x [rad].
        """
        cosine, sine = math.cos(yaw), math.sin(yaw)
        reach = np.abs([[cosine, sine], [sine, cosine]]) @ half
        column, row = (math.ceil(one - SAME_PLACE) for one in self.coordinates(*(middle - reach)))
        last = [math.floor(one + SAME_PLACE) for one in self.coordinates(*(middle + reach))]
        return CellBox.between((row, column), (last[1] + 1, last[0] + 1))


def grid_of(terrain: Terrain) -> CellGrid:
    """Return the grid of which the cells of a terrain are a part."""
    return CellGrid(terrain.origin, terrain.resolution)


@dataclass(frozen=True)
class CellBox:
    """A rectangle of cells of a grid."""

    row: int
    """First row."""
    column: int
    """First column."""
    rows: int
    """Number of rows."""
    columns: int
    """Number of columns."""

    @staticmethod
    def between(low: tuple[int, int], high: tuple[int, int]) -> "CellBox":
        """Return the box from a row and column up to others, which it has not any more."""
        return CellBox(*low, max(high[0] - low[0], 0), max(high[1] - low[1], 0))

    @property
    def end(self) -> tuple[int, int]:
        """Row and column after the last ones."""
        return self.row + self.rows, self.column + self.columns

    @property
    def cells(self) -> int:
        """Number of cells."""
        return self.rows * self.columns

    def contains(self, other: "CellBox") -> bool:
        """Return whether another box lies within this one."""
        return self.union(other) == self

    def union(self, other: "CellBox") -> "CellBox":
        """Return the smallest box around both."""
        low = min(self.row, other.row), min(self.column, other.column)
        high = max(self.end[0], other.end[0]), max(self.end[1], other.end[1])
        return CellBox.between(low, high)

    def cut(self, other: "CellBox") -> "CellBox":
        """Return the part of this box that lies in another one; it may have no cells."""
        rows, columns = other.within(self)
        low = self.row + rows.start, self.column + columns.start
        return CellBox.between(low, (self.row + rows.stop, self.column + columns.stop))

    def within(self, other: "CellBox") -> tuple[slice, slice]:
        """Return the rows and columns of `other` that this box covers; both may be empty."""
        rows = _overlap(self.row - other.row, self.rows, other.rows)
        return rows, _overlap(self.column - other.column, self.columns, other.columns)


def _overlap(start: int, count: int, length: int) -> slice:
    low = min(max(start, 0), length)
    return slice(low, max(min(start + count, length), low))
