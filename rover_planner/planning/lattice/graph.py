"""Shortest paths over the edges of a lattice, compiled.

An edge that is judged costs what the model found, or cannot be driven. One that is not judged
costs what it would on level ground, times 1 + `caution` x the doubt at its end.
"""

import heapq
from typing import NamedTuple

import numpy as np

from rover_physics.numerics.kernels import allocating_kernel, exact_kernel
from rover_planner.planning.lattice.edges import FAILS, PASSES, PrimitiveTable
from rover_planner.planning.lattice.headings import HEADINGS


class Graph(NamedTuple):
    """A lattice with what is known of it."""

    table: PrimitiveTable
    """The primitives."""
    state: np.ndarray
    """(nodes, P) states of the edges, see `JudgedEdges`."""
    cost: np.ndarray
    """(nodes, P) costs [m] of the edges that pass."""
    standing: np.ndarray
    """(nodes,) states of the nodes, see `JudgedEdges`."""
    doubt: np.ndarray
    """(nodes,) doubt that edges to a node pass, 0 for none."""
    caution: float
    """Weight of the doubt; with 0 no edge is estimated above its true cost."""
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


class Tree(NamedTuple):
    """What a search has reached."""

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
    return graph.table.least_cost[node % HEADINGS, k] * (1.0 + graph.caution * graph.doubt[end])


@exact_kernel
def node_at(graph, row, column, heading):
    """Return the node at a place, -1 if it is outside the window."""
    if 0 <= row < graph.rows and 0 <= column < graph.columns:
        return (row * graph.columns + column) * HEADINGS + heading
    return -1


@allocating_kernel
def measure_to_goal(graph, goals, starts, slack, distance):
    """Write the cost from each node to the goal, up to a little beyond the starts (Dijkstra).

    Args:
        graph: Graph.
        goals: Seeds with the costs from the nodes to the goal.
        starts: Seeds with the costs from the start to the nodes.
        slack: How much farther than the start is measured, as a factor.
        distance: (nodes,) written; infinite beyond what is returned.

    Returns:
        The cost up to which all nodes are known; infinite if all that lead to the goal are. And
        the number of known nodes.
    """
    distance[:] = np.inf
    heap = [(0.0, np.int64(-1))]
    heap.clear()
    for i in range(goals.nodes.size):
        standing = graph.standing[goals.nodes[i]] < FAILS
        if standing and goals.costs[i] < distance[goals.nodes[i]]:
            distance[goals.nodes[i]] = goals.costs[i]
            heapq.heappush(heap, (goals.costs[i], goals.nodes[i]))
    entry = np.full(distance.size, np.inf)
    for i in range(starts.nodes.size):
        entry[starts.nodes[i]] = min(entry[starts.nodes[i]], starts.costs[i])
    limit, known = np.inf, 0
    while len(heap) > 0:
        here, node = heapq.heappop(heap)
        if here > distance[node]:
            continue
        if here > limit:
            return here, known
        known += 1
        if entry[node] < np.inf:
            limit = min(limit, slack * (here + entry[node]))
        _enter_before(graph, node, here, distance, heap)
    return np.inf, known


@allocating_kernel
def _enter_before(graph, node, here, distance, heap):
    """Enter the nodes from which an edge leads to a node at cost `here`."""
    heading, place = node % HEADINGS, node // HEADINGS
    row, column = place // graph.columns, place % graph.columns
    for i in range(graph.table.back.shape[1]):
        first, k = graph.table.back[heading, i, 0], graph.table.back[heading, i, 1]
        if first < 0:
            break
        step = graph.table.step[first, k]
        before = node_at(graph, row - step[1], column - step[0], first)
        if before < 0:
            continue
        cost = here + edge_cost(graph, before, k, node)
        if cost < distance[before]:
            distance[before] = cost
            heapq.heappush(heap, (cost, before))


@allocating_kernel
def find_shortest(graph, starts, goals, to_goal, tree):
    """Find the shortest path from the start to the goal (A*).

    Args:
        graph: Graph.
        starts: Seeds with the costs from the start to the nodes.
        goals: Seeds with the costs from the nodes to the goal.
        to_goal: (nodes,) bound from below of the cost to the goal [m], and the bound where that
            is infinite.
        tree: Tree, written.

    Returns:
        Index of the goal's seed that the path ends with, -1 if there is no path; its cost [m]; and
        the number of nodes expanded.
    """
    distance, beyond = to_goal
    tree.cost[:] = np.inf
    leave = np.full(tree.cost.size, np.int64(-1))
    for i in range(goals.nodes.size):
        other = leave[goals.nodes[i]]
        if other < 0 or goals.costs[i] < goals.costs[other]:
            leave[goals.nodes[i]] = i
    heap = [(0.0, 0.0, np.int64(-1))]
    heap.clear()
    for i in range(starts.nodes.size):
        node, cost = starts.nodes[i], starts.costs[i]
        bound = min(distance[node], beyond)
        standing = graph.standing[node] < FAILS
        if standing and cost < tree.cost[node] and bound < np.inf:
            tree.cost[node], tree.parent[node] = cost, -1 - i
            heapq.heappush(heap, (cost + bound, -cost, node))
    best, found, expanded = np.inf, np.int64(-1), 0
    while len(heap) > 0:
        estimate, negative, node = heapq.heappop(heap)
        if estimate >= best:
            break
        if -negative > tree.cost[node]:
            continue
        expanded += 1
        if leave[node] >= 0 and -negative + goals.costs[leave[node]] < best:
            best, found = -negative + goals.costs[leave[node]], leave[node]
        _enter_after(graph, node, to_goal, tree, heap)
    return found, best, expanded


@allocating_kernel
def _enter_after(graph, node, to_goal, tree, heap):
    """Enter the nodes to which the edges of a node lead."""
    distance, beyond = to_goal
    heading, place = node % HEADINGS, node // HEADINGS
    row, column = place // graph.columns, place % graph.columns
    width = graph.table.end_heading.shape[1]
    for k in range(width):
        end_heading = graph.table.end_heading[heading, k]
        if end_heading < 0:
            break
        step = graph.table.step[heading, k]
        end = node_at(graph, row + step[1], column + step[0], end_heading)
        if end < 0:
            continue
        bound = min(distance[end], beyond)
        cost = tree.cost[node] + edge_cost(graph, node, k, end)
        if cost < tree.cost[end] and bound < np.inf:
            tree.cost[end], tree.parent[end] = cost, node * width + k
            heapq.heappush(heap, (cost + bound, -cost, end))
