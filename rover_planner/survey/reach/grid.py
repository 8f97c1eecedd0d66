"""The headings that are passable at each cell, read by windows, and the tiles of a map."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_planner.survey.layers import unpack_bits
from rover_planner.survey.layout import Box, Index
from rover_planner.survey.reach.moves import Moves

TILE_NODES = 1_000_000
"""Cells times headings of a tile that the default aims at: some 200 MB of memory."""


@dataclass(frozen=True, eq=False)
class HeadingGrid:
    """Where and how a rover may drive; a node is a cell at a heading that is passable there."""

    passable: Any
    """(ny, nx) bits of the passable headings, an array or one of Zarr."""
    turnable: Any
    """The same for headings at which the rover may turn."""
    moves: Moves
    """The move of each heading."""
    tile: int
    """Side of a tile [cells]."""

    @property
    def shape(self) -> Index:
        """Rows and columns."""
        ny, nx = self.passable.shape
        return int(ny), int(nx)

    @property
    def headings(self) -> int:
        """Number of headings."""
        return len(self.moves.counts)

    @property
    def reach(self) -> int:
        """Largest number of rows or columns of a move."""
        return int(self.moves.counts.max())

    @property
    def tiles(self) -> Iterator[Index]:
        """Row and column of each tile."""
        rows, columns = (-(-size // self.tile) for size in self.shape)
        return ((i, j) for i in range(rows) for j in range(columns))

    def box_of(self, tile: Index) -> Box:
        """Return the cells of a tile."""
        spans = [
            slice(at * self.tile, min((at + 1) * self.tile, size))
            for at, size in zip(tile, self.shape, strict=True)
        ]
        return spans[0], spans[1]

    def window_of(self, box: Box) -> Box:
        """Return a box and the cells around it that a move touches."""
        spans = [
            slice(max(span.start - self.reach, 0), min(span.stop + self.reach, size))
            for span, size in zip(box, self.shape, strict=True)
        ]
        return spans[0], spans[1]

    def read(self, window: Box) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
        """Return the bits of passable headings in a window, and those of turnable ones."""
        passable, turnable = (
            np.ascontiguousarray(np.asarray(bits[window], np.uint64))
            for bits in (self.passable, self.turnable)
        )
        return passable, turnable & passable

    def unpack(self, bits: NDArray[np.uint64]) -> NDArray[np.bool_]:
        """Return the flags (ny, nx, headings) of bits (ny, nx)."""
        return unpack_bits(bits, self.headings)


def choose_tile(headings: int, chunk: int) -> int:
    """Return the default side of a tile [cells]: whole chunks of the store."""
    side = math.sqrt(TILE_NODES / headings)
    return max(1, round(side / chunk)) * chunk


def within(box: Box, window: Box) -> Box:
    """Return a box, whose indices count from the start of a window."""
    rows, columns = (
        slice(span.start - base.start, span.stop - base.start)
        for span, base in zip(box, window, strict=True)
    )
    return rows, columns
