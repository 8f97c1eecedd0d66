# SPDX-License-Identifier: Apache-2.0
"""Finds terrain files (.npz), and reads and writes their entries, within a limit of cells."""

from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from rover_physics.errors import RoverFileError, TerrainError
from rover_physics.files.config_files import find_config, find_file
from rover_physics.files.npz_file import NUMBERS, NpzReader
from rover_physics.numerics.arrays import seal_array
from rover_physics.terrain.layers import GRID_LAYERS

MAX_CELLS = 25_000_000
"""Default of the largest terrain [cells]."""
REQUIRED = ("elevation", "resolution", "origin")
SMALL = {"resolution": 100, "origin": 100, "soil_names": 250_000}
"""Other entries, and the largest numbers of their values or characters."""


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
    return find_file("terrain", name_or_path, terrain_presets(), TerrainError)


def read_entries(file: BinaryIO, max_cells: int) -> dict[str, Any]:
    """Read the entries of a terrain file.

    The size of an entry is checked before it is unpacked.

    Args:
        file: The file, open for reading.
        max_cells: Largest number of cells.

    Returns:
        The entries by name, read-only arrays; optional ones may be missing.

    Raises:
        RoverFileError: The file is no terrain file, is damaged, or has more cells; the text does
            not name it.
    """
    archive = NpzReader(file)
    there = archive.names
    for name in REQUIRED:
        if name not in there:
            raise RoverFileError(
                f"no entry {name}; a terrain file has elevation, resolution and origin"
            )
    entries = {
        name: archive.read(name, most=most) for name, most in SMALL.items() if name in there
    }
    for name, layer in GRID_LAYERS.items():
        if name in there:
            # Whole numbers are checked in the type of the file, where none is rounded yet.
            dtype = layer.kind if layer.kind is np.float64 else None
            entries[name] = archive.read(name, most=max_cells, kinds=NUMBERS, dtype=dtype)
    return {name: seal_array(values) for name, values in entries.items()}
