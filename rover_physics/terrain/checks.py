# SPDX-License-Identifier: Apache-2.0
"""Checks of the fields of a terrain; each returns the value in its final type and layout.

All raise a TerrainError that names the field, the value and the rule.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_physics.errors import TerrainError
from rover_physics.files.validation import describe
from rover_physics.numerics import plausible as known

MAX_CLASS = 65535
"""Largest class of ground."""


def as_elevation(values: ArrayLike) -> NDArray[np.float64]:
    """Return heights (ny, nx) [m]; at least one must be known."""
    elevation = _as_grid("elevation", values, known.MAX_COORDINATE)
    if np.isnan(elevation).all():
        ny, nx = elevation.shape
        raise TerrainError(
            f"elevation has no known cell: all {ny} x {nx} are NaN; at least one must be known"
        )
    return elevation


def as_friction(values: ArrayLike, elevation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return friction coefficients (ny, nx), each above 0 or NaN."""
    friction = _as_grid("friction", values, known.MAX_FRICTION, elevation)
    must = f"above 0, at least {known.MIN_FRICTION:g}, or NaN for the default"
    _refuse_first(friction, friction < known.MIN_FRICTION, "friction", must)
    return friction


def as_ground_class(values: ArrayLike, elevation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return classes of ground (ny, nx), whole numbers from 0, NaN where there is none."""
    classes = _as_grid("ground_class", values, MAX_CLASS, elevation)
    wrong = (classes < 0.0) | (classes > np.floor(classes))
    must = f"a whole number from 0 to {MAX_CLASS}, or NaN for none"
    _refuse_first(classes, wrong, "ground_class", must)
    return classes


def as_soil(
    values: ArrayLike, names: tuple[str, ...], elevation: NDArray[np.float64]
) -> NDArray[np.int32]:
    """Return indices of soils (ny, nx), each from -1 to the number of names minus 1."""
    soil = np.asarray(values)
    if soil.dtype.kind not in "iu":
        raise TerrainError(f"soil has type {soil.dtype}; it must be an array of whole numbers")
    _check_shape("soil", soil, elevation)
    last = len(names) - 1
    allowed = f"-1 for the default, or 0 to {last}, an index into soil_names"
    must = allowed if names else "-1 for the default, as there are no soil_names"
    # Checked before the conversion: an index too large for 32 bits would wrap around.
    _refuse_first(soil, (soil < -1) | (soil > last), "soil", must)
    return np.ascontiguousarray(soil, dtype=np.int32)


def as_soil_names(values: Any) -> tuple[str, ...]:
    """Return names of soils; none may be empty or appear twice."""
    must = "a list of different names, none of them empty"
    is_array = isinstance(values, np.ndarray)
    if not isinstance(values, list | tuple) and not (is_array and values.ndim == 1):
        raise TerrainError(f"soil_names is {values!s:.60}; it must be {must}")
    names = tuple(values.tolist() if is_array else values)
    if not all(isinstance(name, str) and name.strip() for name in names):
        raise TerrainError(f"soil_names is {describe(list(names))}; it must be {must}")
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise TerrainError(f"soil_names has {describe(twice)} twice; it must be {must}")
    return tuple(str(name) for name in names)


def as_elevation_std(values: ArrayLike, elevation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return standard deviations (ny, nx) [m], at least 0 and known where the height is known."""
    std = _as_grid("elevation_std", values, known.MAX_COORDINATE, elevation)
    _refuse_first(std, std < 0.0, "elevation_std", "at least 0")
    missing = np.isnan(std) & np.isfinite(elevation)
    _refuse_first(std, missing, "elevation_std", "a number in m where the height is known")
    return std


def as_resolution(value: Any) -> float:
    """Return the cell size [m] as a float from MIN_RESOLUTION to MAX_RESOLUTION."""
    number = np.asarray(value)
    if number.dtype.kind in "fiu" and number.size == 1:
        resolution = float(number.reshape(()))
        if known.MIN_RESOLUTION <= resolution <= known.MAX_RESOLUTION:
            return resolution
    raise TerrainError(
        f"resolution is {value!s:.60}; it must be one number above 0 in m, from "
        f"{known.MIN_RESOLUTION:g} to {known.MAX_RESOLUTION:g}"
    )


def as_origin(value: Any) -> tuple[float, float]:
    """Return the origin (x, y) [m] as two floats within MAX_COORDINATE."""
    try:
        point = np.asarray(value)
    except ValueError:
        point = np.empty(0)
    if point.dtype.kind in "fiu" and point.shape == (2,):
        x, y = float(point[0]), float(point[1])
        if abs(x) <= known.MAX_COORDINATE and abs(y) <= known.MAX_COORDINATE:
            return (x, y)
    raise TerrainError(
        f"origin is {value!s:.60}; it must be two numbers in m, x and y of the centre of cell "
        f"[0, 0], within {known.MAX_COORDINATE:g}"
    )


def _as_grid(
    name: str, values: ArrayLike, largest: float, elevation: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Return a grid as C-contiguous float64 after checking type, shape and largest value.

    A layer must have the shape of the `elevation`.
    """
    grid = np.asarray(values)
    if grid.dtype.kind not in "fiu":
        raise TerrainError(f"{name} has type {grid.dtype}; it must be an array of numbers")
    if grid.ndim != 2 or min(grid.shape) < 2:
        raise TerrainError(
            f"{name} has shape {grid.shape}; it must be (ny, nx), at least 2 rows and 2 columns"
        )
    grid = np.ascontiguousarray(grid, dtype=np.float64)
    must = f"finite and within {largest:g}, or NaN where unknown"
    _refuse_first(grid, (grid > largest) | (grid < -largest), name, must)
    if elevation is not None:
        _check_shape(name, grid, elevation)
    return grid


def _check_shape(name: str, layer: NDArray[Any], elevation: NDArray[np.float64]) -> None:
    """Raise an error if a layer does not have the shape of the elevation."""
    if layer.shape != elevation.shape:
        raise TerrainError(
            f"{name} has shape {layer.shape}; it must be that of elevation, {elevation.shape}"
        )


def _refuse_first(grid: NDArray[Any], bad: NDArray[np.bool_], name: str, must: str) -> None:
    """Raise an error that names the first bad cell, if there is one."""
    if bad.any():
        row, column = (int(k) for k in np.argwhere(bad)[0])
        value = grid[row, column]
        raise TerrainError(f"{name}[{row}, {column}] is {value}; it must be {must}")
