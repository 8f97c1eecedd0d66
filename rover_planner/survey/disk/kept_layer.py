# SPDX-License-Identifier: Apache-2.0
"""A layer of a survey as its store keeps it, which says in one line if it cannot be read."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.files.validation import show_file
from rover_planner.errors import PlanningError

UNREADABLE = (OSError, RuntimeError, ValueError, TypeError, KeyError)
"""What Zarr and its codecs raise where a file is damaged or gone."""


class KeptLayer:
    """A Zarr array (rows, columns) that is read and written by slices."""

    def __init__(self, array: Any, path: Path):
        """Keep an array.

        Args:
            array: The Zarr array.
            path: The store, for what is said of it.
        """
        self._array = array
        self._path = path

    @property
    def shape(self) -> tuple[int, ...]:
        """Rows and columns."""
        return tuple(self._array.shape)

    @property
    def dtype(self) -> np.dtype:
        """Type of the values."""
        return np.dtype(self._array.dtype)

    def has_chunk(self, chunk: tuple[int, int]) -> bool:
        """Return whether the file of a chunk (row, column) is there."""
        key = self._array.metadata.encode_chunk_key(chunk)
        return (self._path / self._array.basename / key).is_file()

    def __getitem__(self, key: Any) -> NDArray[Any]:
        """Read a part.

        Raises:
            PlanningError: A file of the layer is damaged.
        """
        try:
            return np.asarray(self._array[key])
        except UNREADABLE as error:
            raise damaged(self._path, self._array.basename, error) from None

    def __setitem__(self, key: Any, values: Any) -> None:
        """Write a part.

        Raises:
            OSError: The system refuses.
        """
        self._array[key] = values


def damaged(path: Path, name: str, error: Exception) -> PlanningError:
    """Return what is said of an array that cannot be read.

    Args:
        path: The store.
        name: Name of the array.
        error: What was raised.
    """
    why = (str(error).splitlines() or [""])[0]
    return PlanningError(
        f"{show_file(path)}: {name} is damaged ({type(error).__name__}: {why:.80}); "
        "survey again into another folder"
    )
