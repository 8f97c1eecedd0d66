# SPDX-License-Identifier: Apache-2.0
"""The studies that come with the package, by name."""

from pathlib import Path

from rover_physics.files.config_files import find_config


def find_examples() -> dict[str, Path]:
    """Return the files of the example studies by name, sorted; they lie beside config/."""
    folder = find_config("rovers").parents[1] / "examples"
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}
