# SPDX-License-Identifier: Apache-2.0
"""Terrain: an elevation grid with unknown cells and layers of friction, soil and more."""

import hashlib
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_physics.errors import RoverError, TerrainError
from rover_physics.files.npz_file import write_npz
from rover_physics.files.user_file import open_regular_file
from rover_physics.files.validation import errors_of, show_file
from rover_physics.numerics.arrays import Floats, freeze_array, seal_array
from rover_physics.terrain.checks import (
    as_elevation,
    as_origin,
    as_resolution,
    as_soil,
    as_soil_names,
)
from rover_physics.terrain.layers import GRID_LAYERS
from rover_physics.terrain.terrain_file import MAX_CELLS, find_terrain_file, read_entries

DIGITS = 16
"""Hexadecimal digits of a fingerprint."""
NEIGHBOURS = ((0, 1), (0, -1), (1, 0), (-1, 0))
"""Rows and columns from a cell to the four that share a side with it."""
_EDGE_TOLERANCE = 1e-9  # cells; for rounding of (x - origin) / resolution at the map's edge


@dataclass(frozen=True, eq=False)
class Terrain:
    """Ground heights on a regular grid in the map frame.

    Cell [j, i] is centred at x = origin[0] + i * resolution, y = origin[1] + j * resolution.
    Arrays are read-only, so that results derived from a terrain cannot become stale. A writeable
    array is copied.

    Raises:
        TerrainError: Wrong shape or type, resolution not above 0, infinite heights, no known cell,
            or a value of a layer out of its range.
    """

    elevation: NDArray[np.float64]
    """Heights (ny, nx) in [m], row 0 at smallest y, column 0 at smallest x, NaN where unknown."""
    resolution: float
    """Cell size in [m]."""
    origin: tuple[float, float] = (0.0, 0.0)
    """Centre (x, y) of cell [0, 0] in [m], map frame."""
    friction: NDArray[np.float64] | None = None
    """Coulomb coefficients (ny, nx), NaN for the rover's default; None: the default everywhere."""
    soil: NDArray[np.int32] | None = None
    """Indices (ny, nx) into ``soil_names``, -1 for the default soil; None: the default
    everywhere."""
    soil_names: tuple[str, ...] = ()
    """Names of the soils in ``soil``. Whether they exist is checked when a soil is needed."""
    elevation_std: NDArray[np.float64] | None = None
    """Standard deviation of the heights (ny, nx) in [m], at least 0, known where the height is
    known; None: the heights are exact."""
    ground_class: NDArray[np.float64] | None = None
    """Classes of ground (ny, nx) as a camera tells them apart, whole numbers from 0, NaN where
    there is none; None: none anywhere. What is learned on a class holds for all its cells."""

    def __post_init__(self) -> None:
        elevation = as_elevation(self.elevation)
        soil_names = as_soil_names(self.soil_names)
        checked: dict[str, Any] = {
            "elevation": elevation,
            "resolution": as_resolution(self.resolution),
            "origin": as_origin(self.origin),
            "soil_names": soil_names,
        }
        if self.soil is not None:
            checked["soil"] = as_soil(self.soil, soil_names, elevation)
        elif soil_names:
            raise TerrainError(
                f"soil_names are {', '.join(soil_names)} without a soil layer that points to them"
            )
        for name, layer in GRID_LAYERS.items():
            if layer.check is not None and getattr(self, name) is not None:
                checked[name] = layer.check(getattr(self, name), elevation)
        for name, value in checked.items():
            frozen = freeze_array(value) if isinstance(value, np.ndarray) else value
            object.__setattr__(self, name, frozen)

    @cached_property
    def classes(self) -> tuple[int, ...]:
        """The classes of ground that the map has, found once: a question asks for them."""
        if self.ground_class is None:
            return ()
        known = self.ground_class[np.isfinite(self.ground_class)]
        return tuple(np.unique(known).astype(int).tolist())

    @cached_property
    def fingerprint(self) -> str:
        """16 hexadecimal digits of SHA-256 over all that defines the terrain, found once.

        The bytes are: resolution, origin x and y as 64-bit floats; then per layer its name, its
        shape and its values; then the names of the soils. Unknown cells of all kinds of NaN count
        alike.
        """
        digest = hashlib.sha256(np.array([self.resolution, *self.origin], "<f8").tobytes())
        for name in GRID_LAYERS:
            layer = getattr(self, name)
            if layer is not None:
                digest.update(f"{name} {layer.shape} ".encode())
                digest.update(_bytes(layer).data)
        digest.update("\n".join(self.soil_names).encode())
        return digest.hexdigest()[:DIGITS]

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Extent (xmin, xmax, ymin, ymax) in [m] between the centres of the outermost cells."""
        ny, nx = self.elevation.shape
        x, y = self.origin
        return (x, x + (nx - 1) * self.resolution, y, y + (ny - 1) * self.resolution)

    def contains(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.bool_]:
        """Return True for points on the map, within `bounds`, even if their height is unknown.

        Args:
            x: Positions in [m], map frame, any shape.
            y: The same, with a shape that broadcasts with x.
        """
        ny, nx = self.elevation.shape
        column, row = self._grid_coordinates(x, y)
        inside = (column >= -_EDGE_TOLERANCE) & (column <= nx - 1 + _EDGE_TOLERANCE)
        return inside & (row >= -_EDGE_TOLERANCE) & (row <= ny - 1 + _EDGE_TOLERANCE)

    def elevation_at(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
        """Interpolate the height bilinearly between the four cell centres around each point.

        Args:
            x: Positions in [m], map frame, any shape.
            y: The same, with a shape that broadcasts with x.

        Returns:
            Heights in [m] of the broadcast shape, NaN where one of the four cells is unknown or
            the point is off the map.
        """
        ny, nx = self.elevation.shape
        column, row = self._grid_coordinates(x, y)
        inside = self.contains(x, y)
        column = np.where(inside, column, 0.0)
        row = np.where(inside, row, 0.0)
        i = np.clip(np.floor(column).astype(np.intp), 0, nx - 2)
        j = np.clip(np.floor(row).astype(np.intp), 0, ny - 2)
        u, v = column - i, row - j
        z = self.elevation
        lower = (1.0 - u) * z[j, i] + u * z[j, i + 1]
        upper = (1.0 - u) * z[j + 1, i] + u * z[j + 1, i + 1]
        return np.where(inside, (1.0 - v) * lower + v * upper, np.nan)

    def fill_gaps(self, max_gap: float) -> "Terrain":
        """Fill small unknown regions with a smooth surface through their rims.

        A region is a set of unknown cells joined by their sides. It is filled if no square wider
        than ``max_gap`` fits into it and it does not touch the map's edge, so that known ground
        surrounds it. The surface is harmonic: each filled height is the mean of its four
        neighbours. It continues planes exactly and adds no peaks or pits.

        Args:
            max_gap: Largest width of a region in [m].

        Returns:
            A terrain with the gaps filled; larger regions stay NaN. Friction and soil are
            unchanged. A filled cell has the largest standard deviation of the cells around its
            gap.

        Raises:
            TerrainError: max_gap is negative or not a number.
        """
        if not (np.isfinite(max_gap) and max_gap >= 0.0):
            raise TerrainError(f"max_gap is {max_gap}; it must be a width of at least 0 in m")
        gaps = _small_gaps(np.isnan(self.elevation), int(max_gap / self.resolution + 1e-9))
        if not gaps.any():
            return self
        std = self.elevation_std
        return replace(
            self,
            elevation=_fill_harmonic(self.elevation, gaps),
            elevation_std=None if std is None else _fill_with_largest(std, gaps),
        )

    def _grid_coordinates(
        self, x: ArrayLike, y: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return fractional column and row of points, broadcast to one shape."""
        xs, ys = np.broadcast_arrays(
            np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        )
        column = (xs - self.origin[0]) / self.resolution
        row = (ys - self.origin[1]) / self.resolution
        return column, row


def cut_around(terrain: Terrain, places: Floats, margin: float) -> Terrain:
    """Return the part of a terrain within `margin` [m] of a box around places (n, 2) [m]."""
    shape = np.array(terrain.elevation.shape[::-1])
    low, high = places.min(axis=0) - margin, places.max(axis=0) + margin
    first, last = (
        np.clip(np.round((end - terrain.origin) / terrain.resolution), 0, shape - 1).astype(int)
        for end in (low, high)
    )
    first = np.minimum(first, np.maximum(last - 1, 0))
    columns, rows = (slice(a, b + 2) for a, b in zip(first, last, strict=True))
    layers: dict[str, Any] = {
        name: None if layer is None else np.ascontiguousarray(layer[rows, columns])
        for name in GRID_LAYERS
        for layer in (getattr(terrain, name),)
    }
    x, y = np.asarray(terrain.origin) + terrain.resolution * first
    return replace(terrain, origin=(float(x), float(y)), **layers)


def load_terrain(name_or_path: str | Path, max_cells: int = MAX_CELLS) -> Terrain:
    """Load a terrain by the name of a preset or from an ``.npz`` file.

    Args:
        name_or_path: A preset's name such as ``"spirit"``, or the path of a file with
            ``elevation`` (ny, nx) [m], ``resolution`` [m], ``origin`` (x, y) [m] and
            optionally layers (ny, nx): ``friction``, ``soil`` with ``soil_names``,
            ``elevation_std`` [m], and ``ground_class``. Other entries, such as ``source``, are
            ignored.
        max_cells: Largest number of cells; a larger terrain is refused before it is unpacked.

    Raises:
        TerrainError: Neither a preset nor a regular file, an unreadable file, more cells, or a
            missing or invalid entry; the text names file and entry.
    """
    path = find_terrain_file(name_or_path)
    with errors_of(path, TerrainError), open_regular_file(path) as file:
        return read_terrain(file, path, max_cells)


def read_terrain(file: BinaryIO, source: str | Path, max_cells: int = MAX_CELLS) -> Terrain:
    """Read a terrain from an open file; `load_terrain` describes it.

    Args:
        file: The file, open for reading.
        source: Its name, at the start of every error text.
        max_cells: Largest number of cells.

    Raises:
        TerrainError: As for `load_terrain`.
    """
    try:
        return Terrain(**read_entries(file, max_cells))
    except RoverError as error:
        raise TerrainError(f"{show_file(source)}: {error}") from None


def save_terrain(path: str | Path, terrain: Terrain, **notes: Any) -> None:
    """Save a terrain as an ``.npz`` file that `load_terrain` reads.

    Args:
        path: File to write, without a suffix added; an existing file is replaced.
        terrain: The terrain.
        notes: Further texts or arrays to store in the file, e.g. ``source``.

    Raises:
        TerrainError: The file cannot be written.
    """
    entries: dict[str, Any] = dict(notes)
    entries["resolution"] = np.float64(terrain.resolution)
    entries["origin"] = np.asarray(terrain.origin)
    for name in GRID_LAYERS:
        if getattr(terrain, name) is not None:
            entries[name] = getattr(terrain, name)
    if terrain.soil_names:
        entries["soil_names"] = np.array(terrain.soil_names)
    with errors_of(path, TerrainError):
        write_npz(path, entries)


def _bytes(layer: np.ndarray) -> np.ndarray:
    """Return the values of a layer, little-endian, with one kind of NaN."""
    values = np.ascontiguousarray(layer)
    if values.dtype.kind == "f":
        values = np.where(np.isnan(values), np.nan, values).astype("<f8", copy=False)
    return values


def _small_gaps(unknown: NDArray[np.bool_], max_cells: int) -> NDArray[np.bool_]:
    """Select the unknown regions that are off the map's edge and at most max_cells wide."""
    from scipy import ndimage  # imported here: it takes as long as the rest of the package

    labels, count = ndimage.label(unknown)
    small = np.ones(count + 1, dtype=bool)
    small[0] = False
    side = max_cells + 1
    if side <= min(unknown.shape):
        # A square that is too wide fits into a region if erosion by it leaves a cell.
        wide = ndimage.minimum_filter(
            unknown.astype(np.uint8), size=side, mode="constant", cval=0
        ).astype(bool)
        small[labels[wide]] = False
    for edge in (labels[0], labels[-1], labels[:, 0], labels[:, -1]):
        small[edge] = False
    chosen: NDArray[np.bool_] = small[labels]
    return chosen


def _fill_harmonic(elevation: NDArray[np.float64], gaps: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Solve for the heights in the gaps; each is the mean of its four neighbours."""
    from scipy import sparse
    from scipy.sparse import linalg

    count = int(gaps.sum())
    index = np.full(gaps.shape, -1)
    index[gaps] = np.arange(count)
    rows, columns = np.nonzero(gaps)
    matrix = sparse.eye(count, format="csr") * 4.0
    right_side = np.zeros(count)
    for down, along in NEIGHBOURS:
        neighbour = index[rows + down, columns + along]
        inner = neighbour >= 0
        coupling = sparse.csr_matrix(
            (np.ones(inner.sum()), (np.nonzero(inner)[0], neighbour[inner])), shape=(count, count)
        )
        matrix = matrix - coupling
        right_side[~inner] += elevation[rows + down, columns + along][~inner]
    filled = elevation.copy()
    filled[gaps] = linalg.spsolve(matrix.tocsc(), right_side)
    return seal_array(filled)


def _fill_with_largest(std: NDArray[np.float64], gaps: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Fill each gap with the largest standard deviation around it."""
    from scipy import ndimage

    labels, count = ndimage.label(gaps)
    largest = np.zeros(count + 1)
    rows, columns = np.nonzero(gaps)  # none at the map's edge
    for down, along in NEIGHBOURS:
        beside = rows + down, columns + along
        rim = ~gaps[beside]
        np.maximum.at(largest, labels[gaps][rim], std[beside][rim])
    filled = std.copy()
    filled[gaps] = largest[labels[gaps]]
    return filled
