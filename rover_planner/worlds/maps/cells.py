# SPDX-License-Identifier: Apache-2.0
"""The grid of square cells that all parts of a living map share, and maps laid onto it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.terrain.grid import Terrain

MAX_OFF_CENTRE = 0.02
"""Largest distance between the centres of a map's cells and those of the grid at which the map
is taken without interpolation [cells]."""
MAX_FINER = 0.5
"""Size of a map's cells relative to the grid's below which several of them share a cell."""

Layer = NDArray[Any]


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

    @property
    def cells(self) -> int:
        """Number of cells."""
        return self.rows * self.columns

    def contains(self, other: "CellBox") -> bool:
        """Return whether another box lies within this one."""
        return self.union(other) == self

    def union(self, other: "CellBox") -> "CellBox":
        """Return the smallest box around both."""
        row, column = min(self.row, other.row), min(self.column, other.column)
        end_row = max(self.row + self.rows, other.row + other.rows)
        end_column = max(self.column + self.columns, other.column + other.columns)
        return CellBox(row, column, end_row - row, end_column - column)

    def cut(self, other: "CellBox") -> "CellBox":
        """Return the part of this box that lies in another one; it may have no cells."""
        rows, columns = other.within(self)
        row, column = self.row + rows.start, self.column + columns.start
        return CellBox(row, column, rows.stop - rows.start, columns.stop - columns.start)

    def within(self, other: "CellBox") -> tuple[slice, slice]:
        """Return the rows and columns of `other` that this box covers; both may be empty."""
        rows = _overlap(self.row - other.row, self.rows, other.rows)
        return rows, _overlap(self.column - other.column, self.columns, other.columns)


def _overlap(start: int, count: int, length: int) -> slice:
    low = min(max(start, 0), length)
    return slice(low, max(min(start + count, length), low))


@dataclass(frozen=True, eq=False)
class Patch:
    """Layers of some cells of a grid."""

    box: CellBox
    """The cells."""
    layers: dict[str, Layer]
    """Layers (rows, columns): elevation, and elevation_std, friction and soil if there are."""


_Lay = Callable[[Terrain, CellGrid, CellBox], Patch]
"""Lays a map onto the cells of a box."""


def grid_of(terrain: Terrain) -> CellGrid:
    """Return the grid of which the cells of a terrain are a part."""
    return CellGrid(terrain.origin, terrain.resolution)


def box_on(terrain: Terrain, grid: CellGrid) -> CellBox:
    """Return the cells of a grid onto which `lay_onto` lays a map."""
    return _place_on(terrain, grid)[1]


def lay_onto(terrain: Terrain, grid: CellGrid, within: CellBox | None = None) -> Patch:
    """Lay a map onto the cells of a grid.

    A map whose cells are those of the grid keeps its values to the bit. One with cells of about
    the same size or larger is interpolated bilinearly; a cell is then unknown if one of the four
    around it is. Of several finer cells in one cell, the highest height, the largest standard
    deviation and the lowest friction count.

    Args:
        terrain: The map.
        grid: The grid.
        within: Cells that are wanted; others are left out where they would be interpolated, as
            they may be many times those of the map.
    """
    lays, box = _place_on(terrain, grid)
    return lays(
        terrain, grid, box if within is None or lays is not _interpolate else box.cut(within)
    )


def _place_on(terrain: Terrain, grid: CellGrid) -> tuple[_Lay, CellBox]:
    """Return how a map is laid onto a grid, and the cells that it takes there."""
    column, row = grid.coordinates(*terrain.origin)
    ny, nx = terrain.elevation.shape
    ratio = terrain.resolution / grid.resolution
    first = round(row), round(column)
    drift = abs(ratio - 1.0) * max(ny, nx)
    if max(abs(row - first[0]), abs(column - first[1])) + drift <= MAX_OFF_CENTRE:
        return _copy, CellBox(*first, ny, nx)
    if ratio < MAX_FINER:
        rows, columns = _cells_of(terrain, grid)
        low, high = (int(rows[0]), int(columns[0])), (int(rows[-1]), int(columns[-1]))
        return _combine, CellBox(*low, high[0] - low[0] + 1, high[1] - low[1] + 1)
    ends = row + (ny - 1) * ratio, column + (nx - 1) * ratio
    low = int(np.ceil(row - 1e-6)), int(np.ceil(column - 1e-6))
    counts = [
        max(int(np.floor(end + 1e-6)) - start + 1, 0) for end, start in zip(ends, low, strict=True)
    ]
    return _interpolate, CellBox(*low, *counts)


def _cells_of(terrain: Terrain, grid: CellGrid) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the rows (ny,) and columns (nx,) of a grid in which the cells of a map are."""
    ny, nx = terrain.elevation.shape
    columns, rows = grid.coordinates(
        terrain.origin[0] + terrain.resolution * np.arange(nx),
        terrain.origin[1] + terrain.resolution * np.arange(ny),
    )
    return np.rint(rows).astype(np.intp), np.rint(columns).astype(np.intp)


def _layers_of(terrain: Terrain) -> dict[str, Layer]:
    names = ("elevation", "elevation_std", "friction", "soil")
    layers = {name: getattr(terrain, name) for name in names}
    return {name: layer for name, layer in layers.items() if layer is not None}


def _copy(terrain: Terrain, grid: CellGrid, box: CellBox) -> Patch:
    return Patch(box, _layers_of(terrain))


def _interpolate(terrain: Terrain, grid: CellGrid, box: CellBox) -> Patch:
    x = grid.anchor[0] + grid.resolution * (box.column + np.arange(box.columns))
    y = grid.anchor[1] + grid.resolution * (box.row + np.arange(box.rows))[:, None]
    bounds = terrain.bounds
    x, y = np.clip(x, *bounds[:2]), np.clip(y, *bounds[2:])
    layers: dict[str, Layer] = {"elevation": terrain.elevation_at(x, y)}
    if terrain.elevation_std is not None:
        std = replace(terrain, elevation=terrain.elevation_std, elevation_std=None)
        layers["elevation_std"] = np.asarray(std.elevation_at(x, y))
    j = np.rint((x - terrain.origin[0]) / terrain.resolution).astype(np.intp)
    i = np.rint((y - terrain.origin[1]) / terrain.resolution).astype(np.intp)
    for name in ("friction", "soil"):
        layer = getattr(terrain, name)
        if layer is not None:
            layers[name] = layer[i, j]
    return Patch(box, layers)


def _combine(terrain: Terrain, grid: CellGrid, box: CellBox) -> Patch:
    rows, columns = _cells_of(terrain, grid)
    at = (rows - box.row)[:, None], (columns - box.column)[None, :]
    layers: dict[str, Layer] = {}
    for name, layer in _layers_of(terrain).items():
        if name == "soil":
            combined = np.full((box.rows, box.columns), -1, np.int32)
            np.maximum.at(combined, at, layer)
        else:
            combined = np.full((box.rows, box.columns), np.nan)
            (np.fmin if name == "friction" else np.fmax).at(combined, at, layer)
        layers[name] = combined
    return Patch(box, layers)
