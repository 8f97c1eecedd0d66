"""Bilinear look-ups of elevation and friction inside kernels; gaps and the edge are told apart."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import uint64
from scipy.ndimage import maximum_filter

from rover_physics.kernels import kernel
from rover_physics.terrain import Terrain

BLOCK = 4
"""Cells along the side of a block."""


class Ground(NamedTuple):
    """A terrain as the kernels read it."""

    elevation: np.ndarray
    """(ny, nx) elevation [m], NaN where unknown."""
    ceiling: np.ndarray
    """(ny, nx) highest elevation around each cell, as far as half a wheel and its cells reach
    [m]; infinite beside unknown cells and the map's edge."""
    wheel_ceiling: np.ndarray
    """(ny, nx) the same as far as a wheel reaches in any heading [m]."""
    block_ceiling: np.ndarray
    """Highest elevation of each block of BLOCK x BLOCK cells [m], -inf where none is known."""
    friction: np.ndarray
    """(ny, nx) friction coefficient, NaN where the rover's own holds; (0, 0) without a layer."""
    soil: np.ndarray
    """(ny, nx) rows of the table of soils, 0 for the default; (0, 0) without a layer."""
    soils: np.ndarray
    """(1 + k, 8) table of `pack_soils`: the default soil, then those of the layer."""
    x0: float
    """x of the centre of cell [0, 0] [m]."""
    y0: float
    """y of the centre of cell [0, 0] [m]."""
    inverse_resolution: float
    """Cells per metre [1/m]."""


@lru_cache(maxsize=4)
def pack_ground(terrain: Terrain, wheel_radius: float, wheel_width: float) -> Ground:
    """Return `terrain` as the kernels read it for wheels of a radius and width [m], no soil."""
    elevation = np.ascontiguousarray(terrain.elevation, dtype=np.float64)
    friction = np.empty((0, 0)) if terrain.friction is None else terrain.friction
    half_width = 0.5 * wheel_width
    return Ground(
        elevation,
        _find_ceiling(terrain, half_width),
        _find_ceiling(terrain, float(np.hypot(wheel_radius, half_width))),
        _find_block_ceiling(elevation),
        np.ascontiguousarray(friction, dtype=np.float64),
        np.empty((0, 0), np.int32) if terrain.soil is None else terrain.soil + np.int32(1),
        np.zeros((1, 8)),
        float(terrain.origin[0]),
        float(terrain.origin[1]),
        1.0 / float(terrain.resolution),
    )


def _find_ceiling(terrain: Terrain, reach: float) -> np.ndarray:
    """Return the highest elevation that cells within `reach` [m] of each cell touch."""
    cells = int(np.ceil(reach / terrain.resolution + 1.5))
    unknown_is_high = np.where(np.isnan(terrain.elevation), np.inf, terrain.elevation)
    return maximum_filter(unknown_is_high, size=2 * cells + 1, mode="constant", cval=np.inf)


def _find_block_ceiling(elevation: np.ndarray) -> np.ndarray:
    ny, nx = elevation.shape
    rows, columns = -(-ny // BLOCK), -(-nx // BLOCK)
    padded = np.full((rows * BLOCK, columns * BLOCK), -np.inf)
    padded[:ny, :nx] = np.where(np.isnan(elevation), -np.inf, elevation)
    return padded.reshape(rows, BLOCK, columns, BLOCK).max(axis=(1, 3))


@kernel
def is_cell_on_map(grid, gx, gy):
    """Tell whether (gx, gy), in cells from cell [0, 0], lies within the outermost centres."""
    return gx >= 0.0 and gy >= 0.0 and gx <= grid.shape[1] - 1 and gy <= grid.shape[0] - 1


@kernel
def height_at_cell(elevation, gx, gy):
    """Return the elevation [m] at (gx, gy), counted in cells from cell [0, 0], on the map."""
    i = min(uint64(gy), uint64(elevation.shape[0] - 2))
    j = min(uint64(gx), uint64(elevation.shape[1] - 2))
    u, v = gx - j, gy - i
    next_i, next_j = i + uint64(1), j + uint64(1)
    here, above = elevation[i, j], elevation[next_i, j]
    lower = here + u * (elevation[i, next_j] - here)
    upper = above + u * (elevation[next_i, next_j] - above)
    return lower + v * (upper - lower)


@kernel
def look_up(ground, x, y):
    """Return elevation [m] and its gradient at (x, y) [m]; NaN where there is none."""
    elevation = ground.elevation
    gx = (x - ground.x0) * ground.inverse_resolution
    gy = (y - ground.y0) * ground.inverse_resolution
    if not is_cell_on_map(elevation, gx, gy):
        return np.nan, np.nan, np.nan
    i = min(uint64(gy), uint64(elevation.shape[0] - 2))
    j = min(uint64(gx), uint64(elevation.shape[1] - 2))
    u, v = gx - j, gy - i
    next_i, next_j = i + uint64(1), j + uint64(1)
    here, above = elevation[i, j], elevation[next_i, j]
    along_lower = elevation[i, next_j] - here
    along_upper = elevation[next_i, next_j] - above
    lower = here + u * along_lower
    upper = above + u * along_upper
    slope_x = (along_lower + v * (along_upper - along_lower)) * ground.inverse_resolution
    slope_y = (upper - lower) * ground.inverse_resolution
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
