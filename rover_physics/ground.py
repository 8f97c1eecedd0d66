"""Bilinear look-ups of elevation and friction inside kernels; gaps and the edge are told apart."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import int64, uint64

from rover_physics.kernels import kernel
from rover_physics.terrain import Terrain

BLOCK = 4
"""Cells along the side of a block, a power of 2."""


class Grid(NamedTuple):
    """The heights of a terrain as the kernels read them."""

    elevation: np.ndarray
    """(ny, nx) elevation [m], NaN where unknown."""
    roof: np.ndarray
    """Highest elevation of each block of BLOCK x BLOCK cells [m], infinite where any of it is
    unknown."""
    x0: float
    """x of the centre of cell [0, 0] [m]."""
    y0: float
    """y of the centre of cell [0, 0] [m]."""
    inverse_resolution: float
    """Cells per metre [1/m]."""


class Ground(NamedTuple):
    """A terrain as a sweep reads it: its heights as in `Grid`, and what else there is."""

    elevation: np.ndarray
    roof: np.ndarray
    x0: float
    y0: float
    inverse_resolution: float
    ceiling: np.ndarray
    """Highest elevation of each block [m], -inf where none is known."""
    friction: np.ndarray
    """(ny, nx) friction coefficient, NaN where the rover's own holds; (0, 0) without a layer."""
    soil: np.ndarray
    """(ny, nx) rows of the table of soils, 0 for the default; (0, 0) without a layer."""
    soils: np.ndarray
    """(1 + k, 8) table of `pack_soils`: the default soil, then those of the layer."""


@lru_cache(maxsize=4)
def pack_ground(terrain: Terrain) -> Ground:
    """Return `terrain` as the kernels read it, with a soil that is none."""
    elevation = np.ascontiguousarray(terrain.elevation, dtype=np.float64)
    highest = _reduce_blocks(elevation, np.fmax)
    some_unknown = _reduce_blocks(np.isnan(elevation), np.logical_or)
    friction = np.empty((0, 0)) if terrain.friction is None else terrain.friction
    return Ground(
        elevation,
        np.where(some_unknown, np.inf, highest),
        float(terrain.origin[0]),
        float(terrain.origin[1]),
        1.0 / float(terrain.resolution),
        np.where(np.isnan(highest), -np.inf, highest),
        np.ascontiguousarray(friction, dtype=np.float64),
        np.empty((0, 0), np.int32) if terrain.soil is None else terrain.soil + np.int32(1),
        np.zeros((1, 8)),
    )


def _reduce_blocks(cells: np.ndarray, reduce: np.ufunc) -> np.ndarray:
    """Reduce each block of cells to one; blocks at the far edges count their last cells twice."""
    ny, nx = cells.shape
    missing = (0, -ny % BLOCK), (0, -nx % BLOCK)
    if missing != ((0, 0), (0, 0)):
        cells = np.pad(cells, missing, mode="edge")
    halvings = BLOCK.bit_length() - 1
    for _ in range(halvings):
        cells = reduce(cells[0::2], cells[1::2])
    for _ in range(halvings):
        cells = reduce(cells[:, 0::2], cells[:, 1::2])
    return cells


def heights_of(ground: Ground) -> Grid:
    """Return the Grid of a Ground.

    Not a kernel: kernels count no references, so none may return an array. In a kernel write
    ``Grid(...)``; fewer arrays are quicker to hand from kernel to kernel.
    """
    return Grid(ground.elevation, ground.roof, ground.x0, ground.y0, ground.inverse_resolution)


@kernel
def find_roof(grid, gx, gy, reach):
    """Return the highest elevation [m] within `reach` of (gx, gy), both in cells.

    Infinite where there is unknown ground or the map ends so near. Block by block, so somewhat
    more than asked for is looked at.
    """
    ny, nx = grid.elevation.shape
    if not (gx >= reach and gy >= reach and gx < nx - 1 - reach and gy < ny - 1 - reach):
        return np.inf
    highest = -np.inf
    for i in range(int(gy - reach) // BLOCK, int(gy + reach + 1.0) // BLOCK + 1):
        for j in range(int(gx - reach) // BLOCK, int(gx + reach + 1.0) // BLOCK + 1):
            highest = max(highest, grid.roof[i, j])
    return highest


@kernel
def height_inside(elevation, gx, gy):
    """Return the elevation [m] at (gx, gy), in cells from cell [0, 0], well within the map."""
    i, j = uint64(int64(gy)), uint64(int64(gx))
    u, v = gx - int64(j), gy - int64(i)
    next_i, next_j = i + uint64(1), j + uint64(1)
    here, above = elevation[i, j], elevation[next_i, j]
    lower = here + u * (elevation[i, next_j] - here)
    upper = above + u * (elevation[next_i, next_j] - above)
    return lower + v * (upper - lower)


@kernel
def is_cell_on_map(elevation, gx, gy):
    """Tell whether (gx, gy), in cells from cell [0, 0], lies within the outermost centres."""
    ny, nx = elevation.shape
    return gx >= 0.0 and gy >= 0.0 and gx <= nx - 1 and gy <= ny - 1


@kernel
def height_at_cell(elevation, gx, gy):
    """Return the elevation [m] at (gx, gy), counted in cells from cell [0, 0], on the map."""
    i = uint64(min(int64(gy), elevation.shape[0] - 2))
    j = uint64(min(int64(gx), elevation.shape[1] - 2))
    u, v = gx - int64(j), gy - int64(i)
    next_i, next_j = i + uint64(1), j + uint64(1)
    here, above = elevation[i, j], elevation[next_i, j]
    lower = here + u * (elevation[i, next_j] - here)
    upper = above + u * (elevation[next_i, next_j] - above)
    return lower + v * (upper - lower)


@kernel
def look_up(grid, x, y):
    """Return elevation [m] and its gradient at (x, y) [m]; NaN where there is none."""
    elevation = grid.elevation
    gx = (x - grid.x0) * grid.inverse_resolution
    gy = (y - grid.y0) * grid.inverse_resolution
    if not is_cell_on_map(elevation, gx, gy):
        return np.nan, np.nan, np.nan
    i = uint64(min(int64(gy), elevation.shape[0] - 2))
    j = uint64(min(int64(gx), elevation.shape[1] - 2))
    u, v = gx - int64(j), gy - int64(i)
    next_i, next_j = i + uint64(1), j + uint64(1)
    here, above = elevation[i, j], elevation[next_i, j]
    along_lower = elevation[i, next_j] - here
    along_upper = elevation[next_i, next_j] - above
    lower = here + u * along_lower
    upper = above + u * along_upper
    slope_x = (along_lower + v * (along_upper - along_lower)) * grid.inverse_resolution
    slope_y = (upper - lower) * grid.inverse_resolution
    return lower + v * (upper - lower), slope_x, slope_y


@kernel
def friction_at(ground, x, y, default):
    """Return the friction coefficient of the cell nearest to (x, y) [m], else `default`."""
    ny, nx = ground.friction.shape
    if ny == 0:
        return default
    i, j = _nearest_cell(ground, ny, nx, x, y)
    mu = ground.friction[i, j]
    return mu if mu > 0.0 else default


@kernel
def soil_row_at(ground, x, y):
    """Return the row of the table of soils that holds in the cell nearest to (x, y) [m]."""
    ny, nx = ground.soil.shape
    if ny == 0:
        return 0
    i, j = _nearest_cell(ground, ny, nx, x, y)
    return int(ground.soil[i, j])


@kernel
def _nearest_cell(ground, ny, nx, x, y):
    j = min(max(int((x - ground.x0) * ground.inverse_resolution + 0.5), 0), nx - 1)
    i = min(max(int((y - ground.y0) * ground.inverse_resolution + 0.5), 0), ny - 1)
    return i, j
