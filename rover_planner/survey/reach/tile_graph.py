"""The graph of one tile: its strong components, how they follow each other, and its borders."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, connected_components

from rover_planner.survey.layout import Box, Index
from rover_planner.survey.reach.grid import HeadingGrid, within

Ints = NDArray[np.int64]


class Edges(NamedTuple):
    """Edges of a directed graph."""

    tails: Ints
    """(n,) where they begin."""
    heads: Ints
    """(n,) where they end."""


class TileGraph(NamedTuple):
    """The nodes of a tile by strong components: each can be reached from each within the tile."""

    open_at: NDArray[np.bool_]
    """(rows, columns, headings) whether there is a node."""
    labels: Ints
    """(n,) component of each node, in the order of `open_at`."""
    size: int
    """Number of components."""
    order: Edges
    """Edges from component to component."""
    entries: Edges
    """Nodes of the map at which moves enter the tile, and their components."""
    exits: Edges
    """Components from which moves leave the tile, and the nodes of the map that they lead to."""
    start: int
    """Component of the start, -1 if the start is elsewhere."""

    def borders(self) -> NDArray[np.bool_]:
        """Return (size,) which components other tiles or the start make use of.

        They have an entry, an exit or the start, or are on the way from one to another.
        """
        ends = [self.start] if self.start >= 0 else []
        sources, sinks = np.zeros(self.size, bool), np.zeros(self.size, bool)
        sources[self.entries.heads], sinks[self.exits.tails] = True, True
        sources[ends], sinks[ends] = True, True
        between = spread(self.size, self.order, sources) & spread(
            self.size, reverse(self.order), sinks
        )
        return sources | sinks | between


def build_tile_graph(grid: HeadingGrid, box: Box, start: Index) -> TileGraph:
    """Return the graph of a tile.

    Nodes of the map have the number `cell * headings + heading`, cells row by row.

    Args:
        grid: Passable headings.
        box: Cells of the tile.
        start: Row and column of the start; all its nodes count as one.
    """
    window = grid.window_of(box)
    passable, turnable = map(grid.unpack, grid.read(window))
    tile = within(box, window)
    open_at = passable[tile]
    index = np.full(passable.shape, -1)
    index[tile][open_at] = np.arange(np.count_nonzero(open_at))
    inside, entering, leaving = _find_moves(grid, window, passable, index)
    edges = [inside, *_find_turns(turnable[tile], index[tile])]
    nodes = np.empty(0, np.int64)
    if all(span.start <= at < span.stop for at, span in zip(start, box, strict=True)):
        nodes = index[start[0] - window[0].start, start[1] - window[1].start]
        nodes = nodes[nodes >= 0]
        edges.append(Edges(nodes, np.roll(nodes, 1)))
    every = Edges(*(np.concatenate(ends) for ends in zip(*edges, strict=True)))
    size = int(np.count_nonzero(open_at))
    count, labels = connected_components(_as_matrix(size, every), connection="strong")
    order = _drop_repeated(Edges(labels[every.tails], labels[every.heads]), loops=False)
    return TileGraph(
        open_at,
        labels,
        count,
        order,
        _drop_repeated(Edges(entering.heads, labels[entering.tails])),
        _drop_repeated(Edges(labels[leaving.tails], leaving.heads)),
        int(labels[nodes[0]]) if len(nodes) else -1,
    )


def spread(count: int, edges: Edges, seeds: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which of `count` nodes can be reached from seeds (count,)."""
    if not len(edges.tails):
        return seeds
    first = np.flatnonzero(seeds)
    origin = np.full(len(first), count)  # one more node, from which all seeds are reached
    joined = Edges(
        np.concatenate([edges.tails, origin]),
        np.concatenate([edges.heads, first]),
    )
    found = np.zeros(count + 1, bool)
    graph = _as_matrix(count + 1, joined)
    found[breadth_first_order(graph, count, return_predecessors=False)] = True
    return found[:count]


def reverse(edges: Edges) -> Edges:
    """Return edges the other way round."""
    return Edges(edges.heads, edges.tails)


def _find_moves(
    grid: HeadingGrid, window: Box, passable: NDArray[np.bool_], index: Ints
) -> tuple[Edges, Edges, Edges]:
    """Return the moves inside a tile, those that enter it and those that leave it.

    Args:
        grid: Passable headings.
        window: Cells that are looked at.
        passable: (rows, columns, headings) flags of the window.
        index: (rows, columns, headings) number of each node of the tile, -1 for others.

    Returns:
        Edges between nodes of the tile. Nodes of the tile that are entered, with their numbers in
        the map. Nodes of the tile that are left, and the nodes of the map where that leads.
    """
    rows, columns, headings = passable.shape
    inside, entering, leaving = [], [], []
    for k in range(headings):
        steps = grid.moves.steps[k, : grid.moves.counts[k]]
        (down, up), (left, right) = (
            (max(0, -int(steps[-1, axis])), max(0, int(steps[-1, axis]))) for axis in (0, 1)
        )
        i, j = slice(down, max(rows - up, down)), slice(left, max(columns - right, left))
        goes = passable[i, j, k].copy()
        for row, column in steps:
            goes &= passable[_shift(i, row), _shift(j, column), k]
        at = tuple(np.argwhere(goes).T)
        tails = index[i, j, k][at]
        heads = index[_shift(i, steps[-1, 0]), _shift(j, steps[-1, 1]), k][at]
        there = (
            (at[0] + down + steps[-1, 0] + window[0].start) * grid.shape[1]
            + (at[1] + left + steps[-1, 1] + window[1].start)
        ) * headings + k
        is_from, is_to = tails >= 0, heads >= 0
        inside.append((tails[is_from & is_to], heads[is_from & is_to]))
        entering.append((heads[~is_from & is_to], there[~is_from & is_to]))
        leaving.append((tails[is_from & ~is_to], there[is_from & ~is_to]))
    first, second, third = (
        Edges(*map(np.concatenate, zip(*parts, strict=True)))
        for parts in (inside, entering, leaving)
    )
    return first, second, third


def _find_turns(turnable: NDArray[np.bool_], index: Ints) -> list[Edges]:
    """Return the turns to both neighbouring headings."""
    other, number = np.roll(turnable, -1, axis=2), np.roll(index, -1, axis=2)
    turns = turnable & other & (index != number)
    there = Edges(index[turns], number[turns])
    return [there, reverse(there)]


def _shift(span: slice, by: int) -> slice:
    return slice(span.start + int(by), span.stop + int(by))


def _as_matrix(count: int, edges: Edges) -> coo_array:
    ones = np.ones(len(edges.tails), np.int8)
    return coo_array((ones, (edges.tails, edges.heads)), shape=(count, count)).tocsr()


def _drop_repeated(edges: Edges, *, loops: bool = True) -> Edges:
    """Return each edge once, with or without those from a node to itself."""
    if not loops:
        keep = edges.tails != edges.heads
        edges = Edges(edges.tails[keep], edges.heads[keep])
    if not len(edges.tails):
        return edges
    rank = np.lexsort(edges[::-1])
    tails, heads = edges.tails[rank], edges.heads[rank]
    first = np.ones(len(rank), bool)
    first[1:] = (np.diff(tails) != 0) | (np.diff(heads) != 0)
    return Edges(tails[first], heads[first])
