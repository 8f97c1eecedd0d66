"""Where a rover can go on a surveyed map and come back from, over cells and headings."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rover_planner.errors import PlanningError
from rover_planner.survey.layers import number_limits
from rover_planner.survey.layout import Box, Index
from rover_planner.survey.reach.distances import TileDistances
from rover_planner.survey.reach.grid import HeadingGrid, choose_tile
from rover_planner.survey.reach.kept_area import (
    DISTANCE,
    ReachableArea,
    new_area,
    note_area,
    open_area,
)
from rover_planner.survey.reach.merged_graph import MergedGraph
from rover_planner.survey.reach.moves import find_moves
from rover_planner.survey.store import SurveyStore

Keep = Callable[[Box, NDArray[np.float32]], None]
"""Takes the distances of a box of cells."""


class AreaNumbers(NamedTuple):
    """The numbers of an area; meanings as in `ReachableArea`."""

    cells: int
    reached: int
    longest: float | None
    farthest: Index | None


def find_reachable(
    store: SurveyStore,
    x: float,
    y: float,
    tile: int | None = None,
    report: Callable[[str], object] = lambda what: None,
) -> ReachableArea:
    """Find where the rover can go from a place and return to it, and keep that in the store.

    It drives straight ahead between cells where the heading is passable at all cells on the way.
    It turns by one heading where both are passable, or, if the survey has judged turns, where it
    may turn on the spot at both. Ways begin at any passable heading and end at any.

    Args:
        store: The survey.
        x: Start [m], map frame.
        y: The same.
        tile: Side of the tiles in which the map is searched [cells] (default: that of some
            200 MB). The result does not depend on it.
        report: Called with what is done next.

    Raises:
        PlanningError: The start is off the map or not surveyed, or the store cannot be written.
    """
    notes = store.notes
    start = _cell_at(store, x, y)
    passable = store.layer("passable_headings")
    grid = HeadingGrid(
        passable,
        store.layer("turnable_headings") if notes.turns else passable,
        find_moves(notes.headings, notes.cell),
        tile or choose_tile(notes.headings, notes.layout.chunk),
    )
    with new_area(store) as (folder, group):
        distance = group[DISTANCE]
        numbers = search_area(grid, start, distance.__setitem__, folder, report)
        found = ReachableArea(start, (x, y), distance, notes.cell, *numbers)
        note_area(store, group, found)
    kept = open_area(store)
    assert kept is not None
    return kept


def say_why_none(store: SurveyStore, start: Index) -> str:
    """Return why the rover cannot leave a start from which it reaches nothing.

    Args:
        store: The survey.
        start: Row and column of the start.
    """
    number = int(store.layer("first_limit")[start])
    names = {number: name for name, number in number_limits().items()}
    return f"no heading is passable at the start: {names.get(number) or 'not surveyed'}"


def search_area(
    grid: HeadingGrid,
    start: Index,
    keep: Keep,
    folder: Path,
    report: Callable[[str], object] = lambda what: None,
) -> AreaNumbers:
    """Find the cells that can be reached and returned from.

    Args:
        grid: Passable headings.
        start: Row and column of the start.
        keep: Called with the distances [m] of each part of the map in which there are such cells.
        folder: An empty folder for distances.
        report: Called with what is done next.
    """
    report("join the parts of the map")
    merged = MergedGraph(grid, start)
    report("find what is reached and returned from")
    distances, reached, cells = TileDistances(grid, folder), 0, 0
    for tile in grid.tiles:
        reach = merged.reach_of(tile)
        if reach is not None:
            reached += int(reach.reached.sum())
            here = int(reach.inside.any(axis=2).sum())
            cells += here
            if here:
                distances.ask(tile, reach.inside)
    report("measure the ways")
    if cells:
        distances.search(start)
    longest, farthest = -1.0, (0, 0)
    for box, nearest in distances.nearest():
        keep(box, nearest)
        lengths = np.where(np.isfinite(nearest), nearest, -1.0)
        row, column = np.unravel_index(int(np.argmax(lengths)), lengths.shape)
        length = float(lengths[row, column])
        place = box[0].start + int(row), box[1].start + int(column)
        if (-length, place) < (-longest, farthest):
            longest, farthest = length, place
    if not cells:
        return AreaNumbers(0, reached, None, None)
    return AreaNumbers(cells, reached, longest, farthest)


def _cell_at(store: SurveyStore, x: float, y: float) -> Index:
    """Return row and column of the surveyed cell nearest to a place.

    Raises:
        PlanningError: The place is off the map, or not surveyed.
    """
    notes = store.notes
    left, low = notes.frame.origin
    rows, columns = notes.layout.shape
    row, column = round((y - low) / notes.cell), round((x - left) / notes.cell)
    if not (0 <= row < rows and 0 <= column < columns):
        right, high = left + (columns - 1) * notes.cell, low + (rows - 1) * notes.cell
        raise PlanningError(
            f"from ({_show(x)}, {_show(y)}) is off the map; it must be within "
            f"x {_show(left)} to {_show(right)}, y {_show(low)} to {_show(high)}"
        )
    if (row // notes.layout.chunk, column // notes.layout.chunk) not in store.find_finished():
        raise PlanningError(f"from ({_show(x)}, {_show(y)}) is not surveyed yet")
    return row, column


def _show(metres: float) -> str:
    """Return a coordinate to a millimetre; those of map projections have many digits."""
    return f"{round(metres, 3):.15g}"
