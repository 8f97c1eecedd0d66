# SPDX-License-Identifier: Apache-2.0
"""Layers of a survey as cloud-optimised GeoTIFF (COG) files."""

import contextlib
import math
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rover_physics.files.validation import show_file
from rover_planner.errors import PlanningError
from rover_planner.survey.geotiff import BAND, find_missing_block, import_rasterio
from rover_planner.survey.map_source import MapFrame
from rover_planner.survey.store import SurveyStore

REASONS = ("_tiffWriteProc: ", "_tiffSeekProc: ")
"""Beginnings of lines of GDAL's TIFF library that say why the system refused to write."""


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
    is_float = layer.dtype.kind == "f"
    profile = {
        "driver": "GTiff",
        "width": columns,
        "height": rows,
        "count": 1,
        "dtype": layer.dtype.name,
        "transform": rasterio.Affine(size, 0.0, left, 0.0, -size, low + rows * size),
        "nodata": math.nan if is_float else None,
        "tiled": True,
        "compress": "deflate",
        "BIGTIFF": "IF_SAFER",
    }
    if frame.crs:
        profile["crs"] = frame.crs
    try:
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as folder:
            whole = Path(folder) / "whole.tif"
            _write_aside(Path(folder) / "plain.tif", whole, layer, profile)
            whole.replace(path)
    except OSError as error:
        why = error.strerror or str(error)
        raise PlanningError(f"{show_file(path)}: cannot be written: {why}") from None


def _write_aside(plain: Path, whole: Path, layer: Any, profile: dict[str, Any]) -> None:
    """Write a layer as a plain GeoTIFF, and that as a COG which is whole and on the disk.

    Raises:
        OSError: The system refuses, in the words of GDAL if it gives no others.
    """
    rasterio = import_rasterio()
    from rasterio.shutil import copy

    rows, columns = layer.shape
    why = ""
    with catch_messages() as messages:
        try:
            with rasterio.open(plain, "w", **profile) as file:
                for first in range(0, rows, BAND):
                    end = min(first + BAND, rows)
                    window = rasterio.windows.Window(0, rows - end, columns, end - first)
                    file.write(layer[first:end][::-1], 1, window=window)
            copy(plain, whole, driver="COG", compress="deflate", overview_resampling="nearest")
            with rasterio.open(whole) as file:  # GDAL does not tell of all that it could not write
                why = find_missing_block(file, whole)
        except Exception as error:  # some errors of GDAL have no public name
            why = str(error)
    why = find_reason(messages) or why
    if why:
        raise OSError(why)
    with whole.open("rb") as done:
        os.fsync(done.fileno())


def write_layers(store: SurveyStore, folder: Path) -> None:
    """Write each layer of a survey as LAYER.tif, with the georeference of the map.

    Raises:
        PlanningError: A file cannot be written.
    """
    make_folder(folder)
    for name in store.layer_names():
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


@contextlib.contextmanager
def catch_messages() -> Iterator[list[str]]:
    """Keep what the process writes to its stderr meanwhile; yield a list that has it at the end.

    GDAL's TIFF library writes there by itself. Python's own warnings would be caught, too, so
    little should be done meanwhile.
    """
    lines: list[str] = []
    try:
        before = os.dup(2)
    except OSError:  # a closed stderr tells nothing
        yield lines
        return
    caught = os.memfd_create("stderr")  # not on a disk, as that may be full
    os.dup2(caught, 2)
    try:
        yield lines
    finally:
        os.dup2(before, 2)
        os.close(before)
        with open(caught, "rb") as file:
            file.seek(0)
            lines += file.read().decode(errors="replace").splitlines()


def find_reason(lines: list[str]) -> str:
    """Return why the system refused to write, as "No space left on device"; empty if unsaid."""
    for line in lines:
        for start in REASONS:
            if line.startswith(start):
                return line.removeprefix(start).rstrip(".")
    return ""
