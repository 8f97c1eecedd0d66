# SPDX-License-Identifier: Apache-2.0
"""The reachable area of a survey, kept in the survey's store."""

import contextlib
import os
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rover_physics.files.validation import show_file
from rover_planner.errors import PlanningError
from rover_planner.survey.layout import Index
from rover_planner.survey.store import SurveyStore

GROUP = "reachable"
"""Group of the store that holds the last area."""
DISTANCE = "distance"
"""Array of the group: (ny, nx) length of the shortest path [m]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class AreaNumbers:
    """The numbers of the cells that can be reached from a start and returned from."""

    cells: int
    """Number of cells that can be reached and returned from."""
    reached: int
    """Number of cells that can be reached, returned from or not."""
    longest: float | None
    """Longest of the shortest paths [m]; None if there is none."""
    farthest: Index | None
    """Row and column of its end; None if there is none."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ReachableArea(AreaNumbers):
    """The cells that can be reached from a start and returned from."""

    start: Index
    """Row and column of the surveyed cell nearest to the start."""
    from_place: tuple[float, float]
    """x, y of the start as it was asked [m]."""
    distance: Any
    """(ny, nx) Zarr array, length of the shortest path [m], infinite where the rover cannot go or
    return."""
    cell: float
    """Distance of surveyed cells [m]."""

    @property
    def area(self) -> float:
        """Area of the cells [m^2]."""
        return self.cells * self.cell**2


@contextlib.contextmanager
def new_area(store: SurveyStore) -> Iterator[tuple[Path, Any]]:
    """Yield a folder for work, and a group whose array of distances is to be filled.

    The group takes the place of that of an earlier area at the end, or vanishes after an error.

    Raises:
        PlanningError: The store cannot be written.
    """
    import zarr

    layout = store.notes.layout
    try:
        with tempfile.TemporaryDirectory(dir=store.path, prefix=f".{GROUP}.") as folder:
            work, aside = Path(folder, "work"), Path(folder, GROUP)
            work.mkdir()
            group = zarr.open_group(aside, mode="w")
            group.create_array(
                DISTANCE,
                shape=layout.shape,
                chunks=tuple(min(layout.chunk, size) for size in layout.shape),
                dtype="f4",
                fill_value=float("inf"),
            )
            yield work, group
            kept = store.path / GROUP
            if kept.exists():
                kept.rename(Path(folder, "before"))
            os.replace(aside, kept)
    except OSError as error:
        raise PlanningError(
            f"{show_file(store.path)}: cannot be written: {error.strerror}"
        ) from None


def note_area(
    store: SurveyStore, group: Any, start: Index, place: tuple[float, float], numbers: AreaNumbers
) -> None:
    """Note beside the distances of an area its start, as a cell and as asked, and its numbers."""
    finished = len(store.find_finished())
    group.attrs.update(
        {"start": start, "from": place, **asdict(numbers), "chunks_finished": finished}
    )


def open_area(store: SurveyStore) -> ReachableArea | None:
    """Return the last area of a survey; None if there is none, or chunks were finished since."""
    import zarr

    if not (store.path / GROUP).exists():
        return None
    try:
        group: Any = zarr.open_group(store.path, mode="r", path=GROUP)
        notes = dict(group.attrs)
        if notes.pop("chunks_finished") != len(store.find_finished()):
            return None
        farthest = notes.pop("farthest")
        return ReachableArea(
            start=tuple(notes.pop("start")),
            from_place=tuple(notes.pop("from")),
            distance=group[DISTANCE],
            cell=store.notes.cell,
            farthest=None if farthest is None else tuple(farthest),
            **notes,
        )
    except (OSError, KeyError, ValueError, TypeError):
        return None
