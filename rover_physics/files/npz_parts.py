# SPDX-License-Identifier: Apache-2.0
"""Writes .npz files of long arrays, which come part by part."""

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO

import numpy as np

from rover_physics.errors import RoverFileError
from rover_physics.files.npz_file import create_npz, method_for


class NpzParts:
    """Arrays of many rows that are kept in temporary files until all rows are there.

    Use it as a context; its files are removed at the end. All methods raise a RoverFileError,
    which does not name the file, if a file cannot be written.
    """

    def __init__(self, folder: Path, rows: int):
        """Begin without arrays.

        Args:
            folder: Where the temporary files are made.
            rows: Number of rows that each array will have.
        """
        self._rows = rows
        self._streams: dict[str, BinaryIO] = {}
        self._types: dict[str, np.dtype[Any]] = {}
        try:
            self._folder = TemporaryDirectory(dir=folder, prefix=".rover_planner-")
        except OSError as error:
            raise _cannot_write(error) from error

    def __enter__(self) -> "NpzParts":
        return self

    def __exit__(self, *_: object) -> None:
        for stream in self._streams.values():
            stream.close()
        self._folder.cleanup()

    def add(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Add the next rows of some arrays; type and row shape are those of the first ones."""
        try:
            for name, rows in arrays.items():
                if name not in self._streams:
                    self._begin(name, rows)
                self._streams[name].write(np.ascontiguousarray(rows, self._types[name]).data)
        except OSError as error:
            raise _cannot_write(error) from error

    def _begin(self, name: str, rows: np.ndarray) -> None:
        """Open the file of an array and write its header."""
        self._types[name] = rows.dtype
        self._streams[name] = self._path_of(name).open("wb")
        header = {
            "descr": np.lib.format.dtype_to_descr(rows.dtype),
            "fortran_order": False,
            "shape": (self._rows, *rows.shape[1:]),
        }
        np.lib.format.write_array_header_1_0(self._streams[name], header)

    def _path_of(self, name: str) -> Path:
        return Path(self._folder.name, f"{name}.npy")

    def write(self, path: Path, more: Mapping[str, Any]) -> None:
        """Write the archive with these arrays and with `more`, whole ones."""
        try:
            for name, value in more.items():
                np.save(self._path_of(name), value, allow_pickle=False)
                self._types[name] = np.asarray(value).dtype
            for stream in self._streams.values():
                stream.close()
            with create_npz(path) as archive:
                for name, dtype in self._types.items():
                    archive.write(self._path_of(name), f"{name}.npy", method_for(dtype), 1)
        except OSError as error:
            raise _cannot_write(error) from error


def _cannot_write(error: Exception) -> RoverFileError:
    return RoverFileError(f"cannot be written: {getattr(error, 'strerror', None) or error}")
