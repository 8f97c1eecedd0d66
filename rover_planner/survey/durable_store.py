# SPDX-License-Identifier: Apache-2.0
"""A Zarr store on the local disk whose files survive a power failure once they are written."""

import asyncio
import os
import uuid
from pathlib import Path
from typing import Any

from zarr.storage import LocalStore


class DurableStore(LocalStore):
    """Writes each file aside, forces it to the disk, renames it, and forces its folders.

    So a file has its old content or the whole new one, and what `set` has returned from is kept.
    """

    def __init__(self, root: Path | str, *, read_only: bool = False) -> None:
        """Open a folder; arguments are those of `LocalStore`."""
        super().__init__(root, read_only=read_only)
        self._kept: set[Path] = set()

    async def set(self, key: str, value: Any) -> None:
        """Write a file, as `LocalStore.set`."""
        self._check_writable()
        await asyncio.to_thread(
            write_durably, self.root / key, value.to_bytes(), self.root, self._kept
        )

    def set_sync(self, key: str, value: Any) -> None:
        """Write a file, as `set`; newer versions of Zarr call this."""
        self._check_writable()
        write_durably(self.root / key, value.to_bytes(), self.root, self._kept)


def write_durably(path: Path, content: bytes, root: Path, kept: set[Path] | None = None) -> None:
    """Write a file whole, and force it and its folders up to `root` to the disk.

    Args:
        path: The file.
        content: What it holds.
        root: The topmost folder that is forced.
        kept: As for `force_folders`.

    Raises:
        OSError: The system refuses; then the file is as before.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    aside = path.with_name(f".{path.name}.{uuid.uuid4().hex}.partial")
    try:
        with aside.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        aside.replace(path)
    except OSError:
        aside.unlink(missing_ok=True)
        raise
    force_folders(path.parent, root, kept)


def force_folders(folder: Path, root: Path, kept: set[Path] | None = None) -> None:
    """Force the entries of a folder, and of those above it up to `root`, to the disk.

    Args:
        folder: The folder.
        root: The topmost folder that is forced.
        kept: Folders that are known to be on the disk, with all above them, so that only their
            own entries are to be forced; those that are forced now are added.
    """
    new = []
    for one in (folder, *folder.parents):
        number = os.open(one, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(number)
        finally:
            os.close(number)
        if one == root or (kept is not None and one in kept):
            break
        new.append(one)
    if kept is not None:
        kept.update(new)
