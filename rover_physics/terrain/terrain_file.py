# SPDX-License-Identifier: Apache-2.0
"""Finds terrain files (.npz), and reads and writes their entries, within a limit of cells."""

import math
import os
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from rover_physics.errors import RoverFileError, TerrainError
from rover_physics.files.config_files import find_config
from rover_physics.files.npz_file import NpzReader
from rover_physics.files.validation import errors_of, show_file
from rover_physics.numerics.read_only import seal_array

MAX_CELLS = 25_000_000
"""Default of the largest terrain [cells]."""
MAX_CELL_BYTES = 40
"""Largest memory of a cell: elevation and four layers, 8 bytes each."""
REQUIRED = ("elevation", "resolution", "origin")
GRIDS: dict[str, type | None] = {
    "elevation": np.float64,
    "friction": np.float64,
    "soil": None,
    "elevation_std": np.float64,
    "ground_class": np.float64,
}
"""Entries with a value for each cell, and the types they are read as; None keeps that of the
file."""
SMALL = {"resolution": 1000, "origin": 1000, "soil_names": 1_000_000}
"""Other entries, and their largest sizes [bytes]."""


def terrain_presets() -> dict[str, Path]:
    """Return the files of the preset terrains by name, which is the first word of the file's."""
    files = sorted(find_config("terrain").glob("*.npz"))
    return {path.stem.partition("_")[0]: path for path in files}


def find_terrain_file(name_or_path: str | Path) -> Path:
    """Return the file of a preset terrain, or the given path.

    Args:
        name_or_path: A preset's name such as ``"spirit"``, or the path of an ``.npz`` file.

    Raises:
        TerrainError: Neither a preset nor a file; the text lists the presets.
    """
    presets = terrain_presets()
    if not isinstance(name_or_path, Path) and name_or_path in presets:
        return presets[name_or_path]
    path = Path(name_or_path)
    if not os.path.exists(path):
        raise TerrainError(
            f"no terrain {show_file(name_or_path)!r}: there is no such file, and the presets are "
            f"{', '.join(presets)}"
        )
    return path


def read_entries(file: BinaryIO, source: str | Path, max_cells: int) -> dict[str, Any]:
    """Read the entries of a terrain file.

    Sizes are checked before anything is unpacked. Grids of numbers are unpacked piece by piece as
    float64, so that the memory needed is that of the terrain.

    Args:
        file: The file, open for reading.
        source: Its name for error texts.
        max_cells: Largest number of cells.

    Returns:
        The entries by name, read-only arrays; optional ones may be missing.

    Raises:
        TerrainError: The file is no terrain file, is damaged, or has more cells.
    """
    with errors_of(source, TerrainError):
        archive = NpzReader(file)
        there = archive.names
        for name in REQUIRED:
            if name not in there:
                raise RoverFileError(
                    f"no entry {name}; a terrain file has elevation, resolution and origin"
                )
        for name in (name for name in GRIDS if name in there):
            _check_grid(archive, name, max_cells)
        entries = {
            name: archive.read(name, most=most) for name, most in SMALL.items() if name in there
        }
        for name, dtype in GRIDS.items():
            if name in there:
                entries[name] = archive.read(name, dtype, most=8 * max_cells)
    return {name: seal_array(values) for name, values in entries.items()}


def _check_grid(archive: NpzReader, name: str, max_cells: int) -> None:
    """Check the type and the size of a grid by its header."""
    header = archive.read_header(name)
    if header.dtype.kind not in "fiu":
        raise RoverFileError(f"{name} has type {header.dtype}; it must be an array of numbers")
    cells = math.prod(header.shape)
    if cells > max_cells:
        raise RoverFileError(
            f"{name} has {' x '.join(map(str, header.shape))} cells; the limit is {max_cells}"
        )
