# SPDX-License-Identifier: Apache-2.0
"""Opens the terrain file that a client names by a URL, below a folder and within limits."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO
from urllib.parse import unquote, urlparse

from rover_physics.errors import RoverFileError, TerrainError
from rover_physics.files.user_file import open_regular_file
from rover_physics.files.validation import errors_of, show_file
from rover_physics.terrain.grid import Terrain, read_terrain
from rover_physics.terrain.terrain_file import MAX_CELLS
from rover_planner.errors import PlanningError

MUST = "it must be the path or file:// URL of a terrain file on this machine"
LOCAL_HOSTS = ("", "localhost")
"""Hosts of a file:// URL that mean this machine."""


class MapFileError(PlanningError):
    """A name that is no readable file below the folder; the text names file and reason."""


def open_map(
    url: str, folder: str = "/", max_bytes: int = 1_000_000_000, max_cells: int = MAX_CELLS
) -> Terrain:
    """Load the terrain file that a client names.

    Args:
        url: A path, or a file:// URL with %-escapes. Relative paths start at the folder.
        folder: Folder that the file must be below; links that lead out of it are refused.
        max_bytes: Size of the largest file [bytes].
        max_cells: Size of the largest map [cells].

    Raises:
        MapFileError: The URL is none of a local file; the file does not exist, is not below the
            folder, is not a regular file, or cannot be read.
        TerrainError: The file is too large, or not a terrain file.
    """
    with errors_of(url, MapFileError), _open_below(file_of_url(url), folder) as file:
        size = os.fstat(file.fileno()).st_size
        if size > max_bytes:
            raise TerrainError(
                f"{show_file(url)}: the file has {size} bytes; the limit (max_map_bytes) is "
                f"{max_bytes}"
            )
        return read_terrain(file, show_file(url), max_cells)


def file_of_url(url: str) -> Path:
    """Return the file that a path or a file:// URL names.

    Raises:
        RoverFileError: It is another URL, or none at all.
    """
    try:
        parts = urlparse(url)
        if parts.scheme == "file" and parts.netloc in LOCAL_HOSTS:
            return Path(unquote(parts.path))
    except ValueError as error:  # such as "//[", an address that is not closed
        raise RoverFileError(f"not a URL ({error}); {MUST}") from error
    if parts.scheme == "file" or "://" in url or not url:
        raise RoverFileError(f"not a local file; {MUST}")
    return Path(url)


@contextmanager
def _open_below(file: Path, folder: str) -> Iterator[BinaryIO]:
    """Open a regular file below a folder, where no symbolic link leads out of the folder.

    What was opened is looked at once more: a part of the path may be exchanged in the meantime.
    """
    folder = os.path.expanduser(folder)
    try:
        top, path = (os.path.realpath(os.path.join(folder, one)) for one in ("", file))
        _check_below(top, path, folder)
    except OSError as error:
        raise RoverFileError(f"cannot be read: {error.strerror or error}; {MUST}") from error
    except ValueError as error:  # a zero byte in the name
        raise RoverFileError(f"cannot be read: the name is impossible ({error})") from error
    with open_regular_file(path) as opened:
        _check_below(top, os.readlink(f"/proc/self/fd/{opened.fileno()}"), folder)
        yield opened


def _check_below(top: str, path: str, folder: str) -> None:
    if os.path.commonpath([top, path]) != top:
        raise RoverFileError(f"not below {show_file(folder)}, the folder of maps (map_folder)")
