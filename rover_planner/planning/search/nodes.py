# SPDX-License-Identifier: Apache-2.0
"""The nodes of the lattice: places on a square grid, each with sixteen headings.

Nodes lie at whole multiples of the cell in the map frame, wherever the map begins, so that what
is known of them stays valid when the map rolls with the rover. Each heading points from a node to
another one at most two cells away, so that straight lines hit nodes (the set of Nav2's Smac
planner).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_planner.angles import wrap

HEADINGS = 16
"""Number of headings; the first points along x, the others follow to the left."""
_QUARTER = ((1, 0), (2, 1), (1, 1), (1, 2))
STEPS: tuple[tuple[int, int], ...] = (
    *_QUARTER,
    *((-y, x) for x, y in _QUARTER),
    *((-x, -y) for x, y in _QUARTER),
    *((y, -x) for x, y in _QUARTER),
)
"""Step (x, y) [cells] from a node to the next one straight ahead, for each heading."""
YAWS = np.arctan2(*np.array(STEPS, float).T[::-1])
"""(16,) yaw of each heading [rad, in -pi to pi]."""


def opposite(heading: int) -> int:
    """Return the heading that points the other way."""
    return (heading + HEADINGS // 2) % HEADINGS


def nearest_heading(yaw: float) -> int:
    """Return the heading nearest to a yaw [rad]."""
    return int(np.argmin(np.abs(wrap(YAWS - yaw))))


@dataclass(frozen=True)
class Nodes:
    """The nodes within a window of the map."""

    cell: float
    """Distance of neighbouring nodes [m]."""
    first: tuple[int, int]
    """Column and row of the first place, in cells from the origin of the map frame."""
    shape: tuple[int, int]
    """Number of rows (along y) and columns (along x) of places."""

    @property
    def count(self) -> int:
        """Number of nodes; a node's index is (row * columns + column) * HEADINGS + heading."""
        return self.shape[0] * self.shape[1] * HEADINGS

    def poses(self, nodes: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the poses (n, 3) of nodes (n,): x, y [m] and yaw [rad], map frame."""
        place, heading = np.divmod(np.asarray(nodes), HEADINGS)
        row, column = np.divmod(place, self.shape[1])
        return np.column_stack(
            [
                self.cell * (column + self.first[0]),
                self.cell * (row + self.first[1]),
                YAWS[heading],
            ]
        )

    def places_near(self, position: NDArray[np.float64], radius: float) -> NDArray[np.int64]:
        """Return the places (n, 2), column and row in the window, within a radius [m]."""
        centre = np.asarray(position[:2]) / self.cell - self.first
        cells = radius / self.cell
        low = np.maximum(np.ceil(centre - cells), 0).astype(int)
        high = np.minimum(np.floor(centre + cells), np.array(self.shape[::-1]) - 1).astype(int)
        columns, rows = (np.arange(a, b + 1) for a, b in zip(low, high, strict=True))
        found = np.stack(np.meshgrid(columns, rows, indexing="ij"), axis=-1).reshape(-1, 2)
        return found[np.hypot(*(found - centre).T) <= cells]

    def surround(self, nodes: NDArray[np.int64]) -> tuple[NDArray[np.float64], float]:
        """Return row and column (2,) amid nodes (n,), and their largest distance from it [m]."""
        places = np.stack(np.divmod(np.asarray(nodes) // HEADINGS, self.shape[1]), axis=-1)
        if not len(places):
            return np.zeros(2), 0.0
        middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
        return middle, self.cell * float(np.hypot(*(places - middle).T).max())

    def around(self, nodes: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the nodes of the window at and beside nodes (n,), with similar headings."""
        place, heading = np.divmod(np.asarray(nodes), HEADINGS)
        row, column = np.divmod(place, self.shape[1])
        beside = np.stack(np.meshgrid(*[(-1, 0, 1)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        rows, columns = row[:, None] + beside[:, 0], column[:, None] + beside[:, 1]
        headings = (heading[:, None] + beside[:, 2]) % HEADINGS
        inside = (rows >= 0) & (rows < self.shape[0]) & (columns >= 0) & (columns < self.shape[1])
        places = np.stack([columns[inside], rows[inside]], axis=-1)
        return np.unique(self.index(places, headings[inside]))

    def index(self, places: NDArray[np.int64], headings: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the indices of nodes at places (n, 2) of the window with headings (n,)."""
        return (places[:, 1] * self.shape[1] + places[:, 0]) * HEADINGS + headings


def nodes_within(cell: float, low: tuple[float, float], high: tuple[float, float]) -> Nodes:
    """Return the nodes in a rectangle from `low` to `high`, x and y [m]."""
    first = tuple(int(np.ceil(value / cell - 1e-9)) for value in low)
    last = tuple(int(np.floor(value / cell + 1e-9)) for value in high)
    shape = (max(0, last[1] - first[1] + 1), max(0, last[0] - first[0] + 1))
    return Nodes(cell, (first[0], first[1]), shape)
