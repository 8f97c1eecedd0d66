# SPDX-License-Identifier: Apache-2.0
"""The search for the cells of a surveyed map that a rover can reach and return from.

A rover moves straight ahead from cell to cell: one move for each heading.
"""

import contextlib
import math
import os
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from rover_physics.files.validation import show_file
from rover_physics.numerics.kernels import exact_kernel
from rover_planner.errors import PlanningError
from rover_planner.survey.layers import bits_type, number_limits, pack_bits, unpack_bits
from rover_planner.survey.layout import Index
from rover_planner.survey.store import SurveyStore

ALIGNED = 0.25
"""Largest angle between a move and its heading, as a share of the angle between headings."""
MAX_CELLS = 64
"""Largest length of a move [cells]."""
CLOSED = -1.0
"""Distance of headings that are not passable."""
GROUP = "reachable"
"""Group of the store that holds the last area, with its numbers, and the number of chunks that
were finished then."""
DISTANCE = "distance"
"""Array of the group: (ny, nx) length of the shortest path [m]."""


@dataclass(frozen=True, eq=False)
class ReachableArea:
    """The cells that can be reached from a start and returned from."""

    start: Index
    """Row and column of the surveyed cell nearest to the start."""
    distance: Any
    """(ny, nx) array or one of Zarr, length of the shortest path [m], infinite where the rover
    cannot go or return."""
    cells: int
    """Number of cells that can be reached and returned from."""
    reached: int
    """Number of cells that can be reached, returned from or not."""
    longest: float | None
    """Longest of the shortest paths [m]; None if there is none."""
    farthest: Index | None
    """Row and column of its end; None if there is none."""


class Moves(NamedTuple):
    """The move of each heading, as kernels read it."""

    steps: np.ndarray
    """(headings, MAX_CELLS, 2) rows and columns from the start to each cell up to the goal, the
    last one."""
    counts: np.ndarray
    """(headings,) number of these cells."""
    lengths: np.ndarray
    """(headings,) length [m]."""

    def reversed(self) -> "Moves":
        """Return the moves from their goals back to their starts, of length 0."""
        steps = np.zeros_like(self.steps)
        for k, count in enumerate(self.counts):
            back = np.vstack([self.steps[k, : count - 1][::-1], np.zeros((1, 2), np.int64)])
            steps[k, :count] = back - self.steps[k, count - 1]
        return Moves(steps, self.counts, np.zeros_like(self.lengths))


def find_moves(headings: int, cell: float) -> Moves:
    """Return the shortest move of each heading that is aligned with it.

    The cells between are those nearest to the line at equal distances, one a row or column.

    Args:
        headings: Number of headings, the first along columns, then equally spaced to the left.
        cell: Distance of surveyed cells [m].
    """
    steps = np.zeros((headings, MAX_CELLS, 2), np.int64)
    counts, lengths = np.zeros(headings, np.int64), np.zeros(headings)
    for k in range(headings):
        row, column = _find_goal(2.0 * math.pi * k / headings, ALIGNED * 2.0 * math.pi / headings)
        counts[k] = max(abs(row), abs(column))
        for i in range(1, counts[k] + 1):
            steps[k, i - 1] = round(row * i / counts[k]), round(column * i / counts[k])
        lengths[k] = cell * math.hypot(row, column)
    return Moves(steps, counts, lengths)


def _find_goal(yaw: float, largest: float) -> tuple[int, int]:
    """Return row and column of the nearest cell in a direction [rad], within an angle [rad]."""
    for size in range(1, MAX_CELLS + 1):
        found = []
        for side in range(-size, size + 1):
            for row, column in ((side, size), (side, -size), (size, side), (-size, side)):
                off = math.remainder(math.atan2(row, column) - yaw, 2.0 * math.pi)
                if abs(off) <= largest + 1e-9:
                    found.append((math.hypot(row, column), abs(off), row, column))
        if found:
            return min(found)[2:]
    raise AssertionError("64 headings have goals within 64 cells")


class HeadingGrid(NamedTuple):
    """Passable headings, turns and moves on a map; a node is a cell at a passable heading."""

    passable: Any
    """(ny, nx) bits of the passable headings, an array or one of Zarr."""
    turnable: Any
    """The same for headings at which the rover may turn."""
    moves: Moves
    """The move of each heading."""
    chunk: int
    """Number of rows that are read at once."""


def find_reachable(
    store: SurveyStore, x: float, y: float, report: Callable[[str], object] = lambda what: None
) -> ReachableArea:
    """Find where the rover can go from a place and return to it, and keep that in the store.

    It drives straight ahead between cells where the heading is passable at all cells between.
    It turns by one heading where both are passable, or, if the survey has judged turns, where it
    may turn on the spot at both. Paths begin at any passable heading and end at any.

    Args:
        store: The survey.
        x: Start [m], map frame.
        y: The same.
        report: Called with what is done next.

    Raises:
        PlanningError: The start is off the map or not surveyed, or the store cannot be written.
    """
    import zarr

    notes = store.notes
    start = _cell_at(store, x, y)
    passable = store.layer("passable_headings")
    grid = HeadingGrid(
        passable,
        store.layer("turnable_headings") if notes.description["turns"] else passable,
        find_moves(notes.headings, notes.cell),
        notes.layout.chunk,
    )
    with _new_group(store) as (folder, group):
        area = search_area(grid, start, group[DISTANCE], folder, report)
        numbers = {
            name: getattr(area, name) for name in ("cells", "reached", "longest", "farthest")
        }
        finished = len(store.find_finished())
        group.attrs.update(
            {"start": start, "from": (x, y), **numbers, "chunks_finished": finished}
        )
    kept: Any = zarr.open_group(store.path, mode="r", path=GROUP)
    return replace(area, distance=kept[DISTANCE])


@contextlib.contextmanager
def _new_group(store: SurveyStore) -> Iterator[tuple[Path, Any]]:
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


def explain_no_area(store: SurveyStore, start: Index) -> str:
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
    area: Any,
    folder: Path,
    report: Callable[[str], object] = lambda what: None,
) -> ReachableArea:
    """Find the cells that can be reached and returned from.

    All that grows with the map is in files that are mapped to memory: the system keeps in memory
    what the search is about, and as much of the rest as there is room for.

    Args:
        grid: Passable headings.
        start: Row and column of the start.
        area: (ny, nx) array or one of Zarr, infinite, to which the distances [m] are written.
        folder: An empty folder for files of 4 bytes a node and 2 bits a node.
        report: Called with what is done next.
    """
    (rows, columns), headings = grid.passable.shape, len(grid.moves.counts)
    spans = [slice(row, min(row + grid.chunk, rows)) for row in range(0, rows, grid.chunk)]
    distance = _map_file(folder / "distance", np.float32, (rows, columns, headings))
    turnable, returns = (
        _map_file(folder / name, bits_type(headings), (rows, columns)) for name in ("turn", "back")
    )
    for span in spans:
        turnable[span] = np.asarray(grid.turnable[span]) & np.asarray(grid.passable[span])

    def measure(moves: Moves) -> None:
        for span in spans:
            for row, bits in enumerate(np.asarray(grid.passable[span]), span.start):
                distance[row] = np.where(unpack_bits(bits, headings), np.inf, CLOSED)
        _measure_paths(distance, turnable, moves, start)

    report("find where the rover returns from")
    measure(grid.moves.reversed())
    for row in range(rows):
        returns[row] = pack_bits(distance[row] == 0.0)
    report("measure the paths")
    measure(grid.moves)
    cells, reached, longest, farthest = 0, 0, -1.0, None
    for span in spans:
        nearest = np.full((span.stop - span.start, columns), np.inf, np.float32)
        for row, lengths in zip(range(span.start, span.stop), nearest, strict=True):
            is_reached = np.isfinite(distance[row]) & (distance[row] >= 0.0)
            inside = is_reached & unpack_bits(returns[row], headings)
            lengths[:] = np.where(inside, distance[row], np.inf).min(axis=1)
            reached += int(is_reached.any(axis=1).sum())
            ends = np.where(np.isfinite(lengths), lengths, -1.0)
            column = int(ends.argmax())
            if ends[column] > longest:
                longest, farthest = float(ends[column]), (row, column)
        if np.isfinite(nearest).any():
            area[span] = nearest
            cells += int(np.isfinite(nearest).sum())
    return ReachableArea(start, area, cells, reached, longest if cells else None, farthest)


def _measure_paths(
    distance: NDArray[np.float32], turnable: NDArray[Any], moves: Moves, start: Index
) -> None:
    """Find the length of the shortest path from any heading at a cell to each node.

    Lengths are sums from the start on, rounded after each move, and the least of all paths; so
    they do not depend on the order of the search. Nodes up to one move ahead of the nearest go
    first, so that few are visited twice.

    Args:
        distance: (ny, nx, headings) infinite, or CLOSED where not passable; written.
        turnable: (ny, nx) bits of the headings at which the rover may turn.
        moves: Moves.
        start: Row and column of the cell.
    """
    _, columns, headings = distance.shape
    flat, ahead = distance.reshape(-1), moves.lengths.min()
    nodes = (start[0] * columns + start[1]) * headings + np.arange(headings)
    waiting = nodes[flat[nodes] > CLOSED]
    flat[waiting] = 0.0
    while len(waiting):
        far = flat[waiting]
        is_next = far <= far.min() + ahead
        front = waiting[is_next]
        onward = np.empty(3 * len(front), np.int64)
        count = advance_front(distance, turnable, moves, front, onward)
        waiting = np.concatenate([waiting[~is_next], onward[:count]])


@exact_kernel
def advance_front(distance, turnable, moves, front, onward):
    """Advance a front by one move or turn; return how many nodes are nearer than before.

    A node is a cell at a heading: `cell * headings + heading`, cells row by row.

    Args:
        distance: (ny, nx, headings) distance of each node so far [m], infinite if not reached,
            below 0 if the heading is not passable; written.
        turnable: (ny, nx) bits of the headings at which the rover may turn.
        moves: Moves.
        front: (n,) nodes.
        onward: (3 n,) nodes that are nearer than before, written.
    """
    rows, columns, headings = distance.shape
    found = 0
    for node in front:
        cell, heading = node // headings, node % headings
        i, j = cell // columns, cell % columns
        far = distance[i, j, heading]
        count = moves.counts[heading]
        row, column = i, j
        is_free = True
        for k in range(count):
            row, column = i + moves.steps[heading, k, 0], j + moves.steps[heading, k, 1]
            is_free = 0 <= row < rows and 0 <= column < columns
            is_free = is_free and distance[row, column, heading] >= 0.0
            if not is_free:
                break
        if is_free:
            there = np.float32(far + moves.lengths[heading])
            if there < distance[row, column, heading]:
                distance[row, column, heading] = there
                onward[found] = (row * columns + column) * headings + heading
                found += 1
        if turnable[i, j] >> np.uint64(heading) & np.uint64(1):
            for side in range(-1, 2, 2):
                other = (heading + side) % headings
                may_turn = turnable[i, j] >> np.uint64(other) & np.uint64(1)
                if may_turn and far < distance[i, j, other]:
                    distance[i, j, other] = far
                    onward[found] = cell * headings + other
                    found += 1
    return found


def _map_file(path: Path, dtype: DTypeLike, shape: tuple[int, ...]) -> NDArray[Any]:
    """Return an array of zeros that is in a file.

    Raises:
        OSError: There is no room for it.
    """
    with path.open("wb") as file:
        # Room that is lacking later would end the process.
        os.posix_fallocate(file.fileno(), 0, math.prod(shape) * np.dtype(dtype).itemsize)
    return np.asarray(np.memmap(path, dtype, "r+", shape=shape))


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
