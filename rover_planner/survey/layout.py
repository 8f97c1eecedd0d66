# SPDX-License-Identifier: Apache-2.0
"""The cells, tiles and chunks into which a survey cuts a map.

The rover is judged at every `step`-th cell of the map. Cells are judged tile by tile, each tile in
a frame of its own, so that what is found does not depend on the chunks. A chunk is a square of
whole tiles, the work of one task.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from rover_physics.rover.extent import find_reach
from rover_physics.rover.model import Rover
from rover_physics.terrain.ground import BLOCK

TILE = 64
"""Side of a tile [map cells], a multiple of BLOCK; larger if the step is."""
CHUNK_POSES = 300_000
"""Number of poses in a chunk that the default aims at: some seconds of work."""
MAX_CHUNKS = 10_000
"""Number of chunks above which the default chunk grows."""

Index = tuple[int, int]
"""Row and column."""
Box = tuple[slice, slice]
"""Rows and columns."""


@dataclass(frozen=True)
class SurveyLayout:
    """The cells, tiles and chunks of a survey; row 0 is at the smallest y."""

    map_shape: Index
    """Rows and columns of the map."""
    step: int
    """Distance of surveyed cells [map cells]."""
    chunk: int
    """Side of a chunk [surveyed cells]."""
    halo: int
    """Map cells around a tile that the rover on it may touch."""

    @property
    def tile(self) -> int:
        """Side of a tile [surveyed cells]."""
        return max(1, TILE // self.step)

    @property
    def shape(self) -> Index:
        """Rows and columns of surveyed cells."""
        ny, nx = self.map_shape
        return -(-ny // self.step), -(-nx // self.step)

    @property
    def chunks(self) -> Index:
        """Rows and columns of chunks."""
        ny, nx = self.shape
        return -(-ny // self.chunk), -(-nx // self.chunk)

    def cells_of(self, chunk: Index) -> Box:
        """Return the surveyed cells of a chunk."""
        return _cut(chunk, self.chunk, self.shape)

    def tiles_of(self, chunk: Index) -> Iterator[Box]:
        """Yield the surveyed cells of each tile of a chunk."""
        rows, columns = self.cells_of(chunk)
        for i in range(rows.start // self.tile, -(-rows.stop // self.tile)):
            for j in range(columns.start // self.tile, -(-columns.stop // self.tile)):
                yield _cut((i, j), self.tile, self.shape)

    def window_of(self, cells: Box) -> Box:
        """Return the map cells that the rover may touch on surveyed cells."""
        windows = []
        for span, most in zip(cells, self.map_shape, strict=True):
            first = span.start * self.step - self.halo
            end = (span.stop - 1) * self.step + 1 + self.halo
            windows.append(slice(max(first, 0), min(end, most)))
        return windows[0], windows[1]


def find_halo(rover: Rover, resolution: float) -> int:
    """Return the number of map cells around the body origin that the rover may touch.

    The distance is the reach of wheels and belly, and a wheel radius more. It is rounded up to
    whole blocks of cells, so that blocks are those of the whole map.
    """
    cells = math.ceil((find_reach(rover) + rover.wheel.radius) / resolution) + 2
    return -(-cells // BLOCK) * BLOCK


def choose_chunk(map_shape: Index, step: int, headings: int, least: int | None = None) -> int:
    """Return the side of a chunk [surveyed cells]: whole tiles, from `least` on or the default."""
    layout = SurveyLayout(map_shape, step, 1, 0)
    if least is not None:
        return math.ceil(least / layout.tile) * layout.tile
    side = math.sqrt(max(CHUNK_POSES / headings, math.prod(layout.shape) / MAX_CHUNKS))
    return max(1, round(side / layout.tile)) * layout.tile


def _cut(at: Index, side: int, shape: Index) -> Box:
    first, second = (
        slice(k * side, min((k + 1) * side, size)) for k, size in zip(at, shape, strict=True)
    )
    return first, second
