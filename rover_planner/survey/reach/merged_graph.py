"""The components of all tiles as one graph: which of them are reached, and which lead back."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rover_planner.survey.layout import Index
from rover_planner.survey.reach.grid import HeadingGrid
from rover_planner.survey.reach.tile_graph import (
    Edges,
    Ints,
    TileGraph,
    build_tile_graph,
    reverse,
    spread,
)


class TileReach(NamedTuple):
    """What of a tile can be reached, and returned from."""

    reached: NDArray[np.bool_]
    """(rows, columns) whether the cell can be reached at any heading."""
    inside: NDArray[np.bool_]
    """(rows, columns, headings) whether the node can be reached and returned from."""


class MergedGraph:
    """The borders of all tiles, merged.

    Whatever a tile has between its borders is only in its own graph, so that memory holds one tile
    and the components at the borders.
    """

    def __init__(self, grid: HeadingGrid, start: Index):
        """Build the graph of each tile, and keep what other tiles make use of."""
        self._grid, self._start = grid, start
        self._vertices: dict[Index, tuple[int, Ints]] = {}
        """Number of the first vertex of each tile, and the components that are vertices."""
        self._count, self._origin = 0, -1
        self._order: list[Edges] = []
        self._entries: list[Edges] = []
        self._exits: list[Edges] = []
        self._last: tuple[Index, TileGraph] | None = None
        for tile in grid.tiles:
            self._add(tile, self._build(tile))
        self._forward, self._back = self._search()

    def reach_of(self, tile: Index) -> TileReach | None:
        """Return what of a tile can be reached; None if nothing can."""
        first, components = self._vertices[tile]
        mine = slice(first, first + len(components))
        if not self._forward[mine].any():
            return None
        graph = self._build(tile)
        forward, back = np.zeros(graph.size, bool), np.zeros(graph.size, bool)
        forward[components], back[components] = self._forward[mine], self._back[mine]
        forward = spread(graph.size, graph.order, forward)
        back = spread(graph.size, reverse(graph.order), back)
        reached, inside = np.zeros_like(graph.open_at), np.zeros_like(graph.open_at)
        reached[graph.open_at] = forward[graph.labels]
        inside[graph.open_at] = (forward & back)[graph.labels]
        return TileReach(np.asarray(reached.any(axis=2)), inside)

    def _build(self, tile: Index) -> TileGraph:
        """Return the graph of a tile; the last one is kept."""
        if self._last is None or self._last[0] != tile:
            graph = build_tile_graph(self._grid, self._grid.box_of(tile), self._start)
            self._last = tile, graph
        return self._last[1]

    def _add(self, tile: Index, graph: TileGraph) -> None:
        """Take what a tile has at its borders."""
        is_vertex = graph.borders()
        components = np.flatnonzero(is_vertex)
        number = np.full(graph.size, -1)
        number[components] = self._count + np.arange(len(components))
        self._vertices[tile] = self._count, components
        tails, heads = number[graph.order.tails], number[graph.order.heads]
        both = (tails >= 0) & (heads >= 0)
        self._order.append(Edges(tails[both], heads[both]))
        self._entries.append(Edges(graph.entries.tails, number[graph.entries.heads]))
        self._exits.append(Edges(number[graph.exits.tails], graph.exits.heads))
        if graph.start >= 0:
            self._origin = int(number[graph.start])
        self._count += len(components)

    def _search(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return which vertices can be reached, and from which the start can be."""
        order, entries, exits = map(_join, (self._order, self._entries, self._exits))
        self._order, self._entries, self._exits = [], [], []
        seeds = np.zeros(self._count, bool)
        if self._origin < 0:
            return seeds, seeds
        seeds[self._origin] = True
        rank = np.argsort(entries.tails)
        at = rank[np.searchsorted(entries.tails, exits.heads, sorter=rank)]
        edges = _join([order, Edges(exits.tails, entries.heads[at])])
        return spread(self._count, edges, seeds), spread(self._count, reverse(edges), seeds)


def _join(parts: list[Edges]) -> Edges:
    return Edges(*(np.concatenate(ends) for ends in zip(*parts, strict=True)))
