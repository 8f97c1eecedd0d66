# SPDX-License-Identifier: Apache-2.0
"""The Zarr store of a survey: created whole, filled chunk by chunk, never mixed with another."""

import contextlib
import errno
import os
import shutil
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.files.user_file import writing
from rover_physics.files.validation import errors_of, show_file
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.classification import TRAVERSABILITY_CLASSES
from rover_planner.errors import PlanningError
from rover_planner.survey.layers import NOT_SURVEYED, list_layers, number_limits
from rover_planner.survey.layout import Index, SurveyLayout
from rover_planner.survey.map_source import MAP, GeoTiffMap, MapFrame, StoredMap, keep_map

FORMAT = 2
"""Version of the store's format: 2 writes all files of a chunk, also those without values."""
NOTES = "rover_planner_survey"
"""Attribute of the store with all that is known of its survey."""
SECONDS = "seconds"
"""Array (rows, columns) of chunks: time that a chunk took [s]; NaN while it is not finished. Each
element is a file, written last."""
WRITERS = 8
"""Number of layers that are written at a time."""
UNREADABLE = (OSError, RuntimeError, ValueError, TypeError, KeyError)
"""Errors of Zarr and its codecs where a file is damaged or gone."""


@dataclass(frozen=True)
class StoreNotes:
    """The notes of a store on its survey."""

    description: dict[str, Any]
    """All that the result depends on, from `SurveyRequest.describe`."""
    layout: SurveyLayout
    """Cells and chunks."""
    frame: MapFrame
    """Place and size of the cells of the map."""
    map_file: str
    """GeoTIFF file of the map; empty if the map is kept in the store."""

    @property
    def headings(self) -> int:
        """Number of headings."""
        return int(self.description["headings"])

    @property
    def layers(self) -> dict[str, np.number]:
        """Value of each layer in cells that are not surveyed, of the type of the layer."""
        asked = self.description
        return list_layers(asked["headings"], asked["turns"], asked["chance"])

    @property
    def cell(self) -> float:
        """Distance of surveyed cells [m]."""
        return self.layout.step * self.frame.resolution

    def to_dict(self) -> dict[str, Any]:
        """Return the notes as JSON types."""
        layout, frame = self.layout, self.frame
        return {
            "format": FORMAT,
            "description": self.description,
            "map_shape": list(layout.map_shape),
            "chunk": layout.chunk,
            "halo": layout.halo,
            "resolution": frame.resolution,
            "origin": list(frame.origin),
            "crs": frame.crs,
            "map_file": self.map_file,
            "classes": {str(number): name for number, name in enumerate(TRAVERSABILITY_CLASSES)},
            "limits": {str(number): name for name, number in number_limits().items()},
            "not_surveyed": NOT_SURVEYED,
        }

    @staticmethod
    def from_dict(notes: Mapping[str, Any]) -> "StoreNotes":
        """Return the notes from JSON types."""
        ny, nx = notes["map_shape"]
        step = int(notes["description"]["step"])
        x, y = notes["origin"]
        return StoreNotes(
            dict(notes["description"]),
            SurveyLayout((ny, nx), step, int(notes["chunk"]), int(notes["halo"])),
            MapFrame((ny, nx), float(notes["resolution"]), (x, y), str(notes["crs"])),
            str(notes["map_file"]),
        )


class KeptLayer:
    """A Zarr array (rows, columns), which says in one line if it cannot be read."""

    def __init__(self, array: Any, path: Path):
        """Keep the array of a store, whose path is for what is said of it."""
        self._array, self._path = array, path
        self.shape: tuple[int, ...] = array.shape
        """Rows and columns."""
        self.dtype: np.dtype = array.dtype
        """Type of the values."""

    def file_of(self, chunk: Index) -> Path:
        """Return the file of a chunk."""
        key = self._array.metadata.encode_chunk_key(chunk)
        return Path(self._path, self._array.basename, key)

    def __getitem__(self, key: Any) -> NDArray[Any]:
        """Read a part.

        Raises:
            PlanningError: A file of the layer is damaged.
        """
        try:
            return np.asarray(self._array[key])
        except UNREADABLE as error:
            raise _damaged(self._path, self._array.basename, error) from None


class SurveyStore:
    """The store of one survey."""

    def __init__(self, path: Path):
        """Open a store.

        Raises:
            PlanningError: There is none, it is not that of a survey of this format, or a layer is
                missing.
        """
        import zarr

        self.path = path
        if not path.exists():
            raise PlanningError(f"no survey {show_file(path)}")
        try:
            self._group: Any = zarr.open_group(path, mode="r+")
            notes = self._group.attrs[NOTES]
            if notes["format"] != FORMAT:
                raise PlanningError(
                    f"{show_file(path)} is a survey of format {notes['format']}; it must be "
                    f"{FORMAT}: survey again into another folder"
                )
            self.notes = StoreNotes.from_dict(notes)
        except (OSError, KeyError, ValueError, TypeError) as error:
            raise PlanningError(
                f"{show_file(path)} is not a survey: {type(error).__name__}; "
                "name another folder, or remove it"
            ) from None
        layout = self.notes.layout
        for name in (*self.notes.layers, SECONDS):
            shape = layout.chunks if name == SECONDS else layout.shape
            if name not in self._group:
                raise _damaged(path, name, KeyError(name))
            if (found := self._group[name].shape) != shape:
                raise _damaged(path, name, ValueError(f"{found} cells, not {shape}"))

    def check(self, description: Mapping[str, Any], chunk: int | None) -> None:
        """Check that the store is of the survey that is asked for.

        Raises:
            PlanningError: It is not; the text says what differs.
        """
        kept = self.notes.description
        for key in (*kept, *description):
            if kept.get(key) != description.get(key):
                raise PlanningError(
                    f"{show_file(self.path)} has a survey with another {key}"
                    f"{_show_difference(kept.get(key), description.get(key))}; name another "
                    "folder, or ask the same"
                )
        if chunk is not None and chunk != self.notes.layout.chunk:
            raise PlanningError(
                f"{show_file(self.path)} has chunks of {self.notes.layout.chunk} cells, not "
                f"{chunk}; leave --chunk out to go on with it"
            )

    def check_map(self) -> None:
        """Check that a map that is not kept in the store is still the one of its survey.

        Raises:
            PlanningError: It has changed, or cannot be read.
        """
        source, kept = self.open_map(), self.notes.description["map"]
        if isinstance(source, GeoTiffMap) and source.hash_content() != kept:
            raise PlanningError(
                f"{show_file(self.notes.map_file)} has changed since {show_file(self.path)} was "
                "made"
            )

    def find_finished(self) -> set[Index]:
        """Return the chunks that are finished, and of which no file was lost since."""
        rows, columns = np.nonzero(self.layer(SECONDS)[:] >= 0.0)
        layers = [self.layer(name) for name in self.notes.layers]
        return {
            chunk
            for chunk in zip(rows.tolist(), columns.tolist(), strict=True)
            if all(layer.file_of(chunk).is_file() for layer in layers)
        }

    def write(self, chunk: Index, layers: Mapping[str, np.ndarray], seconds: float) -> None:
        """Write the layers of a chunk, then that it is finished.

        Layers are forced to the disk before, so that a chunk that is marked as finished is there
        after a power failure.

        Raises:
            OSError: The system refuses.
        """
        import zarr

        rows, columns = self.notes.layout.cells_of(chunk)
        with zarr.config.set({"array.write_empty_chunks": True}):  # else no file tells of a loss
            arrays = {name: self._group[name] for name in layers}

        def put(name: str) -> None:
            arrays[name][rows, columns] = layers[name]
            force_to_disk(self.layer(name).file_of(chunk), self.path)

        with ThreadPoolExecutor(WRITERS) as writers:  # the disk takes many files at a time
            for _ in writers.map(put, layers):
                pass
        self._group[SECONDS][chunk] = seconds
        force_to_disk(self.layer(SECONDS).file_of(chunk), self.path)

    def open_map(self) -> GeoTiffMap | StoredMap:
        """Return the map: the GeoTIFF that the notes name, or, if they name none, the kept one."""
        file = self.notes.map_file
        return GeoTiffMap(Path(file)) if file else StoredMap(self._group[MAP])

    def layer(self, name: str) -> KeptLayer:
        """Return a layer (rows, columns)."""
        return KeptLayer(self._group[name], self.path)

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other commands from writing into the store.

        Raises:
            PlanningError: Another command writes into it.
        """
        import fcntl

        with errors_of(self.path, PlanningError), writing():
            lock = (self.path / ".lock").open("w")
        with lock as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise PlanningError(
                    f"another survey is writing into {show_file(self.path)}; wait for its end"
                ) from None
            yield


def create_store(path: Path, notes: StoreNotes, terrain: Terrain | None) -> None:
    """Create the store of a survey that has not begun, or nothing if that fails.

    Another command that creates it at the same time may be first; then its store stays.

    Args:
        path: Folder to create.
        notes: What to note of the survey.
        terrain: The map, if it is to be kept in the store.

    Raises:
        PlanningError: It cannot be written.
    """
    import zarr

    aside = path.with_name(f"{path.name}.{os.getpid()}.new")
    layout = notes.layout
    try:
        with errors_of(path, PlanningError), writing():
            group: Any = zarr.open_group(aside, mode="w")
            side = min(layout.chunk, max(layout.shape))
            for name, value in notes.layers.items():
                group.create_array(
                    name,
                    shape=layout.shape,
                    chunks=(side, side),
                    dtype=value.dtype,
                    fill_value=value.item(),
                )
            group.create_array(
                SECONDS, shape=layout.chunks, chunks=(1, 1), dtype="f4", fill_value=float("nan")
            )
            if terrain is not None:
                keep_map(group, terrain)
            group.attrs[NOTES] = notes.to_dict()
            os.sync()
            try:
                aside.rename(path)
            except OSError as error:
                if error.errno not in (errno.EEXIST, errno.ENOTEMPTY):
                    raise
            force_to_disk(path.parent, path.parent)
    finally:  # also after Ctrl-C
        shutil.rmtree(aside, ignore_errors=True)


def force_to_disk(path: Path, root: Path) -> None:
    """Force a file or folder, and the folders above it up to `root`, to the disk."""
    for one in (path, *path.parents):
        number = os.open(one, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)
        if one == root:
            return


def is_refusal(error: OSError) -> bool:
    """Return whether the system refuses to write: then so it does for other chunks."""
    refusals = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM, errno.EFBIG)
    return error.errno in refusals


def _damaged(path: Path, name: str, error: Exception) -> PlanningError:
    """Return what is said of an array of a store that cannot be read."""
    why = (str(error).splitlines() or [""])[0]
    return PlanningError(
        f"{show_file(path)}: {name} is damaged ({type(error).__name__}: {why:.80}); "
        "survey again into another folder"
    )


def _show_difference(kept: object, asked: object) -> str:
    """Return the first difference of two values in words."""
    if isinstance(kept, dict) and isinstance(asked, dict):
        if kept.get("name") != asked.get("name"):
            return _show_difference(kept.get("name"), asked.get("name"))
        for key in (*kept, *asked):
            if kept.get(key) != asked.get(key):
                return f" ({key}{_show_difference(kept.get(key), asked.get(key))})"
    return f": {kept!s:.40}, not {asked!s:.40}"
