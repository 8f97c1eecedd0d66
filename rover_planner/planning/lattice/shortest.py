# SPDX-License-Identifier: Apache-2.0
"""The shortest path from start to goal over what is known of a lattice so far."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_planner.planning.lattice.difficulty import Difficulty
from rover_planner.planning.lattice.edges import JudgedEdges
from rover_planner.planning.lattice.graph import (
    Graph,
    Seeds,
    ToGoal,
    Tree,
    find_shortest,
    measure_to_goal,
)

SLACK = 1.1
"""Costs to the goal are measured up to this multiple of the cost from start to goal."""
FEW = 500
"""Number of nodes that a search may expand beside those of its path before it counts as misled."""


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
        known: JudgedEdges,
        doubt: NDArray[np.float32],
        difficulty: Difficulty,
        starts: Seeds,
    ):
        """Search from about the nodes of the first seeds; later ones must be among them."""
        self._known, self._doubt, self._difficulty = known, doubt, difficulty
        nodes = known.edges.nodes
        count = nodes.count
        self._to_goal = ToGoal(np.empty(count), *nodes.surround(starts.nodes), nodes.cell)
        self._limit, self._measured = np.inf, 0
        self._tree = Tree(np.empty(count), np.empty(count, np.int64))
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
            self._measure(graph, starts, goals)
            self._caution = caution
        to_goal = self._to_goal, self._limit
        goal, cost, expanded = find_shortest(graph, starts, goals, to_goal, self._tree)
        self.expanded += expanded
        self.last_expanded = expanded
        self._misled += max(0, expanded - FEW)
        if self._misled > self._measured:  # the costs to the goal are worn out
            self._measure(graph, starts, goals)
        if goal < 0:
            return None
        start, edges = self._follow_back(int(goals.nodes[goal]))
        return Route(start, edges, int(goal), float(cost))

    def graph(self, caution: float) -> Graph:
        """Return the lattice as kernels read it."""
        known, nodes = self._known, self._known.edges.nodes
        return Graph(
            known.edges.table,
            known.state,
            known.cost,
            known.standing,
            self._doubt,
            self._difficulty,
            caution,
            *nodes.shape,
        )

    def _measure(self, graph: Graph, starts: Seeds, goals: Seeds) -> None:
        """Measure the costs to the goal again."""
        self._misled = 0
        self._limit, self._measured = measure_to_goal(graph, goals, starts, SLACK, self._to_goal)

    def _follow_back(self, node: int) -> tuple[int, NDArray[np.int64]]:
        """Return the start's connection and the edges (k,) that lead to a node."""
        edges, width = [], self._known.edges.width
        while (edge := int(self._tree.parent[node])) >= 0:
            edges.append(edge)
            node = edge // width
        return -1 - edge, np.array(edges[::-1], np.int64)
