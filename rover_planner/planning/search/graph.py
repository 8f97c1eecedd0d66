# SPDX-License-Identifier: Apache-2.0
"""Shortest paths over the edges of a lattice, compiled.

An edge that is judged costs what the model found, or cannot be driven. One that is not judged
costs what it would on level ground, and `caution` x PRICE x its difficulty more.

A search goes on from the tree of the last one (compare Koenig, Likhachev and Furcy 2004, Lifelong
Planning A*): what hangs on edges that are dearer now is cut off and reached anew from around it.
"""

import heapq
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.kernels import allocating_kernel, exact_kernel
from rover_planner.planning.search.difficulty import LEAST_DIFFICULTY, Difficulty, difficulty_of
from rover_planner.planning.search.edges import FAILS, PASSES, Edges
from rover_planner.planning.search.nodes import HEADINGS

PRICE = 4.0
"""Price of a unit of difficulty with a caution of 1 [cells]."""
SLACK = 1.1
"""Costs to the goal are measured up to this multiple of the cost from start to goal."""
GUESSED, EAGERNESS = 0.25, 1.5
"""Share of the nodes that searches may expand before costs to the goal that are guessed are
measured, which takes about as long, and guessed costs over those on level ground: the larger, the
sooner is a path found."""
GIVEN_UP = -2
"""Result of a search that would expand too many nodes."""
NO_LIMIT = np.iinfo(np.int64).max
"""Number of nodes that no search expands."""


class Graph(NamedTuple):
    """A lattice with what is known of it."""

    least_cost: np.ndarray
    """(HEADINGS, P) costs of the primitives on level ground [m]."""
    links: np.ndarray
    """(2, HEADINGS, L, 4) the primitives, see `Edges`."""
    state: np.ndarray
    """(nodes, P) states of the edges, see `Edges`."""
    cost: np.ndarray
    """(nodes, P) costs [m] of the edges that pass."""
    standing: np.ndarray
    """(nodes,) states of the nodes, see `Edges`."""
    difficulty: Difficulty
    """Estimates how likely edges are refused."""
    caution: float
    """Weight of difficulty; with 0 no edge is estimated above its true cost."""
    rows: int
    """Number of rows of places."""
    columns: int
    """Number of columns of places."""


class Seeds(NamedTuple):
    """Nodes where a search begins."""

    nodes: np.ndarray
    """(k,) nodes."""
    costs: np.ndarray
    """(k,) costs [m] at which they are entered."""


class ToGoal(NamedTuple):
    """Costs from the nodes to the goal, as far as they are known."""

    cost: np.ndarray
    """(nodes,) cost to the goal [m], too high or infinite where it is not known."""
    focus: np.ndarray
    """(2,) row and column of the place that was measured towards, the start."""
    radius: float
    """Distance of the start's connections from there [m]."""
    limit: float
    """All costs are known for which the sum with the bound from the start is at most this [m]."""


class SearchTree(NamedTuple):
    """Nodes that a search has reached, with their costs. Searches write it."""

    cost: np.ndarray
    """(nodes,) cost from the seeds of the search [m], infinite where nothing leads."""
    parent: np.ndarray
    """(nodes,) edge that leads to a node; -1 - i for seed i. Written where a cost is finite."""
    is_open: np.ndarray
    """(nodes,) True where a node is reached, but not expanded at that cost."""


def empty_tree(count: int) -> SearchTree:
    """Return a tree over so many nodes that has reached none."""
    return SearchTree(np.full(count, np.inf), np.empty(count, int), np.zeros(count, bool))


@exact_kernel
def edge_cost(graph, node, k, end):
    """Return the cost [m] of edge k of a node, which ends at node `end`; infinite if it fails.

    Nodes where the rover cannot stand are never entered.
    """
    state = graph.state[node, k]
    if state >= FAILS or graph.standing[end] >= FAILS:
        return np.inf
    if state == PASSES:
        return float(graph.cost[node, k])
    least = graph.least_cost[node % HEADINGS, k]
    if graph.caution == 0.0:
        return least
    price = PRICE * graph.difficulty.cell
    difficulty = difficulty_of(graph.difficulty, graph.columns, node, k)
    return least + graph.caution * price * difficulty


@exact_kernel
def _is_too_dear(graph, node, k, here, known):
    """Return whether edge k of a node, entered at cost `here`, leads nowhere below cost `known`.

    It may say no where it does not know: it takes the ground as level.
    """
    least = graph.least_cost[node % HEADINGS, k]
    least += graph.caution * PRICE * graph.difficulty.cell * LEAST_DIFFICULTY
    return here + least >= known and graph.state[node, k] != PASSES


@exact_kernel
def _neighbour(graph, node, i, backwards):
    """Return the other node of an edge, the node where the edge begins, and its number there.

    The other node is -1 if it is outside the window; all are -1 if there is no such edge.

    Args:
        graph: Graph.
        node: A node.
        i: Number of the edge among those that begin, or end, at the node.
        backwards: Whether those that end there are meant.
    """
    none = np.int64(-1)
    heading, place = node % HEADINGS, node // HEADINGS
    link = graph.links[1 if backwards else 0, heading, i]
    if link[0] < 0:
        return none, none, none
    row, column = place // graph.columns + link[3], place % graph.columns + link[2]
    other = none
    if 0 <= row < graph.rows and 0 <= column < graph.columns:
        other = np.int64((row * graph.columns + column) * HEADINGS + link[0])
    return other, other if backwards else np.int64(node), link[1]


@exact_kernel
def _bound(graph, node, backwards, to_goal):
    """Return a bound from below on the cost from a node to the goal, or back to the start [m]."""
    place = node // HEADINGS
    rows = place // graph.columns - to_goal.focus[0]
    along = place % graph.columns - to_goal.focus[1]
    from_start = max(graph.difficulty.cell * np.hypot(rows, along) - to_goal.radius, 0.0)
    if backwards:
        return from_start
    if to_goal.cost[node] + from_start <= to_goal.limit:
        return to_goal.cost[node]
    return max(to_goal.limit - from_start, 0.0)


@allocating_kernel
def find_shortest(graph, seeds, exits, backwards, to_goal, tree, slack, most):
    """Find the shortest path from seeds to exits (A*); go on from what a tree has reached.

    Args:
        graph: Graph.
        seeds: Seeds with the costs from the start to the nodes; backwards, from them to the goal.
        exits: The same of the other end.
        backwards: Whether the search is from the goal to the start.
        to_goal: ToGoal.
        tree: SearchTree, empty or mended; written.
        slack: Up to which multiple of the cost of the shortest path it goes on.
        most: Number of nodes that it may expand.

    Returns:
        Index of the exit that the path ends with, -1 if there is no path, GIVEN_UP if it is not
        known; its cost [m]; the cost [m] up to which paths are known, infinite for all; and the
        number of nodes expanded.
    """
    leave = np.full(tree.cost.size, np.int64(-1))
    best, found, expanded = np.inf, np.int64(-1), 0
    for i in range(exits.nodes.size):
        node = exits.nodes[i]
        if leave[node] < 0 or exits.costs[i] < exits.costs[leave[node]]:
            leave[node] = i
        if tree.cost[node] + exits.costs[i] < best:
            best, found = tree.cost[node] + exits.costs[i], np.int64(i)
    heap = [(0.0, 0.0, np.int64(-1))]
    heap.clear()
    for node in np.flatnonzero(tree.is_open):
        cost = tree.cost[node]
        heap.append((cost + _bound(graph, node, backwards, to_goal), -cost, node))
    heapq.heapify(heap)
    for i in range(seeds.nodes.size):
        node, cost = seeds.nodes[i], seeds.costs[i]
        if graph.standing[node] < FAILS and cost < tree.cost[node]:
            _enter(graph, node, cost, -1 - i, backwards, to_goal, tree, heap)
    width = graph.state.shape[1]
    while len(heap) > 0:
        estimate, negative, node = heap[0]
        if estimate >= slack * best:
            return found, best, slack * best, expanded
        if expanded == most:
            return np.int64(GIVEN_UP), np.inf, 0.0, expanded
        heapq.heappop(heap)
        if not tree.is_open[node]:
            continue
        tree.is_open[node] = False
        expanded += 1
        if leave[node] >= 0 and -negative + exits.costs[leave[node]] < best:
            best, found = -negative + exits.costs[leave[node]], leave[node]
        for i in range(graph.links.shape[2]):
            other, first, k = _neighbour(graph, node, i, backwards)
            if k < 0:
                break
            if other < 0 or _is_too_dear(graph, first, k, tree.cost[node], tree.cost[other]):
                continue
            end = np.int64(node) if backwards else other
            cost = tree.cost[node] + edge_cost(graph, first, k, end)
            if cost < tree.cost[other]:
                edge = first * width + k
                _enter(graph, other, cost, edge, backwards, to_goal, tree, heap)
    return found, best, np.inf, expanded


@allocating_kernel
def _enter(graph, node, cost, parent, backwards, to_goal, tree, heap):
    """Enter a node at a cost [m], if there may be a path from there."""
    bound = _bound(graph, node, backwards, to_goal)
    if bound < np.inf:
        tree.cost[node], tree.parent[node], tree.is_open[node] = cost, parent, True
        heapq.heappush(heap, (cost + bound, -cost, node))


@allocating_kernel
def mend(graph, seeds, tree, changed):
    """Mend a tree where costs have changed, for `find_shortest` to go on from there.

    What hangs on a dearer edge is cut off and reached anew from around it.

    Args:
        graph: Graph.
        seeds: Seeds of the search.
        tree: SearchTree from seeds on, not backwards; written.
        changed: (k,) nodes. The edges that end there, and seeds, may cost something else now;
            edges that are not of the tree cost no less.

    Returns:
        Number of nodes that were cut off.
    """
    cut = [np.int64(-1)]
    cut.clear()
    for node in changed:
        before = tree.cost[node]
        if before < np.inf:
            tree.cost[node] = _cost_by_parent(graph, seeds, tree, node)
            tree.is_open[node] |= tree.cost[node] < before
            if tree.cost[node] > before:
                cut.append(node)
    _cut_off(graph, tree, cut)
    for node in cut:
        _reach_from_around(graph, tree, node)
    return len(cut)


@exact_kernel
def _cost_by_parent(graph, seeds, tree, node):
    """Return the cost [m] of a reached node by what its parent costs now."""
    parent = tree.parent[node]
    if parent < 0:
        return seeds.costs[-1 - parent] if graph.standing[node] < FAILS else np.inf
    first, k = divmod(parent, graph.state.shape[1])
    return tree.cost[first] + edge_cost(graph, first, k, node)


@allocating_kernel
def _cut_off(graph, tree, cut):
    """Cut nodes off a tree, with all that hang on them; those are added to the list."""
    for node in cut:
        tree.cost[node] = np.inf
    done = 0
    while done < len(cut):
        node = cut[done]
        done += 1
        tree.is_open[node] = False
        for i in range(graph.links.shape[2]):
            other, first, k = _neighbour(graph, node, i, False)
            if k < 0:
                break
            if other < 0 or tree.cost[other] == np.inf:
                continue
            if tree.parent[other] == first * graph.state.shape[1] + k:
                tree.cost[other] = np.inf
                cut.append(other)


@exact_kernel
def _reach_from_around(graph, tree, node):
    """Reach a node that was cut off by the best edge from an expanded node, if there is one."""
    for i in range(graph.links.shape[2]):
        other, first, k = _neighbour(graph, node, i, True)
        if k < 0:
            break
        if other < 0 or tree.is_open[other]:
            continue
        if _is_too_dear(graph, first, k, tree.cost[other], tree.cost[node]):
            continue
        cost = tree.cost[other] + edge_cost(graph, first, k, node)
        if cost < tree.cost[node]:
            tree.cost[node], tree.parent[node] = cost, first * graph.state.shape[1] + k
    tree.is_open[node] = tree.cost[node] < np.inf


@allocating_kernel
def spread(graph, seeds, backwards, inside, crossing):
    """Mark the nodes that edges connect with seeds, and count what closes them in.

    Args:
        graph: Graph; edges that are not judged count as open.
        seeds: (k,) nodes.
        backwards: Whether edges are followed from their ends to their beginnings.
        inside: (nodes,), written where True.
        crossing: (codes + 1,) numbers of edges that would cross the border, for each code of a
            failure, and last of those that leave the window; added to.
    """
    stack = [np.int64(-1)]
    stack.clear()
    for i in range(seeds.size):
        if graph.standing[seeds[i]] < FAILS and not inside[seeds[i]]:
            inside[seeds[i]] = True
            stack.append(seeds[i])
    most = graph.links.shape[2]
    while len(stack) > 0:
        node = stack.pop()
        for i in range(most):
            other, state = _look_across(graph, node, i, backwards)
            if other >= 0 and state < FAILS and not inside[other]:
                inside[other] = True
                stack.append(other)
    for node in np.flatnonzero(inside):
        for i in range(most):
            other, state = _look_across(graph, node, i, backwards)
            if state >= FAILS and (other < 0 or not inside[other]):
                crossing[min(state - FAILS, crossing.size - 1)] += 1


@exact_kernel
def _look_across(graph, node, i, backwards):
    """Return the node at the other end of an edge, and the edge's state; -1, -1 if there is none.

    The state is that of the edge or, if that does not fail, of the other node. If the edge leaves
    the window, the node is -1 and the state is larger than all. Arguments as for `_neighbour`.
    """
    other, first, k = _neighbour(graph, node, i, backwards)
    if k < 0:
        return other, np.int64(-1)
    if other < 0:
        return other, np.int64(2**30)
    return other, np.int64(max(graph.state[first, k], graph.standing[other]))


@dataclass(frozen=True)
class Route:
    """A path over the lattice, from one of the start's connections to one of the goal's."""

    start: int
    """Index of the connection at the start."""
    edges: NDArray[np.int64]
    """(k,) edges from there."""
    goal: int
    """Index of the connection at the goal."""
    cost: float
    """Its cost [m] by what is known."""


class ShortestPaths:
    """Searches one lattice between fixed ends again and again, while edges are judged."""

    def __init__(self, edges: Edges, difficulty: Difficulty, starts: Seeds):
        """Search from about the nodes of the first seeds; later ones must be among them."""
        self._edges, self._difficulty = edges, difficulty
        nodes, count = edges.nodes, edges.nodes.count
        self._to_goal = ToGoal(np.empty(count), *nodes.surround(starts.nodes), np.inf)
        self._tree, self._changed = empty_tree(count), [starts.nodes]
        self._caution: float | None = None
        self._measured = self._since = 0
        self.expanded = 0
        """Number of nodes expanded by all searches."""
        self.last_expanded = 0
        """Number of nodes expanded by the last search."""

    def note(self, nodes: NDArray[np.int64]) -> None:
        """Note nodes (k,) to which edges may have other costs now.

        All others have those of the last search, and none costs less but those of its path.
        """
        self._changed.append(nodes)

    def find(self, starts: Seeds, goals: Seeds, caution: float) -> Route | None:
        """Return the shortest path, None if there is none.

        Args:
            starts: Nodes of the start's connections and their costs [m].
            goals: Nodes of the goal's connections and their costs [m].
            caution: Weight of the difficulties.
        """
        graph = self.graph(caution)
        if self._caution is None and caution > 0.0:
            self._guess(caution, goals)
        elif caution != self._caution:
            self._measure(graph, starts, goals)
        self._caution = caution
        goal, cost = self._search(graph, starts, goals, max(0, self._measured - self._since))
        if goal == GIVEN_UP:  # the costs to the goal are worn out
            self._measure(graph, starts, goals)
            goal, cost = self._search(graph, starts, goals, NO_LIMIT)
        if goal < 0:
            return None
        start, edges = self._follow_back(int(goals.nodes[goal]))
        return Route(start, edges, goal, cost)

    def graph(self, caution: float) -> Graph:
        """Return the lattice as kernels read it."""
        edges = self._edges
        known = edges.state, edges.cost, edges.standing, self._difficulty
        return Graph(edges.least_cost, edges.links, *known, caution, *edges.nodes.shape)

    def _guess(self, caution: float, goals: Seeds) -> None:
        """Take the costs to the goal for those on level ground as the crow flies, at first."""
        nodes = self._edges.nodes
        cell = EAGERNESS * nodes.cell * (1.0 + caution * PRICE * LEAST_DIFFICULTY)
        (row, column), radius = nodes.surround(goals.nodes)
        rows, columns = np.ogrid[: nodes.shape[0], : nodes.shape[1]]
        away = np.maximum(cell * np.hypot(rows - row, columns - column) - radius, 0.0)
        self._to_goal.cost.reshape(-1, HEADINGS)[:] = away.reshape(-1, 1)
        self._to_goal = self._to_goal._replace(limit=np.inf)
        self._measured = round(GUESSED * nodes.count)

    def _search(self, graph: Graph, starts: Seeds, goals: Seeds, most: int) -> tuple[int, float]:
        """Return the goal's seed, -1 or GIVEN_UP, and the cost [m] of the shortest path."""
        changed = np.unique(np.concatenate(self._changed))
        cut = mend(graph, starts, self._tree, changed)
        goal, cost, _, expanded = find_shortest(
            graph, starts, goals, False, self._to_goal, self._tree, 1.0, most
        )
        self._changed, self.last_expanded = [starts.nodes], cut + expanded
        self.expanded += self.last_expanded
        self._since += self.last_expanded
        return int(goal), float(cost)

    def _measure(self, graph: Graph, starts: Seeds, goals: Seeds) -> None:
        """Measure the costs to the goal again, and begin the search anew."""
        self._tree, known = (empty_tree(self._edges.nodes.count) for _ in range(2))
        _, _, limit, self._measured = find_shortest(
            graph, goals, starts, True, self._to_goal, known, SLACK, NO_LIMIT
        )
        self._to_goal, self._since = self._to_goal._replace(cost=known.cost, limit=limit), 0

    def _follow_back(self, node: int) -> tuple[int, NDArray[np.int64]]:
        """Return the start's connection and the edges (k,) that lead to a node."""
        edges, width = [], self._edges.width
        while (edge := int(self._tree.parent[node])) >= 0:
            edges.append(edge)
            node = edge // width
        return -1 - edge, np.array(edges[::-1], np.int64)
