# SPDX-License-Identifier: Apache-2.0
"""Moves a map of another frame to that of the server, and lays a turned one onto its cells.

Ground is never made up: a cell is known only if all cells that its height comes from are known.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from rover_physics.numerics.arrays import Floats, seal_array
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.terrain_file import MAX_CELLS
from rover_planner.errors import PlanningError
from rover_planner.maps.cells import CellBox, CellGrid, grid_of
from rover_planner.maps.layers import (
    MAX_FINER,
    MAX_OFF_CENTRE,
    empty_patch,
    layers_of,
    sample_layers,
)

MAX_LEAN = 0.005
"""Largest lean of a map's frame [rad]. Heights follow it; what neglects it is that cells move
sideways, by 5 mm for each metre of height."""
NO_LEAN = 1e-9
"""Lean that is a rounding error [rad]."""
BAND_CELLS = 16_384
"""Cells that are laid at once, as numpy keeps Python's lock meanwhile, which questions need."""


Move = tuple[Floats, Floats]
"""Place of a map's frame in that of the server, rotation R (3, 3) and translation t (3,) [m]: a
point p is at R p + t there."""


def move_map(
    terrain: Terrain, move: Move, grid: CellGrid | None = None, max_cells: int = MAX_CELLS
) -> Terrain:
    """Move a map to another frame.

    A map that is shifted only keeps its cells and, if that is level, its heights to the bit. A
    turned one is interpolated bilinearly, heights and deviations alike; friction and class are
    those of the nearest cell.

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
    rotation, translation = move
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    lean = math.atan2(math.hypot(*rotation[2, :2]), rotation[2, 2])
    if lean > MAX_LEAN:
        raise PlanningError(
            f"the frame of the map leans by {lean:.3g} rad (roll and pitch); it must be "
            f"level within {MAX_LEAN:g} rad, as odom is"
        )
    upright = replace(terrain, elevation=_lean_heights(terrain, move, lean))
    x0, x1, y0, y1 = terrain.bounds
    centre = np.array([0.5 * (x0 + x1), 0.5 * (y0 + y1)])
    height = 0.0 if lean <= NO_LEAN else float(np.nanmedian(terrain.elevation))
    moved = (rotation @ (*centre, height) + translation)[:2]
    if abs(yaw) * max(terrain.elevation.shape) <= MAX_OFF_CENTRE:
        x, y = (terrain.origin + (moved - centre)).tolist()
        return replace(upright, origin=(x, y))
    if grid is None or terrain.resolution < MAX_FINER * grid.resolution:
        grid = CellGrid((0.0, 0.0), terrain.resolution)
    return _lay_turned(upright, moved, yaw, grid, max_cells)


def _lean_heights(terrain: Terrain, move: Move, lean: float) -> Floats:
    """Return the heights of the cells in the other frame, which lean by an angle [rad]."""
    (rotation, translation), z = move, terrain.elevation
    up = float(translation[2])
    if lean <= NO_LEAN:
        return z if up == 0.0 else seal_array(z + up)
    along, across, upright = rotation[2]
    ny, nx = z.shape
    x, y = grid_of(terrain).places(np.arange(nx), np.arange(ny)[:, None])
    return seal_array(upright * z + (along * x + across * y + up))


def _lay_turned(
    terrain: Terrain, middle: Floats, yaw: float, grid: CellGrid, max_cells: int
) -> Terrain:
    """Lay a map that is turned by a yaw [rad] about its middle (2,) [m] onto a grid."""
    ny, nx = terrain.elevation.shape
    half = 0.5 * terrain.resolution * np.array([nx - 1, ny - 1])
    box = grid.box_around(middle, half, yaw)
    if box.cells > max_cells:
        raise PlanningError(
            f"the map turned into its frame would have {box.rows} x {box.columns} cells; "
            f"at most {max_cells} are taken"
        )
    own = replace(terrain, soil=None, soil_names=())
    laid = empty_patch(box, tuple(layers_of(own))).layers
    turn, band = (math.cos(yaw), math.sin(yaw)), max(BAND_CELLS // max(box.columns, 1), 1)
    for first in range(0, box.rows, band):
        count = min(band, box.rows - first)
        x, y = grid.centres_of(CellBox(box.row + first, box.column, count, box.columns))
        dx, dy = (x - middle[0]) / terrain.resolution, (y - middle[1]) / terrain.resolution
        column = turn[0] * dx + turn[1] * dy + 0.5 * (nx - 1)
        row = turn[0] * dy - turn[1] * dx + 0.5 * (ny - 1)
        for name, layer in sample_layers(own, column, row).items():
            laid[name][first : first + count] = layer
    if not np.isfinite(laid["elevation"]).any():
        raise PlanningError(
            "the map is turned against its cells, and none of them has four known ones around"
        )
    sealed: dict[str, Any] = {name: seal_array(layer) for name, layer in laid.items()}
    origin = grid.places(box.column, box.row)
    return Terrain(**sealed, resolution=grid.resolution, origin=origin)
