# SPDX-License-Identifier: Apache-2.0
"""Layers of a rectangle of cells: grown, moved, written, laid onto other cells, and compared."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msg_adapters.gridding import most_frequent
from rover_physics.numerics.arrays import Floats
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.layers import GRID_LAYERS, GridLayer
from rover_planner.maps.cells import SAME_PLACE, CellBox, CellGrid, grid_of

MAX_OFF_CENTRE = 0.02
"""Largest distance between the centres of a map's cells and those of the grid at which the map
is taken without interpolation [cells]."""
MAX_FINER = 0.5
"""Size of a map's cells relative to the grid's below which several of them share a cell."""
UNKNOWN, LOADED, CONTACT, FOOTPRINT = range(4)
"""Sources of cells: none, a loaded map, a wheel that stands there, and the ground assumed between
and around the wheels. Higher numbers are topics."""
FIRST_NAMES = ("unknown", "loaded", "contact", "footprint")
"""Their names."""


LAYERS = GRID_LAYERS | {
    "source": GridLayer(np.uint8, UNKNOWN),
    "time": GridLayer(np.float64, -np.inf),
}
"""The layers of a map, source and time of each cell."""
ALWAYS = ("elevation", "source", "time")
"""Layers that every window has."""
LASTING = tuple(name for name, layer in GRID_LAYERS.items() if layer.is_lasting)
"""Layers whose values stay where a newer map has none."""

Layer = NDArray[Any]
Window = tuple[slice, slice]
"""Rows and columns of a map."""
Shift = tuple[int, int]
"""Rows and columns from cell [0, 0] of a map to that of the next one."""


@dataclass(frozen=True, eq=False)
class CellSources:
    """Source and time of each cell of a map."""

    source: NDArray[np.uint8]
    """(ny, nx) indices into `names`."""
    time: NDArray[np.float64]
    """(ny, nx) stamp of the map or measurement [s, ROS time]; -inf where unknown."""
    names: tuple[str, ...] = FIRST_NAMES
    """Names of the sources: FIRST_NAMES, then topics."""

    def count(self) -> dict[str, int]:
        """Return the number of cells of each source, by name."""
        counts = np.bincount(self.source.ravel(), minlength=len(self.names))
        return dict(zip(self.names, counts.tolist(), strict=True))


@dataclass(frozen=True, eq=False)
class Patch:
    """Layers of a box of cells. The arrays are never written to: changes make a new patch."""

    box: CellBox
    """The cells."""
    layers: dict[str, Layer]
    """(rows, columns) by name: elevation and others of LAYERS; those of a window have ALWAYS."""

    def moved_to(self, box: CellBox) -> "Patch":
        """Return the layers over another box; cells that this one lacks are empty."""
        moved = empty_patch(box, tuple(self.layers))
        to, source = self.box.within(box), box.within(self.box)
        for name, layer in self.layers.items():
            moved.layers[name][to] = layer[source]
        return moved

    def with_layers(self, names: tuple[str, ...]) -> "Patch":
        """Return a patch that has these layers too; heights that were exact stay so."""
        missing = tuple(name for name in names if name not in self.layers)
        if not missing:
            return self
        layers = self.layers | empty_patch(self.box, missing).layers
        if "elevation_std" in missing:
            layers["elevation_std"] = np.where(np.isnan(layers["elevation"]), np.nan, 0.0)
        return replace(self, layers=layers)

    def written(self, patch: "Patch", take: Layer, source: int, time: float) -> "Patch":
        """Return a patch in which another one replaces some cells.

        Friction, soil and class that the other one does not have stay.

        Args:
            patch: The new values, of any box.
            take: (rows, columns) of the part of `patch` within this one: True for the cells
                that it replaces.
            source: Their new source.
            time: Their new time [s].
        """
        names = tuple(patch.layers)
        old = self.with_layers(names)
        to, own = patch.box.within(old.box), old.box.within(patch.box)
        layers = {name: layer.copy() for name, layer in old.layers.items()}
        values: dict[str, Any] = {"source": source, "time": time, "elevation_std": 0.0}
        values |= {name: patch.layers[name][own][take] for name in names}
        for name in LASTING:
            if name in names:
                new, kept = values[name], layers[name][to][take]
                values[name] = np.where(np.isfinite(new), new, kept)
        for name in values.keys() & layers.keys():
            layers[name][to][take] = values[name]
        return replace(old, layers=layers)


def empty_patch(box: CellBox, names: tuple[str, ...] = ALWAYS) -> Patch:
    """Return a patch without known cells."""
    shape = box.rows, box.columns
    layers: dict[str, Layer] = {
        name: np.full(shape, LAYERS[name].unknown, LAYERS[name].kind) for name in names
    }
    return Patch(box, layers)


def box_on(terrain: Terrain, grid: CellGrid) -> CellBox:
    """Return the cells of a grid onto which `lay_onto` lays a map."""
    if _is_on(terrain, grid) or _is_finer(terrain, grid):
        rows, columns = _cells_of(terrain, grid)
        low, high = (int(rows[0]), int(columns[0])), (int(rows[-1]) + 1, int(columns[-1]) + 1)
        return CellBox.between(low, high)
    x0, x1, y0, y1 = terrain.bounds
    return grid.box_around(np.array([x0 + x1, y0 + y1]) / 2.0, np.array([x1 - x0, y1 - y0]) / 2.0)


def lay_onto(terrain: Terrain, grid: CellGrid, within: CellBox | None = None) -> Patch:
    """Lay a map onto the cells of a grid.

    A map whose cells are those of the grid keeps its values to the bit. One with cells of about
    the same size or larger is interpolated bilinearly; a cell is then unknown if one of the four
    around it is. Of several finer cells in one cell, the highest height, the largest standard
    deviation, the lowest friction and the most frequent class count.

    Args:
        terrain: The map.
        grid: The grid.
        within: Cells that are wanted; others are left out where they would be interpolated, as
            they may be many times those of the map.
    """
    box = box_on(terrain, grid)
    if _is_on(terrain, grid):
        return Patch(box, layers_of(terrain))
    if _is_finer(terrain, grid):
        return _combine(terrain, grid, box)
    box = box if within is None else box.cut(within)
    places = grid_of(terrain).coordinates(*grid.centres_of(box))
    return Patch(box, sample_layers(terrain, *places))


def _is_on(terrain: Terrain, grid: CellGrid) -> bool:
    """Return whether the cells of a map are those of a grid."""
    off = [abs(value - round(value)) for value in grid.coordinates(*terrain.origin)]
    drift = abs(terrain.resolution / grid.resolution - 1.0) * max(terrain.elevation.shape)
    return max(off) + drift <= MAX_OFF_CENTRE


def _is_finer(terrain: Terrain, grid: CellGrid) -> bool:
    """Return whether several cells of a map share one of a grid."""
    return terrain.resolution / grid.resolution < MAX_FINER


def _cells_of(terrain: Terrain, grid: CellGrid) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the rows (ny,) and columns (nx,) of a grid in which the cells of a map are."""
    ny, nx = terrain.elevation.shape
    columns, rows = grid.coordinates(*grid_of(terrain).places(np.arange(nx), np.arange(ny)))
    return np.rint(rows).astype(np.intp), np.rint(columns).astype(np.intp)


def layers_of(terrain: Terrain) -> dict[str, Layer]:
    """Return the layers that a terrain has, by name."""
    layers = {name: getattr(terrain, name) for name in GRID_LAYERS}
    return {name: layer for name, layer in layers.items() if layer is not None}


def sample_layers(terrain: Terrain, column: Floats, row: Floats) -> dict[str, Layer]:
    """Return the layers of a map at fractional columns and rows.

    Heights and deviations are interpolated bilinearly, others are those of the nearest cell. They
    are unknown off the map, and where a cell that counts is unknown.
    """
    ny, nx = terrain.elevation.shape
    below, above, up, on_rows = _bracket(row, ny)
    left, right, along, on_columns = _bracket(column, nx)
    layers: dict[str, Layer] = {}
    for name, layer in layers_of(terrain).items():
        if GRID_LAYERS[name].is_smooth:
            found = np.zeros(np.broadcast_shapes(below.shape, left.shape))
            for j, of_row in ((below, 1.0 - up), (above, up)):
                for i, of_column in ((left, 1.0 - along), (right, along)):
                    share = of_row * of_column
                    found += np.where(share == 0.0, 0.0, share * layer[j, i])
        else:
            found = layer[np.where(up < 0.5, below, above), np.where(along < 0.5, left, right)]
        known = np.where(on_rows & on_columns, found, GRID_LAYERS[name].unknown)
        layers[name] = known.astype(GRID_LAYERS[name].kind)
    return layers


def _bracket(
    place: Floats, count: int
) -> tuple[NDArray[np.intp], NDArray[np.intp], Floats, NDArray[np.bool_]]:
    """Return the lower and upper cell around fractional indices, of `count` cells.

    The third is how far they are beyond the lower one, 0 to 1, the last whether they are on the
    map.
    """
    whole = np.rint(place)
    place = np.where(np.abs(place - whole) <= SAME_PLACE, whole, place)
    inside = (place >= 0.0) & (place <= count - 1)
    first = np.clip(np.floor(place), 0, max(count - 2, 0)).astype(np.intp)
    return first, np.minimum(first + 1, count - 1), place - first, inside


def _combine(terrain: Terrain, grid: CellGrid, box: CellBox) -> Patch:
    rows, columns = _cells_of(terrain, grid)
    at = (rows - box.row)[:, None], (columns - box.column)[None, :]
    combined = empty_patch(box, tuple(layers_of(terrain)))
    for name, layer in layers_of(terrain).items():
        into, row = combined.layers[name], GRID_LAYERS[name]
        if row.is_class:
            cells = np.ravel_multi_index(np.broadcast_arrays(*at), into.shape)
            found = most_frequent(cells.ravel(), layer.ravel(), box.cells)
            into[:] = found.reshape(into.shape)
        else:
            (np.fmin if row.combined == "min" else np.fmax).at(into, at, layer)
    return combined


def have_same_layers(old: Terrain, new: Terrain) -> bool:
    """Return whether two maps have the same layers, and the same soils in them."""
    return old.soil_names == new.soil_names and all(
        (getattr(old, name) is None) == (getattr(new, name) is None) for name in GRID_LAYERS
    )


def find_overlap(old: Terrain, new: Terrain, shift: Shift) -> tuple[Window, Window]:
    """Return the cells that two maps have in common, as those of the old and of the new map."""
    before = CellBox(0, 0, *old.elevation.shape)
    now = CellBox(*shift, *new.elevation.shape)
    return now.within(before), before.within(now)


def find_changes(old: Terrain, new: Terrain, shift: Shift = (0, 0)) -> NDArray[np.bool_]:
    """Return where a map differs from the one before.

    Args:
        old: The map before.
        new: The map, with the same layers.
        shift: Rows and columns from cell [0, 0] of the old map to that of the new one.

    Returns:
        (ny + 2, nx + 2) True for cells that are new or differ, with one more cell at each side,
        which is True if the map's edge has moved.
    """
    ny, nx = new.elevation.shape
    changed = np.ones((ny + 2, nx + 2), bool)
    if shift == (0, 0) and old.elevation.shape == new.elevation.shape:
        changed[:] = False
    before, now = find_overlap(old, new, shift)
    inside = changed[1:-1, 1:-1]
    inside[now] = False
    for name in GRID_LAYERS:
        one, other = getattr(old, name), getattr(new, name)
        if one is not None:
            a, b = one[before], other[now]
            inside[now] |= ~((a == b) | ((a != a) & (b != b)))
    return changed
