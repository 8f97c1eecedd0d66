# SPDX-License-Identifier: Apache-2.0
"""Processes that cannot write to their disk: no rights to write anywhere, or no space left."""

import ctypes
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_PR_CAPBSET_DROP = 24
_CAP_DAC_OVERRIDE = 1


def drop_rights() -> None:
    """Make file rights bind the program that starts next, even if the user is root.

    For `preexec_fn`; without root, there is nothing to drop.
    """
    ctypes.CDLL(None).prctl(_PR_CAPBSET_DROP, _CAP_DAC_OVERRIDE, 0, 0, 0)


def fill_disk() -> None:
    """Make each write to a file fail, as on a full disk; files can still be created.

    For `preexec_fn`. The error is EFBIG; only a file system of its own could give ENOSPC.
    """
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))


@contextmanager
def read_only(folder: Path) -> Iterator[None]:
    """Take away the rights to write to a folder and the folders below, then give them back."""
    folders = [folder, *(path for path in folder.rglob("*") if path.is_dir())]
    for path in folders:
        path.chmod(0o555)
    try:
        yield
    finally:
        for path in folders:
            path.chmod(0o755)
