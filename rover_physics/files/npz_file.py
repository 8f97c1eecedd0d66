"""Reads .npz files that may be hostile: sizes are known before anything is unpacked."""

import io
import math
import re
import struct
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import DTypeLike, NDArray

from rover_physics.errors import RoverFileError
from rover_physics.files.user_file import open_regular_file, write_file

MAX_DIRECTORY = 1_000_000
"""Largest list of contents of an archive, and largest single read [bytes]."""
MAX_HEADER = 10_000
"""Largest header of an array [bytes]; NumPy has the same limit."""
SIZES = {
    "f": (2, 4, 8),
    "i": (1, 2, 4, 8),
    "u": (1, 2, 4, 8),
    "b": (1,),
    "U": range(4, 4 * 10_000 + 1, 4),
}
"""Sizes of the elements [bytes] that are read, by the letter of their type."""
CHUNK = 1 << 18
"""Bytes that are unpacked at once."""
METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Compression methods of numpy.savez and numpy.savez_compressed."""
FORCE_ZIP64 = 1 << 30
"""Size of an array [bytes] from which its entry is written as one that may exceed 2 GiB."""
ENCRYPTED = 0x1
"""Flag of an encrypted member."""
MAX_CODE_POINT = 0x10FFFF
BAD_ARCHIVE = (
    ArithmeticError, EOFError, LookupError, MemoryError, OSError, RuntimeError, ValueError,
    struct.error, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
"""Exceptions of zipfile for damaged archives; its documentation names only BadZipFile."""

_DTYPE = r"""(?P<quote>['"])(?P<dtype>[<>|=]?[a-zA-Z]\d{0,9})(?P=quote)"""
_SHAPE = r"\(\s*(?P<shape>(?:\d{1,15}L?\s*,\s*){0,8}(?:\d{1,15}L?\s*)?)\)"
_HEADER = {
    "descr": re.compile(rf"""['"]descr['"]\s*:\s*{_DTYPE}"""),
    "fortran_order": re.compile(r"""['"]fortran_order['"]\s*:\s*(?P<order>True|False)"""),
    "shape": re.compile(rf"""['"]shape['"]\s*:\s*{_SHAPE}"""),
}
"""Pattern of each key of the header of an .npy file and of its value."""


@dataclass(frozen=True)
class ArrayHeader:
    """What the header of an array claims."""

    dtype: np.dtype[Any]
    """Type of the elements: a number of at most 8 bytes, a bool or a text."""
    shape: tuple[int, ...]
    """Shape."""
    fortran_order: bool
    """Whether the first index varies fastest in the file."""

    @property
    def size(self) -> int:
        """Number of elements."""
        return math.prod(self.shape)


class NpzReader:
    """The arrays of an .npz archive.

    NumPy's own reader is not used: it reads a header of any length into memory, prints warnings,
    unpacks before anyone knows the size, and lets unusual exceptions through.

    All methods raise a RoverFileError, which does not name the file, for an archive or array that
    is damaged, encrypted, packed by an unusual method, or not of plain numbers and texts.
    """

    def __init__(self, file: BinaryIO):
        """Read the list of contents.

        Args:
            file: The archive, open for reading; it must allow seeking.
        """
        try:
            bounded: Any = _BoundedReader(file)
            self._archive = zipfile.ZipFile(bounded)
        except BAD_ARCHIVE as error:
            raise RoverFileError(f"not an .npz file ({_reason(error)})") from error
        self._members: dict[str, zipfile.ZipInfo] = {}
        for member in self._archive.infolist():
            if member.filename in self._members:
                raise RoverFileError(f"entry {_show(member.filename)} is there twice")
            self._members[member.filename] = member

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the arrays, in the order of the archive."""
        ending = ".npy"
        return tuple(n.removesuffix(ending) for n in self._members if n.endswith(ending))

    def read_header(self, name: str) -> ArrayHeader:
        """Return the header of an array; nothing else is unpacked."""
        with self._open(name) as stream:
            return _read_header(stream)

    def read(self, name: str, dtype: DTypeLike | None = None, *, most: int) -> NDArray[Any]:
        """Return an array in C order; memory beside the array is a few hundred kB.

        Args:
            name: Name of the array.
            dtype: Type of the returned elements; None for that of the file.
            most: Largest allowed size of the returned array [bytes].
        """
        member = self._find(name)
        with self._open(name) as stream:
            header = _read_header(stream)
            result = np.dtype(dtype) if dtype is not None else header.dtype.newbyteorder("=")
            needed = header.size * max(result.itemsize, header.dtype.itemsize)
            if needed > most:
                raise RoverFileError(f"takes {needed} bytes of memory; it may take at most {most}")
            start = stream.tell()
            if member.file_size - start != header.size * header.dtype.itemsize:
                raise RoverFileError(
                    f"is damaged: its header claims {header.size} elements of "
                    f"{header.dtype.itemsize} bytes, and the archive {member.file_size - start} "
                    "bytes"
                )
            return _unpack(stream, header, result)

    def _find(self, name: str) -> zipfile.ZipInfo:
        try:
            return self._members[f"{name}.npy"]
        except KeyError:
            there = ", ".join(map(_show, self.names[:20])) or "no arrays"
            raise RoverFileError(f"has no array {name}; it has {there}") from None

    @contextmanager
    def _open(self, name: str) -> Iterator[Any]:
        """Open an array; errors name it."""
        member = self._find(name)
        with _errors_of_entry(name):
            if member.flag_bits & ENCRYPTED:
                raise RoverFileError("is encrypted; it must not be")
            if member.compress_type not in METHODS:
                raise RoverFileError(
                    f"is packed by method {member.compress_type}; it must be stored or deflated, "
                    "as by numpy.savez and numpy.savez_compressed"
                )
            with self._archive.open(member) as stream:
                yield stream


@contextmanager
def open_npz(path: str | Path) -> Iterator[NpzReader]:
    """Open an .npz file.

    Raises:
        RoverFileError: As for `open_regular_file`, or it is not an .npz file.
    """
    with open_regular_file(path) as file:
        yield NpzReader(file)


def write_npz(path: str | Path, arrays: Mapping[str, Any], *, compressed: bool = True) -> None:
    """Write arrays to an .npz file; the name is not extended.

    Args:
        path: The file; an existing one is overwritten.
        arrays: The arrays by name.
        compressed: Whether to compress numbers; texts are compressed in any case. It takes ten
            times as long and saves one half to three quarters of the size of predictions.

    Raises:
        RoverFileError: It cannot be written; the text does not name the file.
    """
    # In memory first: zipfile prints an error of its own when the disk is full.
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, value in arrays.items():
            array = np.asanyarray(value)
            method = zipfile.ZIP_DEFLATED if compressed else method_for(array.dtype)
            entry = zipfile.ZipInfo(f"{name}.npy")
            entry.compress_type = method
            with archive.open(entry, "w", force_zip64=array.nbytes > FORCE_ZIP64) as stream:
                np.lib.format.write_array(stream, array, allow_pickle=False)
    write_file(path, buffer.getvalue())


def method_for(dtype: np.dtype[Any]) -> int:
    """Return the compression method for an array: texts are long and much alike."""
    return zipfile.ZIP_DEFLATED if dtype.kind == "U" else zipfile.ZIP_STORED


class _BoundedReader:
    """A file that refuses to read much at once, such as a huge list of contents."""

    def __init__(self, file: BinaryIO):
        self._file = file
        self.seek, self.tell, self.seekable = file.seek, file.tell, file.seekable
        self._size = file.seek(0, io.SEEK_END)

    def read(self, size: int = -1) -> bytes:
        """Read as a file does."""
        wanted = size if size >= 0 else self._size - self.tell()
        if wanted > MAX_DIRECTORY:
            raise RoverFileError(
                f"not an .npz file: its list of contents takes {wanted} bytes; it may take at "
                f"most {MAX_DIRECTORY}"
            )
        return self._file.read(wanted)


@contextmanager
def _errors_of_entry(name: str) -> Iterator[None]:
    """Put the name of an entry before errors, and turn those of zipfile into a RoverFileError."""
    try:
        yield
    except RoverFileError as error:
        raise RoverFileError(f"entry {name} {error}") from None
    except MemoryError as error:
        raise RoverFileError(f"entry {name} takes more memory than there is") from error
    except BAD_ARCHIVE as error:
        raise RoverFileError(f"entry {name} is damaged ({_reason(error)})") from error


def _reason(error: Exception) -> str:
    """Return the text of an error in one line, or its type if it has none."""
    return (" ".join(str(error).split()) or type(error).__name__)[:120]


def _show(name: str) -> str:
    """Return the name of a member, short and printable."""
    name = name if name.isprintable() else ascii(name)
    return name if len(name) <= 40 else f"{name[:37]}..."


def _read_header(stream: BinaryIO) -> ArrayHeader:
    """Read the header of an .npy file; the stream is then at the first element.

    Source: numpy.lib.format, versions 1.0 to 3.0.
    """
    start = stream.read(8)
    if len(start) < 8 or start[:6] != b"\x93NUMPY" or start[6] not in (1, 2, 3):
        raise RoverFileError("is no array; it must be one, as numpy.savez writes it")
    kind = "<H" if start[6] == 1 else "<I"
    (length,) = struct.unpack(kind, stream.read(struct.calcsize(kind)))
    if length > MAX_HEADER:
        raise RoverFileError(f"has a header of {length} bytes; it may have at most {MAX_HEADER}")
    text = stream.read(length).decode("latin1")
    found = {key: pattern.search(text) for key, pattern in _HEADER.items()}
    rest = text
    for match in found.values():
        rest = rest.replace(match.group(), "", 1) if match else rest
    if None in found.values() or not re.fullmatch(r"\s*\{[\s,]*\}\s*", rest):
        raise RoverFileError(
            f"has the header {ascii(text.strip())[:80]}; it must be that of an "
            "array of plain numbers or texts"
        )
    descr, order, shape = (match for match in found.values() if match)
    return ArrayHeader(
        _read_dtype(descr["dtype"]),
        tuple(int(size) for size in re.findall(r"\d+", shape["shape"])),
        order["order"] == "True",
    )


def _read_dtype(text: str) -> np.dtype[Any]:
    """Return the type that a header names."""
    kind, size = re.findall(r"([a-zA-Z])(\d*)", text)[0]
    if kind == "O":
        raise RoverFileError("holds Python objects; it must hold plain numbers or texts")
    itemsize = int(size or 0) * (4 if kind == "U" else 1)
    if itemsize not in SIZES.get(kind, ()):
        raise RoverFileError(f"has elements of type {text}; they must be plain numbers or texts")
    return np.dtype(text)


def _unpack(stream: BinaryIO, header: ArrayHeader, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Unpack the elements of an array piece by piece."""
    array = np.empty(header.shape, dtype)
    flat: Any = array.T.flat if header.fortran_order else array.reshape(-1)
    # Bytes other than 0 and 1 are no valid bool for NumPy; they are read as numbers.
    raw = np.dtype(np.uint8) if header.dtype.kind == "b" else header.dtype
    step = max(CHUNK // max(raw.itemsize, 1), 1)
    for begin in range(0, header.size, step):
        count = min(step, header.size - begin)
        piece = np.frombuffer(stream.read(count * raw.itemsize), raw)
        if len(piece) < count:
            raise RoverFileError("ends too early")
        if raw.kind == "U":
            _check_texts(piece)
        flat[begin : begin + count] = piece
    return array


def _check_texts(texts: NDArray[np.str_]) -> None:
    """Check that all characters exist."""
    codes = texts.view(np.dtype(np.uint32).newbyteorder(texts.dtype.byteorder))
    if texts.itemsize and (codes > MAX_CODE_POINT).any():
        raise RoverFileError("holds characters that do not exist; it must hold texts")
