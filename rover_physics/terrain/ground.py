# SPDX-License-Identifier: Apache-2.0
"""Terrain for kernels: arrays read by address, with bilinear interpolation of heights.

Numba passes an array from kernel to kernel as nine numbers, but its address as one. Passing two
arrays through some hundred calls per pose took a quarter of the time. A GROUND therefore holds
addresses, and a `Ground` keeps the arrays alive. All code that makes or reads addresses is in this
file.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numba import int64, types
from numba.extending import intrinsic

from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import array_of, new_record, record_type
from rover_physics.terrain.grid import Terrain

BLOCK_BITS = 2
"""Base-2 logarithm of BLOCK."""
BLOCK = 1 << BLOCK_BITS
"""Cells along the side of a block; maxima of blocks let kernels skip low ground."""
SOIL_NUMBERS = 8
"""Columns of the table of soils."""
NO_SOILS = np.zeros((1, SOIL_NUMBERS))
"""Table of soils for a terrain without soils: one row of zeros."""


GROUND = record_type(
    ("elevation", np.int64),  # address of (rows, columns) elevation [m], NaN where unknown
    # address of (block_rows, block_columns) highest elevation of each block [m], infinite if any
    # cell of it is unknown
    ("block_max", np.int64),
    ("known_block_max", np.int64),  # address of the same, over known cells; -inf if there are none
    ("friction", np.int64),  # address of (rows, columns) friction coefficient, 0 without layer
    ("soil", np.int64),  # address of (rows, columns) int32 rows in the table of soils, 0 without
    ("soils", np.int64),  # address of the table of soils, (1 + k, SOIL_NUMBERS)
    ("rows", np.int64),  # rows of cells
    ("columns", np.int64),  # columns of cells
    ("block_rows", np.int64),  # rows of blocks of BLOCK x BLOCK cells
    ("block_columns", np.int64),  # columns of blocks
    ("x0", float),  # x of the centre of cell [0, 0] [m]
    ("y0", float),  # y of the centre of cell [0, 0] [m]
    ("inverse_resolution", float),  # cells per metre [1/m]
)
"""A terrain for kernels, with the addresses of the arrays of a `Ground`; map frame."""


@dataclass(frozen=True, eq=False)
class Ground:
    """A terrain for kernels: the GROUND record and the arrays that it points to.

    It cannot be pickled, because addresses are valid in one process only; pickle the Terrain.
    """

    records: np.ndarray
    """(1,) GROUND."""
    arrays: Mapping[str, np.ndarray | None]
    """The arrays by the names of the fields with their addresses; None without such a layer."""

    def __reduce__(self) -> str:
        raise TypeError(
            "a Ground holds addresses of this process and cannot be pickled; pickle its Terrain"
        )


def address_of(array: np.ndarray, kind: type) -> int:
    """Return the address of an array; it is valid as long as the array lives.

    Raises:
        TypeError: The elements are not of the type `kind`, in this machine's byte order.
        ValueError: The array is not C-contiguous.
    """
    if array.dtype != np.dtype(kind):
        raise TypeError(
            f"an array that is read by its address has elements {array.dtype}; "
            f"they must be {np.dtype(kind)}"
        )
    if not array.flags.c_contiguous:
        raise ValueError("an array that is read by its address must be C-contiguous")
    return array.ctypes.data


def _reader(element: types.Type, returned: types.Type) -> Any:
    """Return the intrinsic code of a function (address, index) -> element at that index."""

    def read(_context: Any, _address: Any, _index: Any) -> Any:
        def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            kind = context.get_value_type(element).as_pointer()
            start = builder.inttoptr(arguments[0], kind)
            value = builder.load(builder.gep(start, [arguments[1]]))
            return context.cast(builder, value, element, returned)

        return returned(types.int64, types.int64), generate

    return read


read_float: Any = intrinsic(_reader(types.float64, types.float64))
"""Return element `index` of the float64 array at `address`."""
read_int: Any = intrinsic(_reader(types.int32, types.int64))
"""Return element `index` of the int32 array at `address`."""


def new_ground(terrain: Terrain) -> Ground:
    """Return a terrain as a Ground, without soils."""
    elevation, friction, soil = terrain.elevation, terrain.friction, terrain.soil
    highest = _reduce_blocks(elevation, np.fmax)
    some_unknown = _reduce_blocks(np.isnan(elevation), np.logical_or)
    arrays = {
        "elevation": elevation,
        "block_max": np.where(some_unknown, np.inf, highest),
        "known_block_max": np.where(np.isnan(highest), -np.inf, highest),
        "friction": friction,
        "soil": None if soil is None else soil + np.int32(1),
        "soils": NO_SOILS,
    }
    record = new_record(
        GROUND,
        **{
            name: address_of(array, np.int32 if name == "soil" else np.float64)
            for name, array in arrays.items()
            if array is not None
        },
        rows=elevation.shape[0],
        columns=elevation.shape[1],
        block_rows=highest.shape[0],
        block_columns=highest.shape[1],
        x0=float(terrain.origin[0]),
        y0=float(terrain.origin[1]),
        inverse_resolution=1.0 / float(terrain.resolution),
    )
    return Ground(array_of(record), arrays)


pack_ground = lru_cache(maxsize=4)(new_ground)
"""The same; the last 4 are cached."""


def with_soils(ground: Ground, soils: np.ndarray) -> Ground:
    """Return `ground` with another table of soils (1 + k, SOIL_NUMBERS)."""
    records = ground.records.copy()
    records["soils"] = address_of(soils, np.float64)
    return Ground(records, {**ground.arrays, "soils": soils})


def _reduce_blocks(cells: np.ndarray, reduce: np.ufunc) -> np.ndarray:
    """Reduce each block of cells to one value; missing cells at the far edges repeat the last."""
    cells = np.pad(cells, [(0, -size % BLOCK) for size in cells.shape], mode="edge")
    ny, nx = cells.shape
    blocks = cells.reshape(ny // BLOCK, BLOCK, nx // BLOCK, BLOCK)
    return np.asarray(reduce.reduce(blocks, axis=(1, 3)))


@kernel
def elevation_of(ground, i, j):
    """Return the elevation [m] of cell [i, j], which must be on the map; NaN if unknown."""
    return read_float(ground.elevation, i * ground.columns + j)


@kernel
def known_max_of_block(ground, bi, bj):
    """Return the highest known elevation [m] of block [bi, bj], -inf if none is known."""
    return read_float(ground.known_block_max, bi * ground.block_columns + bj)


@kernel
def find_block_max(ground, gx, gy, half_x, half_y):
    """Return the highest elevation [m] in a box around (gx, gy); half sides are in cells, too.

    It is infinite if the box contains unknown ground or leaves the map. The search takes whole
    blocks, so it covers slightly more than the box.
    """
    low_x, high_x, low_y, high_y = gx - half_x, gx + half_x, gy - half_y, gy + half_y
    if not (
        low_x >= 0.0 and low_y >= 0.0 and high_x < ground.columns - 1 and high_y < ground.rows - 1
    ):
        return np.inf
    first, last = int64(low_x) >> BLOCK_BITS, int64(high_x + 1.0) >> BLOCK_BITS
    block_max = -np.inf
    for i in range(int64(low_y) >> BLOCK_BITS, (int64(high_y + 1.0) >> BLOCK_BITS) + 1):
        row = i * ground.block_columns
        for j in range(first, last + 1):
            height = read_float(ground.block_max, row + j)
            if height > block_max:
                block_max = height
    return block_max


@kernel
def height_inside(ground, gx, gy):
    """Return the elevation [m] at (gx, gy) [cells from cell [0, 0]], inside the last row, column.

    Nothing is checked; NaN near unknown cells.
    """
    i, j = int64(gy), int64(gx)
    return _interpolate(ground.elevation, i * ground.columns + j, ground.columns, gx - j, gy - i)


@kernel
def is_cell_on_map(ground, gx, gy):
    """Return whether (gx, gy) [cells from cell [0, 0]] is within the outermost cell centres."""
    return gx >= 0.0 and gy >= 0.0 and gx <= ground.columns - 1 and gy <= ground.rows - 1


@kernel
def height_at_cell(ground, gx, gy):
    """Return the elevation [m] at (gx, gy) [cells from cell [0, 0]], which must be on the map."""
    i, j = min(int64(gy), ground.rows - 2), min(int64(gx), ground.columns - 2)
    return _interpolate(ground.elevation, i * ground.columns + j, ground.columns, gx - j, gy - i)


@kernel
def _interpolate(elevation, at, columns, u, v):
    """Return the height [m] at fractions u (column) and v (row) from element `at` to the next."""
    here, above = read_float(elevation, at), read_float(elevation, at + columns)
    lower = here + u * (read_float(elevation, at + 1) - here)
    upper = above + u * (read_float(elevation, at + columns + 1) - above)
    return lower + v * (upper - lower)


@kernel
def to_cells(ground, x, y):
    """Return a place (x, y) [m], map frame, in cells from cell [0, 0]."""
    scale = ground.inverse_resolution
    return (x - ground.x0) * scale, (y - ground.y0) * scale


@kernel
def look_up(ground, x, y):
    """Return elevation [m] and slopes along x and y at (x, y) [m]; NaN if unknown or off map."""
    gx, gy = to_cells(ground, x, y)
    return look_up_cell(ground, gx, gy)


@kernel
def look_up_cell(ground, gx, gy):
    """Return elevation [m] and slopes along x and y at (gx, gy) [cells]; NaN as in `look_up`."""
    if not is_cell_on_map(ground, gx, gy):
        return np.nan, np.nan, np.nan
    i, j = min(int64(gy), ground.rows - 2), min(int64(gx), ground.columns - 2)
    u, v = gx - j, gy - i
    elevation, at = ground.elevation, i * ground.columns + j
    above_at = at + ground.columns
    here, above = read_float(elevation, at), read_float(elevation, above_at)
    along_lower = read_float(elevation, at + 1) - here
    along_upper = read_float(elevation, above_at + 1) - above
    lower = here + u * along_lower
    upper = above + u * along_upper
    slope_x = (along_lower + v * (along_upper - along_lower)) * ground.inverse_resolution
    slope_y = (upper - lower) * ground.inverse_resolution
    return lower + v * (upper - lower), slope_x, slope_y


@kernel
def friction_at(ground, x, y, default):
    """Return the friction coefficient of the cell nearest to (x, y) [m], or `default` if none."""
    if ground.friction == 0:
        return default
    mu = read_float(ground.friction, _nearest_cell(ground, x, y))
    return mu if mu > 0.0 else default


@kernel
def soil_row_at(ground, x, y):
    """Return the row in the table of soils for the cell nearest to (x, y) [m]."""
    if ground.soil == 0:
        return 0
    return read_int(ground.soil, _nearest_cell(ground, x, y))


@kernel
def copy_soil(ground, row, soil):
    """Copy a row of the table of soils into soil (SOIL_NUMBERS,)."""
    for k in range(SOIL_NUMBERS):
        soil[k] = read_float(ground.soils, row * SOIL_NUMBERS + k)


@kernel
def _nearest_cell(ground, x, y):
    j = int((x - ground.x0) * ground.inverse_resolution + 0.5)
    i = int((y - ground.y0) * ground.inverse_resolution + 0.5)
    j = min(max(j, 0), ground.columns - 1)
    return min(max(i, 0), ground.rows - 1) * ground.columns + j
