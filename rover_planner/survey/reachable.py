"""Where a rover can go on a surveyed map and come back from, over cells and headings."""

import math
import tempfile
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_planner.errors import PlanningError
from rover_planner.survey.layers import unpack_bits
from rover_planner.survey.moves import Moves, find_moves
from rover_planner.survey.reachable_kernels import advance_front
from rover_planner.survey.store import SurveyStore

IN_MEMORY = 4_000_000_000
"""Largest size of the distances that are kept in memory [bytes]; larger ones are in a file."""


@dataclass(frozen=True, eq=False)
class ReachableArea:
    """The cells that can be reached from a start and returned from."""

    start: tuple[int, int]
    """Row and column of the surveyed cell nearest to the start."""
    distance: NDArray[np.float32]
    """(ny, nx) length of the shortest way [m], infinite where the rover cannot go or return."""
    cell: float
    """Distance of surveyed cells [m]."""
    reached: int
    """Number of cells that can be reached, returned from or not."""

    @property
    def cells(self) -> int:
        """Number of cells that can be reached and returned from."""
        return int(np.isfinite(self.distance).sum())

    @property
    def area(self) -> float:
        """Their area [m^2]."""
        return self.cells * self.cell**2

    @property
    def farthest(self) -> tuple[int, int] | None:
        """Row and column of the cell with the longest way; None if there is none."""
        if not self.cells:
            return None
        at = int(np.argmax(np.where(np.isfinite(self.distance), self.distance, -1.0)))
        return divmod(at, self.distance.shape[1])


def find_reachable(store: SurveyStore, x: float, y: float) -> ReachableArea:
    """Find where the rover can go from a place and return to it.

    It drives straight ahead between cells where the heading is passable at all cells on the way.
    It turns by one heading where both are passable, or, if the survey has judged turns, where it
    may turn on the spot at both. Ways begin at any passable heading and end at any.

    Args:
        store: The survey.
        x: Start [m], map frame.
        y: The same.

    Raises:
        PlanningError: The start is off the map, or not surveyed.
    """
    notes = store.notes
    start = _cell_at(store, x, y)
    passable = np.asarray(store.layer("passable_headings")[:], np.uint64)
    turnable = passable
    if notes.turns:
        turnable = np.asarray(store.layer("turnable_headings")[:], np.uint64)
    return search_area(
        passable, turnable, find_moves(notes.headings, notes.cell), start, notes.cell
    )


def search_area(
    passable: NDArray[np.uint64],
    turnable: NDArray[np.uint64],
    moves: Moves,
    start: tuple[int, int],
    cell: float,
) -> ReachableArea:
    """Find the cells that can be reached and returned from.

    Args:
        passable: (ny, nx) bits of the passable headings.
        turnable: (ny, nx) bits of the headings at which the rover may turn.
        moves: Moves of the headings.
        start: Row and column of the start.
        cell: Distance of cells [m].
    """
    headings = len(moves.counts)
    open_at = unpack_bits(passable[start], headings)
    first = start[0] * passable.shape[1] + start[1]
    nodes = first * headings + np.flatnonzero(open_at)
    out = _spread((passable, turnable, 1), moves, nodes)
    back = _spread((passable, turnable, -1), moves, nodes)
    nearest = np.full(passable.shape, np.inf, np.float32)
    reached = 0
    for row in range(passable.shape[0]):  # row by row: the distances may be in files
        going = out[row]
        reached += int(np.isfinite(going).any(axis=1).sum())
        nearest[row] = np.where(np.isfinite(back[row]), going, np.inf).min(axis=1)
    return ReachableArea(start, nearest, cell, reached)


def _spread(
    masks: tuple[NDArray[np.uint64], NDArray[np.uint64], int], moves: Moves, nodes: np.ndarray
) -> np.ndarray:
    """Return the distance (ny, nx, headings) [m] of each node from the given ones."""
    shape = (*masks[0].shape, len(moves.counts))
    distance = _new_distances(math.prod(shape))
    front = np.asarray(nodes, np.int64)
    distance[front] = 0.0
    while len(front):
        onward = np.empty(3 * len(front), np.int64)
        front = onward[: advance_front(masks, moves, front, distance, onward)]
    return distance.reshape(shape)


def _new_distances(count: int) -> np.ndarray:
    """Return infinite distances, in a file without a name if they are many."""
    if 4 * count <= IN_MEMORY:
        return np.full(count, np.inf, np.float32)
    with tempfile.TemporaryFile() as file:
        distance = np.memmap(file, np.float32, "w+", shape=(count,))
    distance[:] = np.inf
    return distance


def _cell_at(store: SurveyStore, x: float, y: float) -> tuple[int, int]:
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
            f"from ({x:g}, {y:g}) is off the map; it must be within x {left:g} to {right:g}, "
            f"y {low:g} to {high:g}"
        )
    if (row // notes.layout.chunk, column // notes.layout.chunk) not in store.find_finished():
        raise PlanningError(f"from ({x:g}, {y:g}) is not surveyed yet")
    return row, column
