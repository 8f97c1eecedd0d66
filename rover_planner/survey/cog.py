# SPDX-License-Identifier: Apache-2.0
"""Layers of a survey as cloud-optimised GeoTIFF (COG) files."""

import math
from pathlib import Path
from typing import Any

from rover_physics.files.user_file import writing
from rover_physics.files.validation import errors_of, show_file
from rover_planner.errors import PlanningError
from rover_planner.survey.map_source import BAND, MapFrame, import_rasterio
from rover_planner.survey.store import SurveyStore, force_to_disk


def write_cog(path: Path, layer: Any, frame: MapFrame, step: int) -> None:
    """Write a layer of a survey as a cloud-optimised GeoTIFF with the map's georeference.

    Its overviews have values of the layer, as there is nothing between classes, bits or limits.

    Args:
        path: File to write; an existing one is replaced.
        layer: (rows, columns) array, such as of Zarr; row 0 at the smallest y.
        frame: Where the cells of the map are.
        step: Distance of surveyed cells [map cells]; they are the middles of its cells.

    Raises:
        PlanningError: The file cannot be written.
    """
    rasterio = import_rasterio()
    rows, columns = layer.shape
    size = step * frame.resolution
    left, low = (start - 0.5 * size for start in frame.origin)
    profile = {
        "driver": "COG",
        "width": columns,
        "height": rows,
        "count": 1,
        "dtype": layer.dtype.name,
        "transform": rasterio.Affine(size, 0.0, left, 0.0, -size, low + rows * size),
        "nodata": math.nan if layer.dtype.kind == "f" else None,
        "compress": "deflate",
        "overview_resampling": "nearest",
    } | ({"crs": frame.crs} if frame.crs else {})
    # In memory, as GDAL does not tell of all that it could not write to a disk.
    with rasterio.MemoryFile() as whole:
        with whole.open(**profile) as file:
            for first in range(0, rows, BAND):
                end = min(first + BAND, rows)
                window = rasterio.windows.Window(0, rows - end, columns, end - first)
                file.write(layer[first:end][::-1], 1, window=window)
        _replace(path, whole.getbuffer())


def _replace(path: Path, content: memoryview) -> None:
    """Write a file, or leave what is there where the system refuses."""
    aside = path.with_name(f".{path.name}.new")
    try:
        with errors_of(path, PlanningError), writing():
            aside.write_bytes(content)
            force_to_disk(aside, path.parent)
            aside.replace(path)
    finally:
        aside.unlink(missing_ok=True)


def write_layers(store: SurveyStore, folder: Path) -> None:
    """Write each layer of a survey as LAYER.tif, with the georeference of the map.

    Raises:
        PlanningError: A file cannot be written.
    """
    make_folder(folder)
    for name in store.notes.layers:
        write_cog(
            folder / f"{name}.tif", store.layer(name), store.notes.frame, store.notes.layout.step
        )


def make_folder(folder: Path) -> None:
    """Make a folder for layers, if there is none.

    Raises:
        PlanningError: It cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise PlanningError(f"{show_file(folder)}: cannot be made: {error.strerror}") from None
