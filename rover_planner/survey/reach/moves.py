# SPDX-License-Identifier: Apache-2.0
"""Moves of a rover between surveyed cells: straight ahead along a heading to a cell ahead."""

import math
from typing import NamedTuple

import numpy as np

ALIGNED = 0.25
"""Largest angle between a move and its heading, as a share of the angle between headings."""
MAX_CELLS = 64
"""Largest length of a move [cells]."""


class Moves(NamedTuple):
    """The move of each heading, as kernels read it."""

    steps: np.ndarray
    """(headings, MAX_CELLS, 2) rows and columns from the start to each cell on the way; the last
    is the goal."""
    counts: np.ndarray
    """(headings,) number of these cells."""
    lengths: np.ndarray
    """(headings,) length [m]."""

    def reversed(self) -> "Moves":
        """Return the moves from their goals back to their starts, of length 0."""
        steps = np.zeros_like(self.steps)
        for k, count in enumerate(self.counts):
            way = np.vstack([self.steps[k, : count - 1][::-1], np.zeros((1, 2), np.int64)])
            steps[k, :count] = way - self.steps[k, count - 1]
        return Moves(steps, self.counts, np.zeros_like(self.lengths))


def find_moves(headings: int, cell: float) -> Moves:
    """Return the shortest move of each heading that is aligned with it.

    The cells on the way are those nearest to the line at equal distances, one a row or column.

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
