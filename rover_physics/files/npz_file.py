# SPDX-License-Identifier: Apache-2.0
"""Reads and writes .npz files, at once or part by part; sizes are known before unpacking."""

import math
import warnings
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO

import numpy as np
from numpy.lib import format as npy_format
from numpy.typing import DTypeLike, NDArray

from rover_physics.errors import RoverFileError
from rover_physics.files.user_file import open_regular_file, open_without_waiting, writing

VALUE_BYTES, HEADER_BYTES = 8, 10_000
"""Memory of a value that is read, and of the header of an array [bytes]."""
METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Compression methods of numpy.savez and numpy.savez_compressed; zipfile unpacks others without a
limit of memory."""
MAX_CODE_POINT = 0x10FFFF
NUMBERS, FLAGS, TEXTS, ANY = "fiu", "b", "U", "fiubU"
KINDS = {NUMBERS: "numbers", FLAGS: "bools", TEXTS: "texts", ANY: "plain numbers or texts"}
"""What arrays hold, by the kinds of their types."""


class NpzReader:
    """The arrays of an .npz archive.

    NumPy's own `NpzFile` would unpack before anyone knows the size.

    All methods raise a RoverFileError, which does not name the file, for an archive or array that
    is damaged, encrypted, packed by an unusual method, or not of plain numbers and texts.
    """

    def __init__(self, file: BinaryIO):
        """Read the list of contents.

        Args:
            file: The archive, open for reading; it must allow seeking.
        """
        try:
            self._archive = zipfile.ZipFile(file)
        except Exception as error:  # zipfile documents only BadZipFile, and raises many others
            raise RoverFileError(f"not an .npz file ({_reason(error)})") from error

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the arrays, in the order of the archive."""
        ending = ".npy"
        members = self._archive.namelist()
        return tuple(name.removesuffix(ending) for name in members if name.endswith(ending))

    def read(
        self,
        name: str,
        *,
        most: int,
        kinds: str = ANY,
        shape: tuple[int | None, ...] | None = None,
        dtype: DTypeLike | None = None,
    ) -> NDArray[Any]:
        """Return an array in C order.

        Args:
            name: Name of the array.
            most: Largest number of its values, or of the characters of its texts. One that takes
                more memory is not unpacked.
            kinds: A key of KINDS.
            shape: Its shape, with None for any number; without one, any shape.
            dtype: Type of the returned elements; None for that of the file.
        """
        with self._open(name) as (stream, size):
            if size > VALUE_BYTES * most + HEADER_BYTES:
                raise RoverFileError(f"takes {size} bytes of memory; the limit is {most} values")
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of headers of Python 2 and odd ones
                npy_format.read_magic(stream)
                claimed, _, kind = npy_format.read_array_header_1_0(stream)
                claim = math.prod(claimed) * kind.itemsize
                if claim != size - stream.tell() and not kind.hasobject:
                    raise RoverFileError(f"is damaged: its header claims {kind.str}{claimed}")
                stream.seek(0)
                array = npy_format.read_array(stream, allow_pickle=False)
            found = array.dtype
            if found.kind not in kinds or not found.itemsize:
                raise RoverFileError(f"is of type {found}; it must hold {KINDS[kinds]}")
            if shape is not None and not _fits(array.shape, shape):
                must = str(shape).replace("None", "n")
                raise RoverFileError(f"has shape {_show(str(array.shape))}; it must be {must}")
            count = array.size * (found.itemsize // 4 if found.kind == TEXTS else 1)
            if count > most:
                raise RoverFileError(f"has {count} values; the limit is {most}")
            array = np.asarray(array, dtype or found.newbyteorder("="), order="C")
            if found.kind == TEXTS and (array.reshape(-1).view(np.uint32) > MAX_CODE_POINT).any():
                raise RoverFileError("holds characters that do not exist; it must hold texts")
            return array

    @contextmanager
    def _open(self, name: str) -> Iterator[tuple[BinaryIO, int]]:
        """Open an array, with the size in bytes that the archive declares; errors name it."""
        try:
            member = self._archive.getinfo(f"{name}.npy")
        except KeyError:
            there = ", ".join(map(_show, self.names[:20])) or "no arrays"
            raise RoverFileError(f"has no array {name}; it has {there}") from None
        try:
            if member.compress_type not in METHODS:
                raise RoverFileError(
                    f"is packed by method {member.compress_type}; it must be stored or deflated, "
                    "as by numpy.savez and numpy.savez_compressed"
                )
            with self._archive.open(member) as stream:
                yield stream, member.file_size  # type: ignore[misc]
        except RoverFileError as error:
            raise RoverFileError(f"entry {name} {error}") from None
        except Exception as error:  # as above; NumPy's readers too raise more than they document
            raise RoverFileError(f"entry {name} is damaged ({_reason(error)})") from error


def _fits(found: tuple[int, ...], shape: tuple[int | None, ...]) -> bool:
    return len(found) == len(shape) and all(
        one in (None, size) for one, size in zip(shape, found, strict=True)
    )


@contextmanager
def open_npz(path: str | Path) -> Iterator[NpzReader]:
    """Open an .npz file.

    Raises:
        RoverFileError: As for `open_regular_file`, or it is not an .npz file.
    """
    with open_regular_file(path) as file:
        yield NpzReader(file)


@contextmanager
def create_npz(path: str | Path) -> Iterator[zipfile.ZipFile]:
    """Open an .npz file for writing; an existing one is overwritten, its name is not extended.

    Raises:
        RoverFileError: It cannot be written; the text does not name the file.
    """
    with (
        writing(),
        open(path, "wb", opener=open_without_waiting) as file,
        zipfile.ZipFile(file, "w") as archive,
    ):
        yield archive


def write_npz(path: str | Path, arrays: Mapping[str, Any], *, compressed: bool = True) -> None:
    """Write arrays to an .npz file, which `create_npz` opens.

    Args:
        path: The file.
        arrays: The arrays by name.
        compressed: Whether to compress numbers; texts are compressed in any case. It takes ten
            times as long and saves one half to three quarters of the size of predictions.

    Raises:
        RoverFileError: It cannot be written; the text does not name the file.
    """
    with create_npz(path) as archive:
        for name, value in arrays.items():
            array = np.asanyarray(value)
            entry = zipfile.ZipInfo(f"{name}.npy")
            entry.compress_type = zipfile.ZIP_DEFLATED if compressed else method_for(array.dtype)
            with archive.open(entry, "w", force_zip64=True) as stream:  # as numpy.savez does
                npy_format.write_array(stream, array, allow_pickle=False)


def method_for(dtype: np.dtype[Any]) -> int:
    """Return the compression method for an array: texts are long and much alike."""
    return zipfile.ZIP_DEFLATED if dtype.kind == "U" else zipfile.ZIP_STORED


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
        with writing():
            self._folder = TemporaryDirectory(dir=folder, prefix=".rover_planner-")

    def __enter__(self) -> "NpzParts":
        return self

    def __exit__(self, *_: object) -> None:
        for stream in self._streams.values():
            stream.close()
        self._folder.cleanup()

    def add(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Add the next rows of some arrays; type and row shape are those of the first ones."""
        with writing():
            for name, rows in arrays.items():
                if name not in self._streams:
                    self._begin(name, rows)
                self._streams[name].write(np.ascontiguousarray(rows, self._types[name]).data)

    def _begin(self, name: str, rows: np.ndarray) -> None:
        """Open the file of an array and write its header."""
        self._types[name] = rows.dtype
        self._streams[name] = self._path_of(name).open("wb")
        header = {
            "descr": npy_format.dtype_to_descr(rows.dtype),
            "fortran_order": False,
            "shape": (self._rows, *rows.shape[1:]),
        }
        npy_format.write_array_header_1_0(self._streams[name], header)

    def _path_of(self, name: str) -> Path:
        return Path(self._folder.name, f"{name}.npy")

    def write(self, path: Path, more: Mapping[str, Any]) -> None:
        """Write the archive with these arrays and with `more`, whole ones."""
        with writing():
            for name, value in more.items():
                np.save(self._path_of(name), value, allow_pickle=False)
                self._types[name] = np.asarray(value).dtype
            for stream in self._streams.values():
                stream.close()
            with create_npz(path) as archive:
                for name, dtype in self._types.items():
                    archive.write(self._path_of(name), f"{name}.npy", method_for(dtype), 1)


def _reason(error: Exception) -> str:
    """Return the text of an error in one line, or its type if it has none."""
    return (" ".join(str(error).split()) or type(error).__name__)[:120]


def _show(name: str) -> str:
    """Return a name or value, short and printable."""
    name = name if name.isprintable() else ascii(name)
    return name if len(name) <= 40 else f"{name[:37]}..."
