# SPDX-License-Identifier: Apache-2.0
"""Converts elevation maps: PointCloud2 to Terrain and back.

Points are read from the message without a copy. If they form a regular grid row by row, their
heights become the terrain directly. Otherwise each point is assigned to the nearest cell centre.
A regular grid in any order keeps its own cells, so that a terrain that is published as a cloud is
read back unchanged.
"""

import array
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2, PointField

from msg_adapters.errors import MessageError
from msg_adapters.gridding import (
    CELL_HEIGHTS,
    CloudGrid,
    Raster,
    check_extent,
    check_precision,
    combine,
    detect_grid,
    detect_raster,
    lay_out_cells,
    make_terrain,
    rounding_error,
    typical_spacing,
)
from rover_physics.numerics.plausible import MAX_RESOLUTION, MIN_RESOLUTION
from rover_physics.numerics.quiet import quiet
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.layers import GRID_LAYERS

LAYERS = {layer.field: name for name, layer in GRID_LAYERS.items() if layer.field}
"""Fields of a cloud besides x, y and z, and the layers of the terrain that they become."""

MAX_POINT_STEP = 1_000_000
"""Largest size of a point [bytes]."""

_NAMES = ("INT8", "UINT8", "INT16", "UINT16", "INT32", "UINT32", "FLOAT32", "FLOAT64")
_DATATYPE_NAMES = {getattr(PointField, name): name for name in _NAMES}
_NUMBERS = {datatype: np.dtype(name.lower()).str[1:] for datatype, name in _DATATYPE_NAMES.items()}
_FLOATS = {datatype: kind for datatype, kind in _NUMBERS.items() if kind.startswith("f")}


PointMove = tuple[NDArray[np.float64], NDArray[np.float64]]
"""R (3, 3) and t (3,) [m]: a point p of a sensor's frame is at R p + t in that of the map."""


@quiet
def terrain_from_point_cloud(
    cloud: PointCloud2,
    resolution: float = 0.0,
    cell_height: str = "max",
    move: PointMove | None = None,
) -> Terrain:
    """Grid a cloud onto square cells; a cell without a point is unknown (NaN).

    Args:
        cloud: Points in the map frame, z up [m], or in the sensor's frame of `move`. A point
            without a finite height is unknown ground. A point without finite x and y is ignored.
        resolution: Cell size [m]. 0 uses the spacing of the points, which must then form a
            regular grid along x and y. Irregular points need a resolution above 0; their cells
            are centred on multiples of it.
        cell_height: How the points of a cell are combined. "max" keeps the top of every obstacle,
            which is safe; it raises noisy ground by about the noise and narrows a ditch by up
            to a cell. "mean" is unbiased on plain ground and lowers the edges of obstacles.
            "median" also ignores stray points, and loses obstacles below half of a cell's points.
        move: Moves the points to the map frame. They need a resolution above 0 then, as points of
            a sensor form no grid in the map.

    Raises:
        MessageError: The cloud cannot be read, has no valid point or one beyond MAX_COORDINATE,
            is not a regular grid although the resolution is 0, has coordinates rounded more
            coarsely than its cells, or needs more than MAX_CELLS cells.
        TerrainError: The cells do not form a valid terrain.
    """
    if cell_height not in CELL_HEIGHTS:
        raise MessageError(f"cell_height is {cell_height!r}; it must be one of {CELL_HEIGHTS}")
    if resolution != 0.0 and not MIN_RESOLUTION <= resolution <= MAX_RESOLUTION:
        raise MessageError(
            f"resolution is {resolution} m; it must be positive, or 0 to detect it, and from "
            f"{MIN_RESOLUTION:g} to {MAX_RESOLUTION:g}"
        )
    points = _view_points(cloud)
    raster = detect_raster(points["x"], points["y"]) if move is None else None
    if raster is not None and _is_wanted(raster.grid, resolution):
        return _terrain_of_raster(points, raster)
    return _terrain_of_scatter(points, resolution, cell_height, move)


def _is_wanted(grid: CloudGrid, resolution: float) -> bool:
    """Return whether a detected grid has the requested resolution; 0 accepts any."""
    return resolution == 0.0 or abs(grid.resolution - resolution) <= 1e-3 * resolution


def _terrain_of_raster(points: NDArray[np.void], raster: Raster) -> Terrain:
    """Make a terrain whose cells are the points of a raster."""
    elevation = raster.arrange(points["z"])
    if not np.isfinite(elevation).any():
        raise MessageError(f"none of the cloud's {elevation.size} points has finite x, y and z")
    there = [name for name in LAYERS if name in (points.dtype.names or ())]
    layers = {LAYERS[name]: raster.arrange(points[name]) for name in there}
    return make_terrain(elevation, raster.grid.resolution, raster.grid.origin, layers)


def _terrain_of_scatter(
    points: NDArray[np.void], resolution: float, cell_height: str, move: PointMove | None
) -> Terrain:
    """Make a terrain of irregular points; each is assigned to the nearest cell centre."""
    columns = {name: points[name].astype(np.float64).ravel() for name in points.dtype.names or ()}
    xyz = np.column_stack([columns["x"], columns["y"], columns["z"]])
    precision = rounding_error(points["x"], points["y"])
    if move is not None:
        xyz = xyz @ move[0].T + move[1]  # NaN where a coordinate is
        precision = rounding_error(points["x"], points["y"], points["z"])
    placed = np.isfinite(xyz[:, :2]).all(axis=1)
    known = placed & np.isfinite(xyz[:, 2])
    if not known.any():
        raise MessageError(f"none of the cloud's {len(known)} points has finite x, y and z")
    xy = xyz[placed, :2]
    check_extent(xy)
    grid = detect_grid(xy, precision)
    if resolution > 0.0 and (grid is None or not _is_wanted(grid, resolution)):
        check_precision(xy, precision, resolution)
        grid = lay_out_cells(xy, resolution)
    if grid is None:
        # A grid is found if its spacing is above 4 rounding errors.
        check_precision(xy, 4.0 * precision, 0.5 * typical_spacing(xy))
        raise MessageError(
            "the cloud's points form no regular grid along x and y, so the cell size must be "
            f"given: set map_resolution, for these points about {typical_spacing(xy):.2g} m"
        )
    at, rows = grid.cells(xyz[known, :2])
    cells = rows * grid.columns + at
    elevation = combine(cells, xyz[known, 2], grid, cell_height)
    if "friction" in columns:
        columns["friction"][~np.isfinite(columns["friction"])] = np.nan
    layers = {
        layer: combine(cells, columns[name][known], grid, GRID_LAYERS[layer].combined)
        for name, layer in LAYERS.items()
        if name in columns
    }
    return make_terrain(elevation, grid.resolution, grid.origin, layers)


def terrain_to_point_cloud(
    terrain: Terrain,
    frame_id: str,
    stamp=None,
    more: Mapping[str, NDArray[Any]] | None = None,
) -> PointCloud2:
    """Convert a terrain into an organised cloud, one point per cell, row 0 first.

    Args:
        terrain: Unknown cells become points with NaN height, so that the shape is kept. Values are
            FLOAT32, which viewers can show and which rounds heights.
        frame_id: Frame of the map.
        stamp: builtin_interfaces/Time, zero if None.
        more: Further fields by name, (ny, nx) each.
    """
    rows, columns = terrain.elevation.shape
    fields = {name: getattr(terrain, layer) for name, layer in LAYERS.items()} | dict(more or {})
    layers = [name for name in fields if fields[name] is not None]
    names = ["x", "y", "z", *layers]
    kind = np.dtype("<f4")
    values = np.empty((rows, columns, len(names)), kind)
    values[:, :, 0] = terrain.origin[0] + terrain.resolution * np.arange(columns)
    values[:, :, 1] = (terrain.origin[1] + terrain.resolution * np.arange(rows))[:, None]
    values[:, :, 2] = terrain.elevation
    for column, name in enumerate(layers, start=3):
        values[:, :, column] = fields[name]
    cloud = PointCloud2(height=rows, width=columns, is_bigendian=False, is_dense=False)
    cloud.header.frame_id = frame_id
    if stamp is not None:
        cloud.header.stamp = stamp
    cloud.fields = [
        PointField(name=name, offset=i * kind.itemsize, datatype=PointField.FLOAT32, count=1)
        for i, name in enumerate(names)
    ]
    cloud.point_step = len(names) * kind.itemsize
    cloud.row_step = columns * cloud.point_step
    cloud.data = array.array("B")
    cloud.data.frombytes(values.tobytes())
    return cloud


def _view_points(cloud: PointCloud2) -> NDArray[np.void]:
    """Return a structured view (height, width) of the points in a cloud, by field name."""
    row_step = _check_layout(cloud)
    names = ["x", "y", "z"]
    fields = {field.name: field for field in cloud.fields}
    for name in (*names, *LAYERS):
        if sum(field.name == name for field in cloud.fields) > 1:
            raise MessageError(f"cloud has two fields {name}; it must have one")
    missing = [name for name in names if name not in fields]
    if missing:
        has = ", ".join(fields) or "none"
        raise MessageError(
            f"cloud has no field {', '.join(missing)}; it needs x, y and z, and has {has}"
        )
    names += [name for name in LAYERS if name in fields]
    point = np.dtype(
        {
            "names": names,
            "formats": [_field_format(fields[name], cloud) for name in names],
            "offsets": [fields[name].offset for name in names],
            "itemsize": cloud.point_step,
        }
    )
    return np.ndarray(
        (cloud.height, cloud.width),
        point,
        buffer=np.frombuffer(cloud.data, np.uint8),
        strides=(row_step, cloud.point_step),
    )


def _check_layout(cloud: PointCloud2) -> int:
    """Check that sizes and steps agree with the data; return the row step in bytes."""
    if cloud.height * cloud.width == 0:
        raise MessageError(f"cloud has no points: height {cloud.height}, width {cloud.width}")
    if cloud.point_step == 0:
        raise MessageError("cloud has point_step 0; it must be the size of a point in bytes")
    if cloud.point_step > MAX_POINT_STEP:
        raise MessageError(
            f"cloud has point_step {cloud.point_step}; it must be the size of a point in bytes, "
            f"at most {MAX_POINT_STEP}"
        )
    row_bytes = cloud.width * cloud.point_step
    row_step = cloud.row_step
    if row_step == 0 and cloud.height == 1:
        row_step = row_bytes
    if row_step < row_bytes:
        raise MessageError(
            f"cloud has row_step {row_step}; {cloud.width} points of {cloud.point_step} bytes "
            f"need at least {row_bytes}"
        )
    if len(cloud.data) != cloud.height * row_step:
        raise MessageError(
            f"cloud has {len(cloud.data)} bytes of data; height {cloud.height} x row_step "
            f"{row_step} needs {cloud.height * row_step}"
        )
    return row_step


def _field_format(field: PointField, cloud: PointCloud2) -> str:
    """Return the numpy format of a field in its byte order."""
    kinds, must = _FLOATS, "FLOAT32 or FLOAT64, in metres"
    if field.name in LAYERS and GRID_LAYERS[LAYERS[field.name]].is_class:
        kinds, must = _NUMBERS, f"one of {', '.join(_DATATYPE_NAMES.values())}"
    if field.datatype not in kinds:
        datatype = _DATATYPE_NAMES.get(field.datatype, str(field.datatype))
        raise MessageError(f"cloud field {field.name} has datatype {datatype}; it must be {must}")
    if field.count > 1:
        raise MessageError(f"cloud field {field.name} has count {field.count}; it must be 1")
    kind = kinds[field.datatype]
    if field.offset + int(kind[1]) > cloud.point_step:
        raise MessageError(
            f"cloud field {field.name} at offset {field.offset} does not fit into "
            f"point_step {cloud.point_step}"
        )
    return (">" if cloud.is_bigendian else "<") + kind
