# SPDX-License-Identifier: Apache-2.0
"""Shortest paths over the edges of a lattice, compiled.

An edge that is judged costs what the model found, or cannot be driven. One that is not judged
costs what it would on level ground, times 1 + `caution` x the doubt at its end, and `caution` x
PRICE x its difficulty more.
"""

import heapq
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.kernels import allocating_kernel, exact_kernel
from rover_planner.planning.search.difficulty import LEAST_DIFFICULTY, Difficulty, difficulty_of
from rover_planner.planning.search.edges import FAILS, PASSES, Edges, PrimitiveTable
from rover_planner.planning.search.nodes import HEADINGS

PRICE = 4.0
"""Price of a unit of difficulty with a caution of 1 [cells]."""
SLACK = 1.1
"""Costs to the goal are measured up to this multiple of the cost from start to goal."""
FEW = 500
"""Number of nodes that a search may expand beside those of its path before it counts as misled."""
GUESSED, EAGERNESS = 0.25, 1.5
"""Share of the nodes that searches may expand so before costs to the goal that are guessed are
measured, which takes about as long, and guessed costs over those on level ground: the larger, the
sooner is a path found."""
GIVEN_UP = -2
"""Result of a search that would expand too many nodes."""


class Graph(NamedTuple):
    """A lattice with what is known of it."""

    table: PrimitiveTable
    """The primitives."""
    state: np.ndarray
    """(nodes, P) states of the edges, see `Edges`."""
    cost: np.ndarray
    """(nodes, P) costs [m] of the edges that pass."""
    standing: np.ndarray
    """(nodes,) states of the nodes, see `Edges`."""
    doubt: np.ndarray
    """(nodes,) doubt that edges to a node pass, 0 for none."""
    difficulty: Difficulty
    """Estimates how likely edges are refused."""
    caution: float
    """Weight of doubt and difficulty; with 0 no edge is estimated above its true cost."""
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
    cell: float
    """Distance of neighbouring nodes [m]."""
    limit: float
    """All costs are known for which the sum with the bound from the start is at most this [m]."""


class SearchTree(NamedTuple):
    """Nodes that a search has reached, with their costs."""

    cost: np.ndarray
    """(nodes,) cost from the start [m], infinite where nothing leads, written."""
    parent: np.ndarray
    """(nodes,) edge that leads to a node; -1 - i for seed i. Written where a cost is finite."""


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
    least = graph.table.least_cost[node % HEADINGS, k]
    if graph.caution == 0.0:
        return least
    price = PRICE * graph.difficulty.cell
    difficulty = difficulty_of(graph.difficulty, graph.columns, node, k)
    return least + graph.caution * (least * graph.doubt[end] + price * difficulty)


@exact_kernel
def _is_too_dear(graph, node, k, here, known):
    """Return whether edge k of a node, entered at cost `here`, leads nowhere below cost `known`.

    It may say no where it does not know: it does not look at the ground.
    """
    least = graph.table.least_cost[node % HEADINGS, k]
    return graph.state[node, k] != PASSES and here + least >= known


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
    link = graph.table.links[1 if backwards else 0, heading, i]
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
    from_start = max(to_goal.cell * np.hypot(rows, along) - to_goal.radius, 0.0)
    if backwards:
        return from_start
    if to_goal.cost[node] + from_start <= to_goal.limit:
        return to_goal.cost[node]
    return max(to_goal.limit - from_start, 0.0)


@allocating_kernel
def find_shortest(graph, seeds, exits, backwards, to_goal, tree, slack, most):
    """Find the shortest path from seeds to exits (A*).

    Args:
        graph: Graph.
        seeds: Seeds with the costs from the start to the nodes; backwards, from them to the goal.
        exits: The same of the other end.
        backwards: Whether the search is from the goal to the start.
        to_goal: ToGoal.
        tree: SearchTree, written; backwards only its `cost`.
        slack: Up to which multiple of the cost of the shortest path it goes on.
        most: Number of nodes that it may expand.

    Returns:
        Index of the exit that the path ends with, -1 if there is no path, GIVEN_UP if it is not
        known; its cost [m]; the cost [m] up to which paths are known, infinite for all; and the
        number of nodes expanded.
    """
    tree.cost[:] = np.inf
    leave = np.full(tree.cost.size, np.int64(-1))
    for i in range(exits.nodes.size):
        other = leave[exits.nodes[i]]
        if other < 0 or exits.costs[i] < exits.costs[other]:
            leave[exits.nodes[i]] = i
    heap = [(0.0, 0.0, np.int64(-1))]
    heap.clear()
    for i in range(seeds.nodes.size):
        node, cost = seeds.nodes[i], seeds.costs[i]
        if graph.standing[node] < FAILS and cost < tree.cost[node]:
            _enter(graph, node, cost, -1 - i, backwards, to_goal, tree, heap)
    best, found, expanded = np.inf, np.int64(-1), 0
    width = graph.state.shape[1]
    while len(heap) > 0:
        estimate, negative, node = heapq.heappop(heap)
        if estimate >= slack * best:
            return found, best, slack * best, expanded
        if -negative > tree.cost[node]:
            continue
        if expanded == most:
            return np.int64(GIVEN_UP), np.inf, 0.0, expanded
        expanded += 1
        if leave[node] >= 0 and -negative + exits.costs[leave[node]] < best:
            best, found = -negative + exits.costs[leave[node]], leave[node]
        for i in range(graph.table.links.shape[2]):
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
        tree.cost[node] = cost
        if not backwards:
            tree.parent[node] = parent
        heapq.heappush(heap, (cost + bound, -cost, node))


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
    most = graph.table.links.shape[2]
    visited = [np.int64(-1)]
    visited.clear()
    while len(stack) > 0:
        node = stack.pop()
        visited.append(node)
        for i in range(most):
            other, state = _look_across(graph, node, i, backwards)
            if other >= 0 and state < FAILS and not inside[other]:
                inside[other] = True
                stack.append(other)
    for node in visited:
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

    def __init__(
        self,
        edges: Edges,
        doubt: NDArray[np.float32],
        difficulty: Difficulty,
        starts: Seeds,
    ):
        """Search from about the nodes of the first seeds; later ones must be among them."""
        self._edges, self._doubt, self._difficulty = edges, doubt, difficulty
        nodes, count = edges.nodes, edges.nodes.count
        self._to_goal = ToGoal(np.empty(count), *nodes.surround(starts.nodes), nodes.cell, np.inf)
        self._measured = self._most = 0
        self._tree = SearchTree(np.empty(count), np.empty(count, np.int64))
        self._caution, self._misled = -1.0, 0
        self.expanded = 0
        """Number of nodes expanded by all searches."""
        self.last_expanded = 0
        """Number of nodes expanded by the last search."""

    def find(self, starts: Seeds, goals: Seeds, caution: float) -> Route | None:
        """Return the shortest path, None if there is none.

        Args:
            starts: Nodes of the start's connections and their costs [m].
            goals: Nodes of the goal's connections and their costs [m].
            caution: Weight of the doubts.
        """
        graph = self.graph(caution)
        if caution != self._caution:
            self._begin(graph, starts, goals)
        goal, cost = self._search(graph, starts, goals)
        if goal == GIVEN_UP:
            self._measure(graph, starts, goals)
            goal, cost = self._search(graph, starts, goals)
        if self._misled > self._measured:  # the costs to the goal are worn out
            self._measure(graph, starts, goals)
        if goal < 0:
            return None
        start, edges = self._follow_back(int(goals.nodes[goal]))
        return Route(start, edges, goal, cost)

    def graph(self, caution: float) -> Graph:
        """Return the lattice as kernels read it."""
        edges = self._edges
        known = edges.state, edges.cost, edges.standing, self._doubt, self._difficulty
        return Graph(edges.table, *known, caution, *edges.nodes.shape)

    def _begin(self, graph: Graph, starts: Seeds, goals: Seeds) -> None:
        """Begin with another caution: guess the costs to the goal at first, later measure them."""
        is_first, self._caution = self._caution < 0.0, graph.caution
        if is_first and graph.caution > 0.0:
            self._guess(graph.caution, goals)
        else:
            self._measure(graph, starts, goals)

    def _guess(self, caution: float, goals: Seeds) -> None:
        """Take the costs to the goal for those on level ground as the crow flies."""
        nodes = self._edges.nodes
        cell = EAGERNESS * nodes.cell * (1.0 + caution * PRICE * LEAST_DIFFICULTY)
        (row, column), radius = nodes.surround(goals.nodes)
        rows, columns = np.ogrid[: nodes.shape[0], : nodes.shape[1]]
        away = np.maximum(cell * np.hypot(rows - row, columns - column) - radius, 0.0)
        self._to_goal.cost.reshape(-1, HEADINGS)[:] = away.reshape(-1, 1)
        self._to_goal = self._to_goal._replace(limit=np.inf)
        self._measured = self._most = round(GUESSED * nodes.count)

    def _search(self, graph: Graph, starts: Seeds, goals: Seeds) -> tuple[int, float]:
        """Return the goal's seed, -1 or GIVEN_UP, and the cost [m] of the shortest path."""
        goal, cost, _, expanded = find_shortest(
            graph, starts, goals, False, self._to_goal, self._tree, 1.0, self._most - self._misled
        )
        self.expanded, self.last_expanded = self.expanded + expanded, expanded
        self._misled += max(0, expanded - FEW)
        return int(goal), float(cost)

    def _measure(self, graph: Graph, starts: Seeds, goals: Seeds) -> None:
        """Measure the costs to the goal again."""
        self._misled, self._most = 0, np.iinfo(np.int64).max
        known = SearchTree(self._to_goal.cost, self._tree.parent)
        _, _, limit, self._measured = find_shortest(
            graph, goals, starts, True, self._to_goal, known, SLACK, self._most
        )
        self._to_goal = self._to_goal._replace(limit=limit)

    def _follow_back(self, node: int) -> tuple[int, NDArray[np.int64]]:
        """Return the start's connection and the edges (k,) that lead to a node."""
        edges, width = [], self._edges.width
        while (edge := int(self._tree.parent[node])) >= 0:
            edges.append(edge)
            node = edge // width
        return -1 - edge, np.array(edges[::-1], np.int64)
