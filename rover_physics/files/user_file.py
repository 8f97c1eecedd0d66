# SPDX-License-Identifier: Apache-2.0
"""Reads and writes files that a user names: never waits, and reads regular files only."""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from rover_physics.errors import RoverFileError

OPEN_FLAGS = os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC
"""Flags for opening a file of unknown kind: a pipe without a writer does not wait."""

_KINDS = (
    (stat.S_ISDIR, "a directory"),
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


@contextmanager
def open_regular_file(path: str | Path) -> Iterator[BinaryIO]:
    """Open a regular file for reading.

    Args:
        path: The file; symbolic links are followed.

    Raises:
        RoverFileError: There is no such file, it is not a regular file, or it cannot be read. The
            text does not name the file; `errors_of` adds the name.
    """
    with _reading():
        _check_regular(os.stat(path))  # before it is opened, because opening can start a device
        file = os.fdopen(os.open(path, OPEN_FLAGS), "rb")
    with file:
        _check_regular(os.fstat(file.fileno()))  # the name may mean another file than before
        yield file


def read_regular_file(path: str | Path, most: int) -> bytes:
    """Return the contents of a regular file.

    Args:
        path: The file.
        most: Largest allowed size [bytes].

    Raises:
        RoverFileError: As for `open_regular_file`, or the file is larger.
    """
    with open_regular_file(path) as file, _reading():
        # One byte more than the limit: the size that the system tells is 0 for files of /proc.
        content = file.read(most + 1) or b""
    if len(content) > most:
        raise RoverFileError(f"is larger than {most} bytes, the most that is read")
    return content


def write_file(path: str | Path, content: bytes) -> None:
    """Write a file; an existing one is overwritten.

    Raises:
        RoverFileError: It cannot be written; the text does not name the file.
    """
    with writing(), open(path, "wb", opener=open_without_waiting) as file:
        file.write(content)


def open_without_waiting(path: str, flags: int) -> int:
    """Open a file for writing; a pipe that nobody reads is an error."""
    descriptor = os.open(path, flags | os.O_NONBLOCK | os.O_NOCTTY, 0o666)
    os.set_blocking(descriptor, True)
    return descriptor


def _check_regular(status: os.stat_result) -> None:
    """Raise a RoverFileError for a directory, a device, a pipe or a socket."""
    if stat.S_ISREG(status.st_mode):
        return
    kind = next((kind for holds, kind in _KINDS if holds(status.st_mode)), "no file")
    raise RoverFileError(f"cannot be read: it is {kind}; it must be a regular file")


@contextmanager
def writing() -> Iterator[None]:
    """Turn the errors of the system into a RoverFileError that does not name the file."""
    try:
        yield
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise RoverFileError(f"cannot be written: {reason}") from error


@contextmanager
def _reading() -> Iterator[None]:
    """Turn the errors of the system into a RoverFileError."""
    try:
        yield
    except OSError as error:
        raise RoverFileError(f"cannot be read: {error.strerror or error}") from error
    except ValueError as error:  # a name with a zero byte, or that the file system cannot write
        raise RoverFileError(f"cannot be read: the name is impossible ({error})") from error
