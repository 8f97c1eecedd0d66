# SPDX-License-Identifier: Apache-2.0
"""Square cells for the points of a cloud, from a detected regular grid or a given resolution.

Points in row order, as in most maps, are recognised without a copy. Points in any other order are
sorted along x and along y.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from msg_adapters.errors import MessageError
from rover_physics.numerics.arrays import seal_array
from rover_physics.numerics.plausible import MAX_COORDINATE, MIN_RESOLUTION
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.layers import GRID_LAYERS, MOST_FREQUENT

MAX_CELLS = 25_000_000
"""Largest map built from a cloud [cells]; one distant outlier must not exhaust the memory."""

CELL_HEIGHTS = ("max", "mean", "median")
"""Methods that combine several points of a cell into its height."""

_MIN_FILL = 0.05
"""Smallest share of cells with a point in a detected grid; below it the spacing is accidental."""

_MAX_OFF_CENTRE = 0.02
"""Largest distance between a regular grid's points and their cell centres [cells]."""


@dataclass(frozen=True)
class CloudGrid:
    """Square cells that hold all points of a cloud."""

    resolution: float
    origin: tuple[float, float]
    columns: int
    rows: int

    def cells(self, xy):
        """Return the column (n,) and row (n,) of points (n, 2) [m]."""
        index = np.rint((xy - self.origin) / self.resolution).astype(np.int64)
        return index[:, 0], index[:, 1]


@dataclass(frozen=True)
class Raster:
    """A regular grid whose points are stored row by row or column by column."""

    grid: CloudGrid
    """The cells; each has one point."""
    shape: tuple[int, int]
    """Shape (h, w) of the points in the message."""
    by_columns: bool
    """True if y, not x, changes from one point of a message row to the next."""
    descending: tuple[bool, bool]
    """True for x, for y where it decreases along the points."""

    def arrange(self, values: NDArray[Any]) -> NDArray[np.float64]:
        """Return values (h, w) of the points as (rows, columns), with x and y ascending."""
        values = values.reshape(self.shape)
        values = values.T if self.by_columns else values
        x_step, y_step = (-1 if descends else 1 for descends in self.descending)
        return np.array(values[::y_step, ::x_step], dtype=np.float64, order="C")


def detect_raster(x: NDArray[Any], y: NDArray[Any]) -> Raster | None:
    """Return the regular grid of points (h, w) [m] in message order, None if there is none."""
    by_columns = x.size > 1 and y.flat[0] != y.flat[1]
    inner, outer = (y, x) if by_columns else (x, y)
    if inner.shape[0] == 1:
        changes = outer[0] != outer[0, 0]
        width = int(np.argmax(changes)) or outer.size
        if outer.size % width:
            return None
        inner, outer = inner.reshape(-1, width), outer.reshape(-1, width)
    if not ((inner == inner[:1]).all() and (outer == outer[:, :1]).all()):
        return None
    x_axis, y_axis = (outer[:, 0], inner[0]) if by_columns else (inner[0], outer[:, 0])
    if not (np.isfinite(x_axis).all() and np.isfinite(y_axis).all()):
        return None
    check_extent(x_axis, y_axis)
    noise = 4.0 * rounding_error(x_axis, y_axis)
    x_axis, y_axis = x_axis.astype(np.float64), y_axis.astype(np.float64)
    grid = _fit_grid(x_axis, y_axis, inner.size, noise)
    if grid is None or (grid.columns, grid.rows) != (len(x_axis), len(y_axis)):
        return None
    descending = bool(x_axis[0] > x_axis[-1]), bool(y_axis[0] > y_axis[-1])
    for axis, descends, origin in zip((x_axis, y_axis), descending, grid.origin, strict=True):
        centres = origin + grid.resolution * np.arange(len(axis))
        off_centre = np.abs(axis[:: -1 if descends else 1] - centres).max()
        if not off_centre <= _tolerance(grid.resolution, noise):
            return None
    return Raster(grid, inner.shape, by_columns, descending)


def detect_grid(xy: NDArray[np.float64], precision: float) -> CloudGrid | None:
    """Detect the regular grid along x and y of points (n, 2); return None if there is none.

    Args:
        xy: Points in any order [m].
        precision: Rounding error of the coordinates [m].
    """
    noise = 4.0 * precision
    grid = _fit_grid(xy[:, 0], xy[:, 1], len(xy), noise)
    if grid is None:
        return None
    index = np.rint((xy - grid.origin) / grid.resolution)
    off_centre = np.abs(xy - (grid.origin + index * grid.resolution)).max()
    columns, rows = grid.cells(xy)
    single = np.bincount(rows * grid.columns + columns).max() == 1
    return grid if single and off_centre <= _tolerance(grid.resolution, noise) else None


def check_extent(*coordinates: NDArray[Any]) -> None:
    """Check that coordinates [m] are plausible; ignores NaN and infinity.

    Raises:
        MessageError: A coordinate beyond MAX_COORDINATE.
    """
    for values in coordinates:
        beyond = np.isfinite(values) & (np.abs(values) > MAX_COORDINATE)
        if beyond.any():
            raise MessageError(
                f"cloud has a point at {float(values[beyond].flat[0]):.4g} m; x and y must be "
                f"within {MAX_COORDINATE:g} m: remove stray points"
            )


def rounding_error(*coordinates: NDArray[Any]) -> float:
    """Return the rounding error [m] of coordinates in their type; ignores NaN and infinity."""
    extent = 1.0
    for values in coordinates:
        extent = max(extent, float(np.abs(values[np.isfinite(values)]).max(initial=0.0)))
    single = any(values.dtype.itemsize == 4 for values in coordinates)
    return float(np.finfo(np.float32 if single else np.float64).eps * extent)


def _fit_grid(x, y, points: int, noise: float) -> CloudGrid | None:
    """Fit cells to the distinct x and y values of a number of points; return None if none fit."""
    along_x, along_y = _detect_axis(x, noise), _detect_axis(y, noise)
    if along_x is None or along_y is None:
        return None
    steps = [step for _, step in (along_x, along_y) if step > 0.0]
    if not steps:
        return None
    spans = np.ptp(x), np.ptp(y)
    fitted = steps[0] if spans[0] >= spans[1] else steps[-1]
    if fitted < MIN_RESOLUTION:
        raise MessageError(
            f"cloud has points {fitted:.3g} m apart; a map has cells of {MIN_RESOLUTION:g} m or "
            "more: set map_resolution, and check that the coordinates are in metres"
        )
    if any(abs(step - fitted) > _MAX_OFF_CENTRE * fitted for step in steps):
        return None
    counts = [round(span / fitted) + 1 for span in spans]
    if points < _MIN_FILL * counts[0] * counts[1]:
        return None
    _check_size(counts[0] * counts[1], spans, fitted)
    resolution = _round_within(fitted, noise / max(counts))
    origin = (_round_within(along_x[0], noise), _round_within(along_y[0], noise))
    return CloudGrid(resolution, origin, counts[0], counts[1])


def _tolerance(resolution: float, noise: float) -> float:
    """Return the largest distance of a regular grid's points from their cell centres [m]."""
    return max(_MAX_OFF_CENTRE * resolution, noise)


def _detect_axis(values: NDArray[np.float64], noise: float) -> tuple[float, float] | None:
    """Return start and spacing of equidistant values, spacing 0 for one value; else None."""
    ordered = np.sort(values)
    starts = np.concatenate([[True], np.diff(ordered) > noise])
    distinct = ordered[starts]
    if len(distinct) == 1:
        return float(distinct[0]), 0.0
    gaps = np.diff(distinct)
    smallest = gaps.min()
    index = np.concatenate([[0.0], np.cumsum(np.rint(gaps / smallest))])
    if index[-1] > MAX_CELLS:
        return None
    step, first = np.polyfit(index, distinct, 1)
    residual = np.abs(distinct - (first + step * index)).max()
    if residual > max(_MAX_OFF_CENTRE * step, noise):
        return None
    return float(first), float(step)


def lay_out_cells(xy: NDArray[np.float64], resolution: float) -> CloudGrid:
    """Return cells for points (n, 2) [m], centred on multiples of the resolution [m]."""
    low, high = xy.min(axis=0), xy.max(axis=0)
    first = np.rint(low / resolution)
    counts = np.rint(high / resolution) - first + 1.0
    _check_size(float(counts.prod()), high - low, resolution)
    origin = first * resolution
    # `CloudGrid.cells` rounds halves of a cell otherwise than the lines above.
    origin += np.minimum(np.rint((low - origin) / resolution), 0.0) * resolution
    counts = np.maximum(counts, np.rint((high - origin) / resolution) + 1.0)
    return CloudGrid(
        resolution, (float(origin[0]), float(origin[1])), int(counts[0]), int(counts[1])
    )


def _check_size(cells: float, spans: Any, resolution: float) -> None:
    """Refuse a map of too many cells of a resolution [m] over spans (x, y) [m]."""
    if cells > MAX_CELLS:
        raise MessageError(
            f"cloud spans {spans[0]:.4g} m x {spans[1]:.4g} m, which at {resolution:g} m are "
            f"{cells:.3g} cells; a map may have {MAX_CELLS}: remove stray points or set "
            "a coarser map_resolution"
        )


def check_precision(xy: NDArray[np.float64], precision: float, cell: float) -> None:
    """Refuse points (n, 2) [m] whose rounding error moves them to other cells.

    Args:
        xy: Points [m].
        precision: Rounding error of the coordinates [m].
        cell: Size of the cells [m].

    Raises:
        MessageError: The coordinates are rounded more coarsely than the cells.
    """
    if precision > cell:
        farthest = float(np.abs(xy).max())
        raise MessageError(
            f"cloud has coordinates rounded to {precision:.2g} m, because they are as large as "
            f"{farthest:.4g} m in FLOAT32; for cells of {cell:.2g} m shift the origin of the map "
            "frame near the rover, or publish x and y as FLOAT64"
        )


def combine(cells, values, grid: CloudGrid, how: str) -> NDArray[np.float64]:
    """Combine the values (n,) of each cell; NaN in cells without a value."""
    size = grid.rows * grid.columns
    combined = np.full(size, np.nan)
    if how in ("max", "min"):
        (np.fmax if how == "max" else np.fmin).at(combined, cells, values)
    elif how == "median":
        some = np.flatnonzero(np.bincount(cells, minlength=size))
        combined[some] = ndimage.median(values, cells, some)
    elif how == MOST_FREQUENT:
        combined = most_frequent(cells, values, size)
    else:
        counts = np.bincount(cells, minlength=size)
        sums = np.bincount(cells, weights=values, minlength=size)
        combined = np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)
    return combined.reshape(grid.rows, grid.columns)


def most_frequent(cells, values, size: int) -> NDArray[np.float64]:
    """Return the most frequent of the values of each of `size` cells; NaN ones do not count.

    Of values that are equally frequent it is the largest.
    """
    known = np.isfinite(values)
    kinds, kind = np.unique(values[known], return_inverse=True)
    pairs, counts = np.unique(cells[known] * len(kinds) + kind, return_counts=True)
    pairs = pairs[np.argsort(counts, kind="stable")]
    found = np.full(size, np.nan)
    found[pairs // max(len(kinds), 1)] = kinds[pairs % max(len(kinds), 1)]
    return found


def typical_spacing(xy: NDArray[np.float64]) -> float:
    """Return a cell size [m] at which most cells would contain one of the points (n, 2)."""
    area = float(np.prod(np.ptp(xy, axis=0)))
    return 2.0 * math.sqrt(area / len(xy))


def _round_within(value: float, tolerance: float) -> float:
    """Return the shortest decimal within a tolerance of a value: 0.05 for 0.0500000003."""
    for digits in range(13):
        rounded = round(value, digits)
        if abs(rounded - value) <= tolerance:
            return rounded
    return value


def make_terrain(
    elevation: NDArray[np.float64],
    resolution: float,
    origin: tuple[float, float],
    layers: dict[str, NDArray[np.float64]],
) -> Terrain:
    """Make a terrain of new layers (ny, nx) without copying them; they become read-only.

    Where the height is not finite, neither height nor friction nor deviation are known. Friction
    that is not finite is none, nor are classes that are not finite or below 0.
    """
    unknown = ~np.isfinite(elevation)
    elevation[unknown] = np.nan
    for name, layer in layers.items():
        if GRID_LAYERS[name].is_class:
            layer[~np.isfinite(layer) | (layer < 0.0)] = np.nan
        else:
            layer[unknown] = np.nan
        if name == "friction":
            layer[~np.isfinite(layer)] = np.nan
    sealed: dict[str, Any] = {name: seal_array(layer) for name, layer in layers.items()}
    return Terrain(seal_array(elevation), resolution, origin, **sealed)
