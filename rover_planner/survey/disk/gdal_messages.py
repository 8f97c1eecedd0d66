# SPDX-License-Identifier: Apache-2.0
"""What GDAL's TIFF library writes to stderr by itself: caught, so that one line tells of it."""

import contextlib
import os
from collections.abc import Iterator

REASONS = ("_tiffWriteProc: ", "_tiffSeekProc: ")
"""Beginnings of lines that say why the system refused to write."""


@contextlib.contextmanager
def catch_messages() -> Iterator[list[str]]:
    """Keep what the process writes to its stderr meanwhile; yield a list that has it at the end.

    Python's own warnings would be caught, too, so little should be done meanwhile.
    """
    lines: list[str] = []
    try:
        before = os.dup(2)
    except OSError:  # a closed stderr tells nothing
        yield lines
        return
    caught = os.memfd_create("stderr")  # not on a disk, as that may be full
    os.dup2(caught, 2)
    try:
        yield lines
    finally:
        os.dup2(before, 2)
        os.close(before)
        with open(caught, "rb") as file:
            file.seek(0)
            lines += file.read().decode(errors="replace").splitlines()


def find_reason(lines: list[str]) -> str:
    """Return why the system refused to write, as "No space left on device"; empty if unsaid."""
    for line in lines:
        for start in REASONS:
            if line.startswith(start):
                return line.removeprefix(start).rstrip(".")
    return ""
