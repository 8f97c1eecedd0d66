# SPDX-License-Identifier: Apache-2.0
"""Location of the package's own configuration files, in a source checkout or an installed tree."""

import os
from collections.abc import Iterator, Mapping
from pathlib import Path

from rover_physics.errors import RoverError, RoverFileError
from rover_physics.files.validation import show_file

PACKAGE_NAME = "rover_planner"


def find_config(relative: str) -> Path:
    """Find a file or folder of the package's ``config`` folder.

    In a source checkout, ``config/`` is next to the package. Installed by pip or colcon, it is
    ``<prefix>/share/rover_planner/config``, where ``<prefix>`` is a folder above the package.

    Args:
        relative: Path below ``config``, with forward slashes, e.g. ``"rovers/lsr1.yaml"``.

    Returns:
        Absolute path of the file or folder.

    Raises:
        RoverError: No such file or folder in any of the searched places.
    """
    searched = []
    for folder in _config_folders():
        candidate = folder / relative
        if candidate.exists():
            return candidate
        searched.append(str(folder))
    raise RoverError(
        f"no configuration file {relative!r}; searched {', '.join(searched) or 'nowhere'}; "
        f"is {PACKAGE_NAME} installed with its config/ folder?"
    )


def find_file(
    what: str,
    name_or_path: str | Path,
    presets: Mapping[str, Path],
    kind: type[RoverError] = RoverFileError,
) -> Path:
    """Return the file of a preset by its name, or the path that is given.

    Raises:
        kind: Neither a preset nor a file; the text lists the presets of `what`.
    """
    if not isinstance(name_or_path, Path) and name_or_path in presets:
        return presets[name_or_path]
    if not os.path.exists(name_or_path):
        raise kind(
            f"no {what} {show_file(name_or_path)!r}: there is no such file, and the presets are "
            f"{', '.join(presets)}"
        )
    return Path(name_or_path)


def _config_folders() -> Iterator[Path]:
    """Yield the existing config folders, the one of a source checkout first."""
    # A linked installation has links to the sources: both ends of a link are searched.
    here = Path(__file__).absolute()
    packages = dict.fromkeys((here.parents[1], here.resolve().parents[1]))
    for package in packages:
        if (package.parent / "package.xml").is_file() and (package.parent / "config").is_dir():
            yield package.parent / "config"
    for package in packages:
        for prefix in package.parents:
            folder = prefix / "share" / PACKAGE_NAME / "config"
            if folder.is_dir():
                yield folder
