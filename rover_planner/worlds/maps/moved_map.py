# SPDX-License-Identifier: Apache-2.0
"""Moves a map of another frame to that of the server, and lays a turned one onto its cells.

Ground is never made up: a cell is known only if all cells that its height comes from are known.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.read_only import seal_array
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.terrain_file import MAX_CELLS
from rover_planner.errors import PlanningError
from rover_planner.worlds.maps.cells import MAX_FINER, MAX_OFF_CENTRE, CellBox, CellGrid

MAX_LEAN = 0.005
"""Largest lean of a map's frame [rad]. Heights follow it; what neglects it is that cells move
sideways, by 5 mm for each metre of height."""
NO_LEAN = 1e-9
"""Lean that is a rounding error [rad]."""
SAME_PLACE = 1e-6
"""Distance from the centre of a cell at which its height alone counts [cells]."""
BAND_CELLS = 16_384
"""Cells that are laid at once, as numpy keeps Python's lock meanwhile, which questions need."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MapMove:
    """Where the frame of a map is in that of the server: a point p is at R p + t there."""

    rotation: Floats
    """(3, 3) R."""
    translation: Floats
    """(3,) t [m]."""

    @property
    def yaw(self) -> float:
        """Turn about z [rad]."""
        return math.atan2(self.rotation[1, 0], self.rotation[0, 0])

    @property
    def lean(self) -> float:
        """Angle between the two z axes [rad]."""
        return math.atan2(math.hypot(*self.rotation[2, :2]), self.rotation[2, 2])


def move_map(
    terrain: Terrain, move: MapMove, grid: CellGrid | None = None, max_cells: int = MAX_CELLS
) -> Terrain:
    """Move a map to another frame.

    A map that is shifted only keeps its cells and, if that is level, its heights to the bit. A
    turned one is interpolated bilinearly, heights and deviations alike; friction is that of the
    nearest cell.

    Args:
        terrain: The map in its own frame.
        move: Where that frame is in the other one.
        grid: Cells onto which a turned map is laid; None takes cells of the map's own size that
            are centred on multiples of it. So do cells more than twice as large: who lays the map
            onto those takes the highest of several.
        max_cells: Largest number of cells of a turned map.

    Raises:
        PlanningError: The frame leans, or the turned map is too large or has no known cell.
    """
    if move.lean > MAX_LEAN:
        raise PlanningError(
            f"the frame of the map leans by {move.lean:.3g} rad (roll and pitch); it must be "
            f"level within {MAX_LEAN:g} rad, as odom is"
        )
    upright = replace(terrain, elevation=_lean_heights(terrain, move))
    centre, moved = _find_centres(terrain, move)
    if abs(move.yaw) * max(terrain.elevation.shape) <= MAX_OFF_CENTRE:
        x, y = (terrain.origin + (moved - centre)).tolist()
        return replace(upright, origin=(x, y))
    if grid is None or terrain.resolution < MAX_FINER * grid.resolution:
        grid = CellGrid((0.0, 0.0), terrain.resolution)
    return _Turn(upright, moved, move.yaw, grid).lay(max_cells)


def _find_centres(terrain: Terrain, move: MapMove) -> tuple[Floats, Floats]:
    """Return x, y [m] of the middle of a map, in its own frame and in the other one."""
    x0, x1, y0, y1 = terrain.bounds
    centre = np.array([0.5 * (x0 + x1), 0.5 * (y0 + y1)])
    height = 0.0 if move.lean <= NO_LEAN else float(np.nanmedian(terrain.elevation))
    return centre, (move.rotation @ (*centre, height) + move.translation)[:2]


def _lean_heights(terrain: Terrain, move: MapMove) -> Floats:
    """Return the heights of the cells in the other frame."""
    z, up = terrain.elevation, float(move.translation[2])
    if move.lean <= NO_LEAN:
        return z if up == 0.0 else seal_array(z + up)
    along, across, upright = move.rotation[2]
    ny, nx = z.shape
    x = terrain.origin[0] + terrain.resolution * np.arange(nx)
    y = terrain.origin[1] + terrain.resolution * np.arange(ny)[:, None]
    return seal_array(upright * z + (along * x + across * y + up))


class _Turn:
    """Lays a turned map onto the cells of a grid."""

    def __init__(self, terrain: Terrain, middle: Floats, yaw: float, grid: CellGrid):
        """Take a map, where its middle is on the grid [m], and its turn [rad]."""
        self._terrain, self._middle, self._grid = terrain, middle, grid
        self._turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])

    def lay(self, max_cells: int) -> Terrain:
        """Return the map on the grid; see `move_map`."""
        box, grid, layers = self._find_box(), self._grid, self._list_layers()
        if box.cells > max_cells:
            raise PlanningError(
                f"the map turned into its frame would have {box.rows} x {box.columns} cells; "
                f"at most {max_cells} are taken"
            )
        laid = {name: np.full((box.rows, box.columns), np.nan) for name in layers}
        band = max(BAND_CELLS // max(box.columns, 1), 1)
        for first in range(0, box.rows, band):
            rows = slice(first, min(first + band, box.rows))
            around = self._find_around(box, rows)
            for name, layer in layers.items():
                sample = around.nearest if name == "friction" else around.interpolate
                laid[name][rows] = sample(layer)
        if not np.isfinite(laid["elevation"]).any():
            raise PlanningError(
                "the map is turned against its cells, and none of them has four known ones around"
            )
        x, y = grid.anchor
        step = grid.resolution
        origin = x + step * box.column, y + step * box.row
        sealed = {name: seal_array(layer) for name, layer in laid.items()}
        std, friction = sealed.get("elevation_std"), sealed.get("friction")
        return Terrain(sealed["elevation"], step, origin, friction, elevation_std=std)

    def _list_layers(self) -> dict[str, Floats]:
        names = ("elevation", "elevation_std", "friction")
        layers = {name: getattr(self._terrain, name) for name in names}
        return {name: layer for name, layer in layers.items() if layer is not None}

    def _find_box(self) -> CellBox:
        """Return the cells of the grid around the turned map."""
        ny, nx = self._terrain.elevation.shape
        half = 0.5 * self._terrain.resolution * np.array([nx - 1, ny - 1])
        reach = np.abs(self._turn) @ half
        low = self._grid.coordinates(*(self._middle - reach))
        high = self._grid.coordinates(*(self._middle + reach))
        column, row = (math.ceil(value - SAME_PLACE) for value in low)
        last_column, last_row = (math.floor(value + SAME_PLACE) for value in high)
        counts = max(last_row - row + 1, 0), max(last_column - column + 1, 0)
        return CellBox(row, column, *counts)

    def _find_around(self, box: CellBox, rows: slice) -> "_Around":
        """Return which cells of the map are around those of some rows of a box."""
        grid, step = self._grid, self._terrain.resolution
        columns = box.column + np.arange(box.columns)
        lines = box.row + np.arange(rows.start, rows.stop)[:, None]
        x = (grid.anchor[0] - self._middle[0]) + grid.resolution * columns
        y = (grid.anchor[1] - self._middle[1]) + grid.resolution * lines
        ny, nx = self._terrain.elevation.shape
        (cosine, _), (sine, _) = self._turn
        column = (cosine * x + sine * y) / step + 0.5 * (nx - 1)
        row = (cosine * y - sine * x) / step + 0.5 * (ny - 1)
        return _Around(_Between.find(row, ny), _Between.find(column, nx))


@dataclass(frozen=True, eq=False)
class _Between:
    """Between which two cells of a row or column some places are."""

    first: NDArray[np.intp]
    """Index of the lower cell."""
    last: NDArray[np.intp]
    """Index of the upper one."""
    beyond: Floats
    """How far a place is beyond the lower one, 0 to 1."""
    inside: NDArray[np.bool_]
    """Whether a place is on the map."""

    @staticmethod
    def find(place: Floats, count: int) -> "_Between":
        """Find the cells around fractional indices, of `count` cells."""
        whole = np.rint(place)
        place = np.where(np.abs(place - whole) <= SAME_PLACE, whole, place)
        inside = (place >= 0.0) & (place <= count - 1)
        first = np.clip(np.floor(place), 0, max(count - 2, 0)).astype(np.intp)
        return _Between(first, np.minimum(first + 1, count - 1), place - first, inside)

    @property
    def nearest(self) -> NDArray[np.intp]:
        """Index of the nearer cell."""
        return np.where(self.beyond < 0.5, self.first, self.last)

    @property
    def shares(self) -> tuple[tuple[NDArray[np.intp], Floats], ...]:
        """Both indices, each with its share of the value."""
        return (self.first, 1.0 - self.beyond), (self.last, self.beyond)


@dataclass(frozen=True, eq=False)
class _Around:
    """The four cells around some places."""

    rows: _Between
    columns: _Between

    @property
    def inside(self) -> NDArray[np.bool_]:
        """Whether a place is on the map."""
        return self.rows.inside & self.columns.inside

    def interpolate(self, layer: Floats) -> Floats:
        """Interpolate bilinearly; NaN where a cell that counts is not known."""
        found = np.zeros(self.rows.first.shape)
        for row, up in self.rows.shares:
            for column, along in self.columns.shares:
                share = up * along
                found += np.where(share == 0.0, 0.0, share * layer[row, column])
        return np.where(self.inside, found, np.nan)

    def nearest(self, layer: Floats) -> Floats:
        """Return the values of the nearest cells."""
        return np.where(self.inside, layer[self.rows.nearest, self.columns.nearest], np.nan)
