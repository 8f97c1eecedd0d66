# SPDX-License-Identifier: Apache-2.0
"""The best paths of a lattice, by a search that shares no code with the planner's.

Nodes, primitives and connections are the planner's; the search is Dijkstra's of scipy, from both
ends. All nodes are judged at once. Then all edges that could be part of a path which costs little
more than the shortest one by what is known are judged, until all of the shortest one is.
"""

import time
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from benchmarks.path_search import Pair, SearchCase
from rover_planner.planning.search.connections import Connection, connect_goal, connect_start
from rover_planner.planning.search.edges import Edges
from rover_planner.planning.search.judge import PathJudge
from rover_planner.planning.search.nodes import HEADINGS
from rover_planner.planning.search.primitives import make_primitives
from rover_planner.planning.search.query import choose_window

BATCH = 500
"""Edges judged in one call."""
MARGIN = 0.02
"""Edges are judged that belong to a path which costs up to this share more than the shortest."""


class NoTruthError(Exception):
    """The time for the truth about a pair was over."""


@dataclass
class Truth:
    """The lattice of one case with what the model finds of it."""

    case: SearchCase
    """The rover on its ground."""
    judge: PathJudge = field(init=False)
    """The model."""
    edges: Edges = field(init=False)
    """All edges."""

    def __post_init__(self) -> None:
        case = self.case
        self.judge, spacing = case.judge, case.options.waypoint_spacing
        pose = np.array([*np.mean(np.reshape(case.terrain.bounds, (2, 2)), axis=1), 0.0])
        nodes, limited = choose_window(case.question((pose, pose)), 0.25 * case.rover.wheelbase)
        if limited:
            raise ValueError(f"{case.name} is larger than a window of the search")
        self.edges = Edges(nodes, make_primitives(case.rover, nodes.cell, spacing))
        codes = self.judge.stand(nodes.poses(np.arange(nodes.count)))
        self._stands = np.array([code == "" for code in codes])
        self._list_edges()

    def _list_edges(self) -> None:
        """List the edges between nodes on which the rover stands."""
        table, nodes = self.edges.table, self.edges.nodes
        node = np.flatnonzero(self._stands)
        row, column = np.divmod(node // HEADINGS, nodes.shape[1])
        parts = []
        for k in range(self.edges.width):
            step, end = table.step[node % HEADINGS, k], table.end_heading[node % HEADINGS, k]
            at_x, at_y = column + step[:, 0], row + step[:, 1]
            inside = (at_x >= 0) & (at_x < nodes.shape[1]) & (at_y >= 0) & (at_y < nodes.shape[0])
            inside &= end >= 0
            ends = ((at_y * nodes.shape[1] + at_x) * HEADINGS + end)[inside]
            cost = table.least_cost[node[inside] % HEADINGS, k]
            edge = node[inside] * self.edges.width + k
            parts.append(np.column_stack([edge, node[inside], ends, cost])[self._stands[ends]])
        listed = np.concatenate(parts)
        self._edge, self._from, self._to = listed[:, :3].astype(np.int64).T
        self._cost, self._judged = listed[:, 3].copy(), np.zeros(len(listed), bool)
        if len({*zip(self._from.tolist(), self._to.tolist(), strict=True)}) < len(listed):
            raise ValueError("two edges join the same nodes")  # csr_matrix would add their costs

    @property
    def judged(self) -> int:
        """Number of edges judged so far."""
        return int(self._judged.sum())

    @property
    def count(self) -> int:
        """Number of edges between nodes on which the rover stands."""
        return len(self._edge)

    def find(self, pair: Pair, seconds: float) -> float:
        """Return the cost [m] of the best path, infinite if nothing connects the two poses.

        Raises:
            NoTruthError: It took longer than the seconds.
        """
        rover, nodes = self.case.rover, self.edges.nodes
        spacing, deadline = self.case.options.waypoint_spacing, time.process_time() + seconds
        starts = self._enter(connect_start(rover, nodes, pair[0], spacing))
        goals = self._enter(connect_goal(rover, nodes, pair[1], spacing))
        while True:
            ahead, back = self._distances(starts, False), self._distances(goals, True)
            through = ahead[self._from] + self._cost + back[self._to]
            best = min((ahead[node] + cost for node, cost in goals.items()), default=np.inf)
            if not np.isfinite(best):
                return np.inf
            rows = np.flatnonzero(~self._judged & (through <= best * (1.0 + MARGIN)))
            if not (through[rows] <= best * (1.0 + 1e-9)).any():
                return float(best)
            self._judge(rows, deadline)

    def _enter(self, connections: list[Connection]) -> dict[int, float]:
        """Return the costs [m] of the connections that pass, the least of each node."""
        chosen = [one for one in connections if self._stands[one.node]]
        judged = self.judge.judge_pieces(chosen)
        found: dict[int, float] = {}
        for one, verdict in zip(chosen, judged, strict=True):
            if not verdict.code:
                found[one.node] = min(verdict.cost, found.get(one.node, np.inf))
        return found

    def _distances(self, ends: dict[int, float], backwards: bool) -> NDArray[np.float64]:
        """Return the costs [m] (nodes,) from the start, or to the goal if `backwards`."""
        count = self.edges.nodes.count
        open_ = np.isfinite(self._cost)
        first, last = self._from[open_], self._to[open_]
        if backwards:
            first, last = last, first
        source = np.full(len(ends), count)
        rows = np.concatenate([first, source])
        columns = np.concatenate([last, np.array(list(ends), np.int64)])
        costs = np.concatenate([self._cost[open_], np.array(list(ends.values()))])
        graph = csr_matrix((costs, (rows, columns)), shape=(count + 1, count + 1))
        return dijkstra(graph, indices=count)[:count]

    def _judge(self, rows: NDArray[np.int64], deadline: float) -> None:
        """Judge edges of the list."""
        for first in range(0, len(rows), BATCH):
            if time.process_time() > deadline:
                raise NoTruthError
            some = rows[first : first + BATCH]
            edges = self._edge[some].tolist()
            found = self.judge.judge_pieces([self.edges.piece(edge) for edge in edges])
            self._cost[some], self._judged[some] = [one.cost for one in found], True
