# SPDX-License-Identifier: Apache-2.0
"""Preset terrains of the package, by name."""

import os
from pathlib import Path

from rover_physics.errors import TerrainError
from rover_physics.files.config_files import find_config
from rover_physics.files.validation import show_file


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
