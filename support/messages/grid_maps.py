# SPDX-License-Identifier: Apache-2.0
"""GridMap messages for tests: objects with the fields of grid_map_msgs/GridMap."""

import copy
from types import SimpleNamespace
from typing import Any

import numpy as np


def grid_map_of(
    layers: dict[str, np.ndarray],
    resolution: float = 0.05,
    centre: tuple[float, float] = (0.0, 0.0),
    basic: tuple[str, ...] = ("elevation",),
) -> Any:
    """Return a column-major GridMap, as grid_map stores it, of layers (ny, nx), x, y ascending."""
    ny, nx = next(iter(layers.values())).shape
    header = SimpleNamespace(stamp=SimpleNamespace(sec=0, nanosec=0), frame_id="map")
    position = SimpleNamespace(x=centre[0], y=centre[1], z=0.0)
    orientation = SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0)
    info = SimpleNamespace(
        resolution=resolution,
        length_x=nx * resolution,
        length_y=ny * resolution,
        pose=SimpleNamespace(position=position, orientation=orientation),
    )
    data = []
    for values in layers.values():
        stored = np.asarray(values, np.float32)[::-1, ::-1].T  # rows along -x, columns along -y
        data.append(_array(stored.ravel(order="F"), ("column_index", ny), ("row_index", nx)))
    return SimpleNamespace(
        header=header,
        info=info,
        layers=list(layers),
        basic_layers=[name for name in basic if name in layers],
        data=data,
        outer_start_index=0,
        inner_start_index=0,
    )


def move_buffer(message: Any, row: int, column: int) -> Any:
    """Return a column-major map whose circular buffer starts at another row and column."""
    moved = copy.deepcopy(message)
    for array in moved.data:
        columns, rows = (dim.size for dim in array.layout.dim)
        cells = np.reshape(array.data, (rows, columns), order="F")
        array.data = np.roll(cells, (row, column), (0, 1)).ravel(order="F")
    moved.outer_start_index, moved.inner_start_index = row, column
    return moved


def store_by_rows(message: Any) -> Any:
    """Return a column-major map in row-major storage."""
    stored = copy.deepcopy(message)
    for array in stored.data:
        columns, rows = (dim.size for dim in array.layout.dim)
        cells = np.reshape(array.data, (rows, columns), order="F")
        array.layout = _array(cells.ravel(), ("row_index", rows), ("column_index", columns)).layout
        array.data = cells.ravel()
    return stored


def _array(values: np.ndarray, *dims: tuple[str, int]) -> Any:
    sizes = [size for _, size in dims]
    dim = [
        SimpleNamespace(label=label, size=size, stride=int(np.prod(sizes[k:])))
        for k, (label, size) in enumerate(dims)
    ]
    return SimpleNamespace(layout=SimpleNamespace(dim=dim, data_offset=0), data=values)
