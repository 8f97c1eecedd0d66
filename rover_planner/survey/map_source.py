# SPDX-License-Identifier: Apache-2.0
"""Maps that are read by windows: those kept in a store, and GeoTIFF files."""

import contextlib
import hashlib
import importlib.util
import math
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np

from rover_physics.files.validation import show_file
from rover_physics.numerics.plausible import MAX_COORDINATE
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.layers import GRID_LAYERS
from rover_planner.errors import PlanningError
from rover_planner.survey.layout import Box, Index

MAP = "map"
"""Group of a store that holds the map, where it comes from an .npz file."""
MAP_CHUNK = 512
"""Side of the chunks in which a map is kept [cells]."""
SUFFIXES = (".tif", ".tiff")
"""Suffixes of GeoTIFF files."""
METRES = ("", "m", "metre", "metres", "meter", "meters")
"""Names of the unit of heights that are read; a file without a unit is taken to be in metres."""
SQUARE = 1e-6
"""Largest difference of width and height of a cell, as a share."""
TURNED = 1e-6
"""Largest displacement of the far corner by a rotation, in cells."""
CELL_SIZES = (1e-5, 1e6)
"""Smallest and largest cell [m], as of a Terrain."""
UNDECLARED = (-9999.0, -32767.0, -32768.0, float(np.finfo(np.float32).min))
"""Values that programs write where they know no height; refused in a file that does not say so."""
BAND = 512
"""Rows that are read or written at a time."""

Grids = dict[str, np.ndarray]
"""Layers of a part of a map by name; row 0 at the smallest y."""


class MapFrame(NamedTuple):
    """Place and size of the cells of a map."""

    shape: Index
    """Rows and columns."""
    resolution: float
    """Cell size [m]."""
    origin: tuple[float, float]
    """x, y of the centre of cell [0, 0] [m]."""
    crs: str
    """Coordinate reference system as WKT, empty if unknown."""


@dataclass(frozen=True)
class StoredMap:
    """A map that is kept in the store of its survey."""

    group: Any
    """Group of the store that holds it."""

    @property
    def soil_names(self) -> tuple[str, ...]:
        """Names of the soils that the layer soil points to."""
        return tuple(self.group.attrs["soil_names"])

    def read(self, box: Box, every: int = 1) -> Grids:
        """Return the layers in a box of cells, every so many cells of them."""
        thin = tuple(slice(span.start, span.stop, every) for span in box)
        return {name: self.group[name][thin] for name in GRID_LAYERS if name in self.group}


def keep_map(group: Any, terrain: Terrain) -> None:
    """Write a terrain into a Zarr group, for `StoredMap`."""
    kept = group.create_group(MAP)
    for name in GRID_LAYERS:
        grid = getattr(terrain, name)
        if grid is not None:
            chunks = tuple(min(MAP_CHUNK, size) for size in grid.shape)
            kept.create_array(name, data=grid, chunks=chunks)
    kept.attrs["soil_names"] = list(terrain.soil_names)


def is_geotiff(path: str | Path) -> bool:
    """Return whether a file's name is that of a GeoTIFF."""
    return Path(path).suffix.lower() in SUFFIXES


@dataclass(frozen=True)
class GeoTiffMap:
    """A GeoTIFF whose only band has heights in metres, in a map projection in metres.

    The map frame has the coordinates of the projection. Only elevation is read.

    Raises:
        PlanningError: From `frame`: the file cannot be read, or is of another kind.
    """

    path: Path
    """The file."""
    soil_names: ClassVar[tuple[str, ...]] = ()
    """A GeoTIFF has no soils."""

    @property
    def frame(self) -> MapFrame:
        """Place and size of its cells."""
        with self._open() as file:
            if wrong := find_missing_block(file, self.path) or _find_fault(file):
                raise PlanningError(f"{show_file(self.path)}: {wrong}")
            resolution = float(file.transform.a)
            x = file.transform.c + 0.5 * resolution
            y = file.transform.f + (0.5 - file.height) * resolution
            crs = file.crs.to_wkt()
            return MapFrame((file.height, file.width), resolution, (x, y), crs)

    def read(self, box: Box, every: int = 1) -> Grids:
        """Return the heights in a box of cells, every so many cells of them; NaN for nodata.

        They are read some rows at a time, as the box may be the whole map for a picture.
        """
        rows, columns = box
        size = every * max(1, BAND // every)
        with self._open() as file:
            bands = [
                self._read_window(file, (slice(first, min(first + size, rows.stop)), columns))[
                    ::every, ::every
                ].copy()
                for first in range(rows.start, rows.stop, size)
            ]
        return {"elevation": np.concatenate(bands)}

    def hash_content(self) -> str:
        """Return a hash of all that heights come from.

        That is the file, its mask, which may be a file beside it, and what other files beside it
        (.aux.xml, .tfw) may say instead of it. The projection changes no height, and versions of
        GDAL word it differently.
        """
        with self._open() as file:
            properties = repr((tuple(file.transform), file.nodata, file.scales, file.offsets))
            masks = [Path(name) for name in file.files if name.endswith(".msk")]
        found = hashlib.sha256(properties.encode())
        for path in (self.path, *masks):
            with path.open("rb") as content:
                found.update(hashlib.file_digest(content, "sha256").digest())
        return found.hexdigest()[:16]

    @contextlib.contextmanager
    def _open(self) -> Iterator[Any]:
        rasterio = import_rasterio()
        try:
            with rasterio.open(self.path) as file:
                yield file
        except rasterio.errors.RasterioError as error:
            why = error.__cause__ or error
            raise PlanningError(f"{show_file(self.path)}: cannot be read: {why}") from None

    def _read_window(self, file: Any, box: Box) -> np.ndarray:
        """Return the heights in a box of cells of an open file, NaN for nodata."""
        from rasterio.windows import Window

        rows, columns = box
        window = Window(
            columns.start,
            file.height - rows.stop,
            columns.stop - columns.start,
            rows.stop - rows.start,
        )
        values = file.read(1, window=window, masked=True)
        unknown = np.ma.getmaskarray(values)
        with np.errstate(invalid="ignore"):  # of signalling NaNs
            if file.nodata is not None:  # GDAL forgets it where there is a mask, too
                unknown = unknown | (values.data == file.nodata)
            heights = np.where(unknown, np.nan, values.data.astype(np.float64))
        if file.nodata is None:
            self._check_declared(heights)
        heights = heights * file.scales[0] + file.offsets[0]
        wrong = heights[np.abs(heights) > MAX_COORDINATE]
        if wrong.size:
            raise PlanningError(
                f"{show_file(self.path)}: holds {wrong[0]:g}; heights must be finite and within "
                f"{MAX_COORDINATE:g} m, or nodata"
            )
        return np.asarray(heights[::-1])

    def _check_declared(self, heights: np.ndarray) -> None:
        """Check that heights of a file without a nodata value are none that stand for it."""
        for value in UNDECLARED:
            if (heights == value).any():
                raise PlanningError(
                    f"{show_file(self.path)}: holds {value:.17g} and declares no nodata value; "
                    f"gdal_edit.py -a_nodata {value:.17g} declares it"
                )


def import_rasterio() -> Any:
    """Import rasterio so that PROJ finds its database; else it complains on stderr by itself."""
    found = importlib.util.find_spec("rasterio")
    if found is not None and found.origin is not None:
        data = Path(found.origin).parent / "proj_data"
        if data.is_dir() and "PROJ_LIB" not in os.environ:
            os.environ.setdefault("PROJ_DATA", str(data))
    import rasterio

    return rasterio


def _find_fault(file: Any) -> str:
    """Return what is wrong with an open file, empty if nothing is."""
    transform, crs = file.transform, file.crs
    if file.count != 1:
        return (
            f"has {file.count} bands; it must have one, of heights (gdal_translate -b 1 takes one)"
        )
    if file.dtypes[0].startswith("complex"):
        return f"has values of type {file.dtypes[0]}; they must be heights"
    if not crs:
        return "has no coordinate reference system; gdal_edit.py -a_srs sets it"
    if not crs.is_projected:
        kind = "degrees" if crs.is_geographic else "coordinates of another kind"
        return (
            f"is in {kind}; it must be in a map projection in metres (gdalwarp -t_srs makes one)"
        )
    unit, factor = crs.linear_units_factor
    if abs(factor - 1.0) > 1e-9:
        return f"has coordinates in {unit}; they must be in metres (gdalwarp -t_srs makes one)"
    height = (file.units[0] or "").strip()
    if height.lower() not in METRES:
        return f"has heights in {height!r}; they must be in metres (gdal_calc.py converts them)"
    if transform.is_identity:
        return "says nowhere where its cells are; gdal_edit.py -a_ullr sets it"
    turned = max(abs(transform.b), abs(transform.d)) * max(file.width, file.height)
    if turned > TURNED * abs(transform.a) or not (transform.a > 0.0 > transform.e):
        return "is rotated or mirrored; its rows must run to the south (gdalwarp makes it so)"
    if not CELL_SIZES[0] <= transform.a <= CELL_SIZES[1]:
        low, high = CELL_SIZES
        return f"has cells of {transform.a:g} m; they must be of {low:g} to {high:g} m"
    if abs(transform.a + transform.e) > SQUARE * transform.a:
        return (
            f"has cells of {transform.a:g} x {-transform.e:g} m; they must be square "
            "(gdalwarp -tr makes them so)"
        )
    scale, offset = file.scales[0], file.offsets[0]
    if not (math.isfinite(scale) and scale != 0.0 and math.isfinite(offset)):
        return (
            f"has heights with scale {scale:g} and offset {offset:g}; the scale must be finite "
            "and not 0, the offset finite (gdal_edit.py -scale, -offset set them)"
        )
    if min(file.width, file.height) < 2:
        return f"has {file.height} x {file.width} cells; it must have 2 x 2 or more"
    return ""


def find_missing_block(file: Any, path: Path) -> str:
    """Return that a file is truncated, empty if all its blocks are there."""
    size = path.stat().st_size
    height, width = file.block_shapes[0]
    for i in range(-(-file.height // height)):
        for j in range(-(-file.width // width)):
            place = f"{j}_{i}"
            start = file.get_tag_item(f"BLOCK_OFFSET_{place}", "TIFF", bidx=1)
            length = file.get_tag_item(f"BLOCK_SIZE_{place}", "TIFF", bidx=1)
            if start and length and int(start) + int(length) > size:
                return (
                    f"is truncated: it has {size} bytes, a block needs {int(start) + int(length)}"
                )
    return ""
