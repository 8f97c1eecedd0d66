# SPDX-License-Identifier: Apache-2.0
"""Converts GridMap messages (grid_map_msgs) to Terrain; needs none of their packages.

Any object with the fields of grid_map_msgs/GridMap will do. In such a map rows run along -x and
columns along -y, from the corner of largest x and y, and the storage is a circular buffer whose
start indices tell where that corner is.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msg_adapters.errors import MessageError
from msg_adapters.gridding import MAX_CELLS, make_terrain
from rover_physics.numerics.plausible import MAX_RESOLUTION, MIN_RESOLUTION
from rover_physics.numerics.quiet import quiet
from rover_physics.terrain.grid import Terrain

ROW, COLUMN = "row_index", "column_index"
"""Labels of the two dimensions of a layer."""
MAX_TURN = 1e-6
"""Largest turn of the map's axes against those of its frame [rad]."""
MAX_LENGTH_ERROR = 1e-3
"""Largest difference of a length from the number of its cells [cells]."""


@dataclass(frozen=True)
class GridMapLayers:
    """Names of the layers of a GridMap that are used."""

    elevation: str = "elevation"
    """Heights [m]; the map must have it."""
    variance: str = "variance"
    """Variances of the heights [m^2]; a map without this layer has exact heights."""
    friction: str = "friction"
    """Coulomb friction coefficients; a map without this layer has the default."""
    ground_class: str = "class"
    """Classes of ground, whole numbers from 0; a map without this layer has none."""


@quiet
def terrain_from_grid_map(message: Any, layers: GridMapLayers | None = None) -> Terrain:
    """Convert a GridMap into a terrain with the same cells.

    A cell is unknown where the elevation or one of the message's basic layers is not finite, or
    where the map has variances and that of the cell is not finite.

    Args:
        message: grid_map_msgs/GridMap, or an object with the same fields. Its storage may be
            column-major, as grid_map writes it, or row-major, as the labels of the layout tell.
        layers: The names of the layers; None takes the defaults of `GridMapLayers`.

    Raises:
        MessageError: No elevation layer or no finite height in it, a turned map, lengths,
            sizes, start indices or a layout that disagree, or a variance below 0.
        TerrainError: The cells do not form a valid terrain.
    """
    layers = layers or GridMapLayers()
    rows, columns = _shape_of(message.info)
    _check_not_turned(message.info.pose.orientation)
    names = list(message.layers)
    if len(names) != len(message.data):
        raise MessageError(f"grid map has {len(names)} layers and {len(message.data)} arrays")
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise MessageError(f"grid map has two layers {twice!r}; names must differ")
    if layers.elevation not in names:
        there = ", ".join(names)[:200] or "none"
        raise MessageError(
            f"grid map has no layer {layers.elevation!r}; it has {there}: set elevation_layer to "
            "that of the heights"
        )
    start = _start_of(message, rows, columns)

    def read(name: str) -> NDArray[np.float64]:
        values = _cells_of(message.data[names.index(name)], name, (rows, columns))
        return _unroll(values, start)

    elevation = read(layers.elevation)
    unknown = ~np.isfinite(elevation)
    for basic in message.basic_layers:
        if basic not in names:
            raise MessageError(f"grid map names the basic layer {basic!r}, which it does not have")
        unknown |= ~np.isfinite(read(basic))
    found: dict[str, NDArray[np.float64]] = {}
    if layers.variance in names:
        variance = read(layers.variance)
        if (variance < 0.0).any():
            lowest = float(variance[variance < 0.0].min())
            raise MessageError(
                f"grid map has {lowest:g} in layer {layers.variance!r}; a variance must be at "
                "least 0, in m^2"
            )
        unknown |= ~np.isfinite(variance)
        found["elevation_std"] = np.sqrt(variance)
    if unknown.all():
        raise MessageError(f"none of the grid map's {unknown.size} cells has a known height")
    elevation[unknown] = np.nan
    if layers.friction in names:
        found["friction"] = read(layers.friction)
    if layers.ground_class in names:
        found["ground_class"] = read(layers.ground_class)
    place, size = message.info.pose.position, message.info.resolution
    origin = (
        float(place.x) - 0.5 * (elevation.shape[1] - 1) * size,
        float(place.y) - 0.5 * (elevation.shape[0] - 1) * size,
    )
    return make_terrain(elevation, float(size), origin, found)


def _shape_of(info: Any) -> tuple[int, int]:
    """Return the number of rows, along x, and of columns, along y."""
    resolution = float(info.resolution)
    if not MIN_RESOLUTION <= resolution <= MAX_RESOLUTION:
        raise MessageError(
            f"grid map has resolution {resolution}; it must be the size of a cell in m, from "
            f"{MIN_RESOLUTION:g} to {MAX_RESOLUTION:g}"
        )
    counts = []
    for name in ("length_x", "length_y"):
        length = float(getattr(info, name))
        cells = length / resolution
        if not (math.isfinite(cells) and abs(cells - round(cells)) <= MAX_LENGTH_ERROR * cells):
            raise MessageError(
                f"grid map has {name} {length}, which is {cells:g} cells of {resolution} m; it "
                "must be a whole number of cells"
            )
        counts.append(round(cells))
    if min(counts) < 1 or counts[0] * counts[1] > MAX_CELLS:
        raise MessageError(
            f"grid map has {counts[0]} x {counts[1]} cells; it must have at least one, and at "
            f"most {MAX_CELLS}"
        )
    return counts[0], counts[1]


def _check_not_turned(orientation: Any) -> None:
    """Refuse a map whose axes are not those of its frame; a quaternion of zeros is not set."""
    xyzw = [float(getattr(orientation, name)) for name in "xyzw"]
    if not any(xyzw):
        return
    turn = 2.0 * max(abs(value) for value in xyzw[:3])
    if not (turn <= MAX_TURN and abs(abs(xyzw[3]) - 1.0) <= MAX_TURN):
        raise MessageError(
            f"grid map is turned: its orientation is {xyzw} (x, y, z, w); its axes must be "
            "those of its frame, orientation (0, 0, 0, 1)"
        )


def _start_of(message: Any, rows: int, columns: int) -> tuple[int, int]:
    """Return row and column of the buffer at which the map starts."""
    start = int(message.outer_start_index), int(message.inner_start_index)
    if not (0 <= start[0] < rows and 0 <= start[1] < columns):
        raise MessageError(
            f"grid map starts at row {start[0]} and column {start[1]} of its buffer, which has "
            f"{rows} rows and {columns} columns"
        )
    return start


def _cells_of(array: Any, name: str, shape: tuple[int, int]) -> NDArray[np.float32]:
    """Return the values of a layer as stored, (rows, columns) of the message."""
    dim, offset = list(array.layout.dim), int(array.layout.data_offset)
    labels = tuple(one.label for one in dim)
    if labels not in ((COLUMN, ROW), (ROW, COLUMN)):
        raise MessageError(
            f"grid map layer {name!r} has dimensions {list(labels)}; they must be "
            f"{[COLUMN, ROW]} (column-major) or {[ROW, COLUMN]}"
        )
    by_columns = labels[0] == COLUMN
    sizes = tuple(int(one.size) for one in dim)
    right = shape[::-1] if by_columns else shape
    data = np.asarray(array.data)
    if sizes != right or len(data) != offset + shape[0] * shape[1]:
        raise MessageError(
            f"grid map layer {name!r} has sizes {list(sizes)} and {len(data)} values; lengths "
            f"and resolution need {list(right)} and {offset + shape[0] * shape[1]}"
        )
    cells = data[offset:].reshape(right)
    return cells.T if by_columns else cells


def _unroll(values: NDArray[Any], start: tuple[int, int]) -> NDArray[np.float64]:
    """Return (ny, nx) with x and y ascending from values (rows, columns) as stored."""
    ordered = np.roll(values, (-start[0], -start[1]), (0, 1))
    return np.array(ordered[::-1, ::-1].T, dtype=np.float64, order="C")
