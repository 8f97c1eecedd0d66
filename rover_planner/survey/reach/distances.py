"""The lengths of the shortest ways, tile by tile: a tile is searched until nothing gets nearer."""

import heapq
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rover_planner.survey.layers import pack_bits
from rover_planner.survey.layout import Box, Index
from rover_planner.survey.reach.grid import HeadingGrid, within
from rover_planner.survey.reach.kernels import advance_front

CLOSED = -1.0
"""Distance of nodes that are not asked for."""


class TileDistances:
    """Distances from a start, in files of one tile each.

    A tile is searched with a rim that its moves reach. What gets nearer in the rim is passed on to
    the tile there, which is searched again. The tile with the nearest news is the next. Lengths
    are sums from the start on, rounded after each move, and the least of all ways; so they do not
    depend on the tiles.
    """

    def __init__(self, grid: HeadingGrid, folder: Path):
        """Keep distances in an empty folder; no node is asked for yet."""
        self._grid, self._folder = grid, folder
        self._asked: set[Index] = set()
        self._news: dict[Index, list[tuple[NDArray[np.int64], NDArray[np.float32]]]] = {}
        self._queue: list[tuple[float, Index]] = []

    def ask(self, tile: Index, inside: NDArray[np.bool_]) -> None:
        """Ask for the distances of nodes of a tile, given as flags (rows, columns, headings).

        The shortest ways to all nodes that are asked for must lead over such nodes only.
        """
        self._asked.add(tile)
        np.save(self._file_of(tile, "asked"), pack_bits(inside))

    def search(self, start: Index) -> None:
        """Find the distances of all nodes that are asked for from those of a cell."""
        grid = self._grid
        cell = start[0] * grid.shape[1] + start[1]
        nodes = cell * grid.headings + np.arange(grid.headings)
        self._pass_on(nodes, np.zeros(grid.headings, np.float32))
        while self._queue:
            _, tile = heapq.heappop(self._queue)
            news = self._news.pop(tile, None)
            if news is not None:
                nodes, distances = (np.concatenate(parts) for parts in zip(*news, strict=True))
                self._advance(tile, nodes, distances)

    def nearest(self) -> Iterator[tuple[Box, NDArray[np.float32]]]:
        """Yield the cells of each tile with such nodes, and their distance at any heading [m]."""
        for tile in sorted(self._asked):
            distance = self._read(tile)
            distance[distance < 0.0] = np.inf
            yield self._grid.box_of(tile), distance.min(axis=2)

    def _advance(
        self, tile: Index, nodes: NDArray[np.int64], distances: NDArray[np.float32]
    ) -> None:
        """Search a tile from nodes of the map that may be nearer than before."""
        grid = self._grid
        box = grid.box_of(tile)
        window = grid.window_of(box)
        mine = within(box, window)
        around = self._open_window(window)
        around[mine] = self._read(tile)
        place = self._place_in(window, around.shape, nodes)
        distance = around.reshape(-1)
        is_nearer = distances < distance[place]
        np.minimum.at(distance, place[is_nearer], distances[is_nearer])
        front = np.unique(place[is_nearer])
        if not len(front):
            return
        masks = grid.read(window)
        while len(front):
            onward = np.empty(3 * len(front), np.int64)
            front = onward[: advance_front(masks, grid.moves, front, distance, onward)]
        np.save(self._file_of(tile), around[mine])
        around[mine] = np.inf
        found = np.flatnonzero(np.isfinite(distance) & (distance >= 0.0))
        self._pass_on(self._number_of(window, around.shape, found), distance[found])

    def _pass_on(self, nodes: NDArray[np.int64], distances: NDArray[np.float32]) -> None:
        """Tell the tiles of nodes of the map that these may be nearer than before."""
        grid = self._grid
        rows, columns = np.divmod(nodes // grid.headings, grid.shape[1])
        tiles = np.column_stack([rows, columns]) // grid.tile
        for i, j in np.unique(tiles, axis=0).tolist():
            here = (tiles == (i, j)).all(axis=1)
            self._news.setdefault((i, j), []).append((nodes[here], distances[here]))
            heapq.heappush(self._queue, (float(distances[here].min()), (i, j)))

    def _open_window(self, window: Box) -> NDArray[np.float32]:
        """Return the distances of a window of which nothing is known."""
        grid, (rows, columns) = self._grid, window
        bits = np.zeros((rows.stop - rows.start, columns.stop - columns.start), np.uint64)
        for i in range(rows.start // grid.tile, -(-rows.stop // grid.tile)):
            for j in range(columns.start // grid.tile, -(-columns.stop // grid.tile)):
                if (i, j) not in self._asked:
                    continue
                known = np.load(self._file_of((i, j), "asked"), mmap_mode="r")
                box = grid.box_of((i, j))
                common = tuple(
                    slice(max(one.start, other.start), min(one.stop, other.stop))
                    for one, other in zip(box, window, strict=True)
                )
                both = common[0], common[1]
                bits[within(both, window)] = known[within(both, box)]
        return np.where(grid.unpack(bits), np.float32(np.inf), np.float32(CLOSED))

    def _read(self, tile: Index) -> NDArray[np.float32]:
        file = self._file_of(tile)
        if file.exists():
            return np.asarray(np.load(file))
        return self._open_window(self._grid.box_of(tile))

    def _file_of(self, tile: Index, what: str = "distance") -> Path:
        return self._folder / f"{what}_{tile[0]}_{tile[1]}.npy"

    def _place_in(
        self, window: Box, shape: tuple[int, ...], nodes: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Return the numbers in a window of nodes of the map."""
        cells, headings = np.divmod(nodes, self._grid.headings)
        rows, columns = np.divmod(cells, self._grid.shape[1])
        at = (rows - window[0].start) * shape[1] + columns - window[1].start
        return np.asarray(at * shape[2] + headings)

    def _number_of(
        self, window: Box, shape: tuple[int, ...], places: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Return the numbers in the map of nodes of a window."""
        cells, headings = np.divmod(places, shape[2])
        rows, columns = np.divmod(cells, shape[1])
        at = (rows + window[0].start) * self._grid.shape[1] + columns + window[1].start
        return np.asarray(at * self._grid.headings + headings)
