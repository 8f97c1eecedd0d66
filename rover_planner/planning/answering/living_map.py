# SPDX-License-Identifier: Apache-2.0
"""A map that lives: local maps merge into a loaded one cell by cell, in a window.

The window grows with what is seen, or rolls with the rover. Heights that a newer map does not have
stay. Each cell knows its source and its time.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_physics.numerics.arrays import seal_array
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.layers import GRID_LAYERS
from rover_planner.errors import PlanningError
from rover_planner.maps.cells import CellBox, CellGrid, grid_of
from rover_planner.maps.layers import (
    CONTACT,
    FIRST_NAMES,
    FOOTPRINT,
    LASTING,
    LOADED,
    UNKNOWN,
    CellSources,
    Layer,
    Patch,
    box_on,
    empty_patch,
    lay_onto,
)
from rover_planner.parameters.traverse_server import NEWEST, TraverseServerParameters

GROWTH = 32
"""Cells by which a window grows at least, so that it does not grow with each map."""
ROLL = 8
"""A window of n cells rolls when the rover is n / ROLL cells from its middle."""
NEAR = 8
"""A rover is far from a map if a window around both has more than NEAR times their cells."""
FINER = 0.75
"""Relative cell size from which a first local map replaces the cells of a loaded map."""


@dataclass(frozen=True, eq=False)
class MapSnapshot:
    """A living map at one time."""

    terrain: Terrain
    """The ground."""
    sources: CellSources
    """Source and time of its cells."""


class LivingMap:
    """Merges maps; each change makes new arrays, so earlier snapshots stay as they are."""

    def __init__(self, values: TraverseServerParameters | None = None):
        self.values = values or TraverseServerParameters()
        """Parameters by which maps merge from now on."""
        self._names = list(FIRST_NAMES)
        self._last: dict[str, float] = {}
        self._rolls = False
        self.loaded: Terrain | None = None
        """The loaded map; None without one."""
        self._loaded_time = 0.0
        self.grid: CellGrid | None = None
        """The cells; None before the first map."""
        self._window: Patch | None = None
        self._whole: Terrain | None = None

    def load(self, terrain: Terrain, time: float) -> None:
        """Start over with a loaded map; time [s] is that of its loading."""
        self._clear(terrain)
        self.loaded, self._loaded_time = terrain, time
        patch = lay_onto(terrain, grid_of(terrain))
        self._window = self._with_loaded(empty_patch(patch.box))
        self._whole = terrain if self._std_to_add() == 0.0 else None

    def replace(self, terrain: Terrain, source: str, time: float) -> None:
        """Start over with a local map alone, whose layers are not copied."""
        self._clear(terrain)
        patch = lay_onto(terrain, grid_of(terrain))
        cells, known = empty_patch(patch.box, ("source", "time")), np.isfinite(terrain.elevation)
        cells.layers["source"][known] = self._index_of(source)
        cells.layers["time"][known] = time
        self._window = Patch(patch.box, cells.layers | patch.layers)
        self._last[source] = time
        self._whole = terrain

    def merge(
        self, terrain: Terrain, source: str, time: float, centre: tuple[float, float] | None = None
    ) -> None:
        """Merge a local map.

        Args:
            terrain: The map, in the frame of the others.
            source: Its topic.
            time: Its stamp [s]. A source whose stamps go back has a new clock, and no cell counts
                as newer than it then.
            centre: Place x, y [m] of the rover, for a rolling window; None: the middle of the map.

        Raises:
            PlanningError: The window would be too large; all stays as it was.
        """
        before = self.grid, self._window, self._rolls
        try:
            window, patch = self._lay(terrain, centre)
        except PlanningError:
            self.grid, self._window, self._rolls = before
            raise
        if time < self._last.get(source, time):
            layers = window.layers | {"time": np.minimum(window.layers["time"], time)}
            window = Patch(window.box, layers)
        self._last[source] = time
        take = self._wins(window, patch, time)
        self._window = window.written(patch, take, self._index_of(source), time)
        self._whole = None

    def _lay(self, terrain: Terrain, centre: tuple[float, float] | None) -> tuple[Patch, Patch]:
        """Return a window with room for a local map, and the map on its cells."""
        grid = self.grid_for(terrain)
        if grid is None:
            grid = grid_of(terrain)
            self.grid, self._window = grid, None
        self._rolls = self.values.map_window > 0.0
        if centre is None:
            x0, x1, y0, y1 = terrain.bounds
            centre = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
        window = self._room_for(box_on(terrain, grid), centre)
        return window, lay_onto(terrain, grid, window.box)

    def fill(self, patch: Patch, is_contact: Layer, time: float) -> bool:
        """Fill cells under the rover; return whether any changed.

        Unknown cells take the heights of the patch. Cells that were only assumed give way to
        contacts.

        Args:
            patch: Heights on `grid`, NaN where nothing is to be filled. A layer elevation_std
                is used if the map has one.
            is_contact: (rows, columns) of the patch: True where a wheel stands.
            time: Time of the measurement [s].
        """
        if self._window is None or not self._is_near(patch.box, self._window.box):
            return False
        window = self._room_for(patch.box, self._centre_of(patch.box))
        to, own = patch.box.within(window.box), window.box.within(patch.box)
        known = np.isfinite(patch.layers["elevation"][own])
        old, contact = window.layers["source"][to], is_contact[own]
        beneath = known & contact & ((old == UNKNOWN) | (old == FOOTPRINT))
        around = known & ~contact & (old == UNKNOWN)
        if not (beneath.any() or around.any()):
            return False
        if "elevation_std" not in window.layers:
            layers = {k: v for k, v in patch.layers.items() if k != "elevation_std"}
            patch = Patch(patch.box, layers)
        for take, source in ((beneath, CONTACT), (around, FOOTPRINT)):
            window = window.written(patch, take, source, time)
        self._window, self._whole = window, None
        return True

    def snapshot(self) -> MapSnapshot | None:
        """Return the map as it is now; None before the first one.

        Raises:
            TerrainError: No cell of the window is known.
        """
        if self._window is None or self.grid is None:
            return None
        box, layers = self._window.box, self._window.layers
        for layer in layers.values():
            seal_array(layer)
        if self._whole is None:
            grids: dict[str, Any] = {name: layers[name] for name in GRID_LAYERS if name in layers}
            if self.loaded is not None and "soil" in layers:
                grids["soil_names"] = self.loaded.soil_names
            origin = self.grid.places(box.column, box.row)
            self._whole = Terrain(**grids, resolution=self.grid.resolution, origin=origin)
        sources = CellSources(layers["source"], layers["time"], tuple(self._names))
        return MapSnapshot(self._whole, sources)

    def _clear(self, terrain: Terrain) -> None:
        self._last.clear()
        self._rolls = False
        self.loaded, self._window, self._whole = None, None, None
        self.grid = grid_of(terrain)

    def _index_of(self, source: str) -> int:
        if source not in self._names:
            self._names.append(source)
        return self._names.index(source)

    def _std_to_add(self) -> float:
        has_std = self.loaded is None or self.loaded.elevation_std is not None
        return 0.0 if has_std else self.values.loaded_std

    def grid_for(self, terrain: Terrain) -> CellGrid | None:
        """Return the cells onto which a local map merges; None if it sets them.

        The first map sets them, and a first local one that is finer than the loaded one.
        """
        is_finer = (
            self.grid is not None
            and self.loaded is not None
            and not self._last
            and terrain.resolution < FINER * self.grid.resolution
        )
        return None if is_finer else self.grid

    def _room_for(self, box: CellBox, centre: tuple[float, float]) -> Patch:
        """Return the window with room for a box, or around a place of the rover [m]."""
        old = self._window
        wanted = self._wanted_box(box, centre)
        if wanted.cells > self.values.max_map_cells:
            most = self.values.max_map_cells
            advice = "set map_window to the side of a window around the rover"
            if self._rolls:
                assert self.grid is not None
                side = math.isqrt(most) * self.grid.resolution
                advice = (
                    f"map_window is {self.values.map_window:g} m, set it to at most {side:.4g} m"
                )
            raise PlanningError(
                f"the map would have {wanted.rows} x {wanted.columns} cells; max_map_cells is "
                f"{most}: {advice}"
            )
        if old is not None and old.box == wanted:
            return old
        moved = empty_patch(wanted) if old is None else old.moved_to(wanted)
        return moved if self.loaded is None else self._with_loaded(moved)

    def _wanted_box(self, box: CellBox, centre: tuple[float, float]) -> CellBox:
        assert self.grid is not None
        old = None if self._window is None else self._window.box
        if self._rolls:
            n = max(2, round(self.values.map_window / self.grid.resolution))
            column, row = (round(value) - n // 2 for value in self.grid.coordinates(*centre))
            if old is None or (old.rows, old.columns) != (n, n):
                return CellBox(row, column, n, n)
            is_near = max(abs(old.row - row), abs(old.column - column)) <= n // ROLL
            return old if is_near else CellBox(row, column, n, n)
        if self.loaded is not None:  # a window that rolled until now may lack a part of it
            box = box_on(self.loaded, self.grid).union(box)
        if old is None:
            return box
        if old.contains(box):
            return old
        union = old.union(box)
        row = union.row - GROWTH * (union.row < old.row)
        column = union.column - GROWTH * (union.column < old.column)
        ends = zip(union.end, old.end, strict=True)
        end_row, end_column = (now + GROWTH * (now > before) for now, before in ends)
        return CellBox.between((row, column), (end_row, end_column))

    def _with_loaded(self, window: Patch) -> Patch:
        """Return a window whose unknown cells are those of the loaded map."""
        assert self.loaded is not None and self.grid is not None
        patch = lay_onto(self.loaded, self.grid, window.box)
        std = self._std_to_add()
        if std > 0.0:
            known = np.isfinite(patch.layers["elevation"])
            layers = patch.layers | {"elevation_std": np.where(known, std, np.nan)}
            patch = Patch(patch.box, layers)
        to, own = patch.box.within(window.box), window.box.within(patch.box)
        empty = window.layers["source"][to] == UNKNOWN
        take = np.isfinite(patch.layers["elevation"][own]) & empty
        window = window.written(patch, take, LOADED, self._loaded_time)
        # What a loaded map says of the ground holds for cells whose heights it does not have, too.
        for name in (*LASTING, "soil"):
            if name in patch.layers:
                window.layers[name][to][empty] = patch.layers[name][own][empty]
        return window

    def _wins(self, window: Patch, patch: Patch, time: float) -> Layer:
        """Return True for the cells of a patch within the window that replace the old ones."""
        to, own = patch.box.within(window.box), window.box.within(patch.box)
        known = np.isfinite(patch.layers["elevation"][own])
        source, since = window.layers["source"][to], window.layers["time"][to]
        is_given = (source == UNKNOWN) | (source == CONTACT) | (source == FOOTPRINT)
        if self.values.map_merge == NEWEST:
            return known & (is_given | (source == LOADED) | (since <= time))
        old, new = (
            one.with_layers(("elevation_std",)).layers["elevation_std"][cells]
            for one, cells in ((window, to), (patch, own))
        )
        age = np.where(np.isfinite(since), np.maximum(time - since, 0.0), 0.0)
        with np.errstate(invalid="ignore"):
            surer = new <= np.hypot(old, self.values.map_ageing * age)
        return known & (is_given | surer)

    def _is_near(self, box: CellBox, old: CellBox) -> bool:
        """Return whether a window that grows from the old one to a box stays of their size."""
        if self._rolls or old.contains(box):
            return True
        grown = self._wanted_box(box, self._centre_of(box)).cells
        most = NEAR * (old.cells + box.cells) + GROWTH**2
        return grown <= min(most, self.values.max_map_cells)

    def _centre_of(self, box: CellBox) -> tuple[float, float]:
        assert self.grid is not None
        centre = box.column + 0.5 * (box.columns - 1), box.row + 0.5 * (box.rows - 1)
        return self.grid.places(*centre)
