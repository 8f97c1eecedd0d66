# SPDX-License-Identifier: Apache-2.0
"""Moves of a rover between surveyed cells: one for each heading, and the search by them."""

import math
from typing import NamedTuple

import numpy as np

from rover_physics.numerics.kernels import exact_kernel

ALIGNED = 0.25
"""Largest angle between a move and its heading, as a share of the angle between headings."""
MAX_CELLS = 64
"""Largest length of a move [cells]."""


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
