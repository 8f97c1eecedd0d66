"""Searches a path around obstacles on a lattice of motion primitives, with the full model.

The search is lazy (LazySP; Dellin and Srinivasa 2016, A unifying formalism for shortest path
problems with expensive edge evaluations): find the shortest path by what is known, ask the model
about its edges, and again. First it is cautious: places where the rover cannot stand make the edges
that lead there dear before they are judged, so that a first path is found soon. Then it is exact:
edges that are not judged cost what they would on level ground, so that the cost of the shortest
path is a bound from below on that of any path on the lattice.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.interruption import check_interruption
from rover_planner.planning.lattice.connections import Connection
from rover_planner.planning.lattice.edges import FAILS, PASSES, UNJUDGED, JudgedEdges
from rover_planner.planning.lattice.graph import Seeds
from rover_planner.planning.lattice.judge import Judge
from rover_planner.planning.lattice.shortest import Route, ShortestPaths
from rover_planner.planning.path_query import Candidate

CAUTIONS = (1.0, 0.0)
"""Weights of the doubts, one after the other; with 0 the search is exact."""
DOUBT = 5.0
"""Doubt at a node where the rover cannot stand: edges that lead there cost 1 + DOUBT as much."""
NEAR_OPTIMAL = 0.02
"""A path is good enough if no path of the lattice costs less by more than this share."""


@dataclass
class Progress:
    """What a search has found so far."""

    best: Candidate | None = None
    """The best path that passes as a whole."""
    cost: float = np.inf
    """Its cost [m]."""
    bound: float = 0.0
    """Bound from below on the cost of any path of the lattice [m]."""
    exhausted: bool = False
    """Whether the lattice has no path left to look at."""
    first_time: float = np.nan
    """Time to the first path [s]."""


class _Ends:
    """The connections of the start or of the goal, with what is known of them."""

    def __init__(self, connections: list[Connection]):
        self.connections = connections
        self.nodes = np.array([one.node for one in connections], np.int64)
        self.costs = np.array([one.least_cost for one in connections])
        self.judged = np.zeros(len(connections), bool)

    @property
    def seeds(self) -> Seeds:
        """The nodes with their costs."""
        return Seeds(self.nodes, self.costs)


@dataclass
class LatticeSearch:
    """A search between two poses over the edges of a lattice."""

    judge: Judge
    """The model."""
    known: JudgedEdges
    """What is known of the edges; grows with the search."""
    starts: list[Connection]
    """Connections from the start to nodes."""
    goals: list[Connection]
    """Connections from nodes to the goal."""
    progress: Progress = field(default_factory=Progress)
    """What it has found."""

    def __post_init__(self) -> None:
        count = self.known.edges.nodes.count
        self._doubt = np.zeros(count, np.float32)
        self._probed = np.zeros(count, bool)
        self._ends = _Ends(self.starts), _Ends(self.goals)
        self.shortest = ShortestPaths(self.known, self._doubt)
        self._refused: list[tuple[int, int, float]] = []

    def run(self, go_on: Callable[[], bool]) -> Progress:
        """Search until the best path is found, no path is left, or `go_on` returns False."""
        self._began = time.perf_counter()
        try:
            for caution in CAUTIONS:
                while go_on() and not self._step(caution):
                    check_interruption()
                if self.progress.exhausted:
                    break
        finally:
            self._forget_refusals()
        return self.progress

    def _step(self, caution: float) -> bool:
        """Find the shortest path and ask the model about it; return whether this phase is over."""
        starts, goals = (ends.seeds for ends in self._ends)
        route, progress = self.shortest.find(starts, goals, caution), self.progress
        if route is None:
            progress.exhausted, progress.bound = True, progress.cost
            return True
        if caution == 0.0:
            progress.bound = max(progress.bound, min(route.cost, progress.cost))
        if route.cost * (1.0 + NEAR_OPTIMAL) >= progress.cost:
            return True
        if caution > 0.0 and self._probe(route):
            return False
        if not self._judge_route(route):
            return False
        return self._take(route) and caution > 0.0

    def _probe(self, route: Route) -> bool:
        """Ask about the nodes of a route; return whether the rover cannot stand at a new one."""
        edges = self.known.edges
        open_edges = route.edges[self.known.state.flat[route.edges] == UNJUDGED]
        new = np.unique(edges.ends(open_edges))
        new = new[~self._probed[new]]
        if not len(new):
            return False
        self._probed[new] = True
        stands = self.judge.can_stand(edges.nodes.poses(new))
        self._doubt[new[~stands]] = DOUBT
        return not bool(stands.all())

    def _judge_route(self, route: Route) -> bool:
        """Judge what is open of a route; return whether all of it passes."""
        known, (start_ends, goal_ends) = self.known, self._ends
        edges = route.edges[known.state.flat[route.edges] == UNJUDGED]
        pieces = [known.edges.poses(edge) for edge in edges]
        gears = [known.edges.primitive(edge).gear for edge in edges]
        ends = [
            (ends, index)
            for ends, index in ((start_ends, route.start), (goal_ends, route.goal))
            if not ends.judged[index]
        ]
        pieces += [ends.connections[index].poses for ends, index in ends]
        gears += [ends.connections[index].gear for ends, index in ends]
        if not pieces:
            return True
        found = self.judge.judge(pieces, gears)
        for edge, judged in zip(edges, found, strict=False):
            known.write(edge, judged.code, judged.cost)
        for (side, index), judged in zip(ends, found[len(edges) :], strict=True):
            side.judged[index], side.costs[index] = True, judged.cost
        return not any(judged.code for judged in found)

    def _take(self, route: Route) -> bool:
        """Judge a route as a whole and keep it if it is the best; return whether it passes."""
        starts, goals = (ends.seeds for ends in self._ends)
        cost = float(starts.costs[route.start] + goals.costs[route.goal])
        cost += float(self.known.cost.flat[route.edges].sum())
        if cost >= self.progress.cost:
            return True
        poses, owners = self._join(route)
        candidate = self.judge.check(poses)
        if not candidate.verdict.traversable:
            owner = owners[candidate.verdict.first_failure]
            self._refuse(route, int(owner), candidate.verdict.code)
            return False
        progress = self.progress
        progress.best, progress.cost = candidate, cost
        if np.isnan(progress.first_time):
            progress.first_time = time.perf_counter() - self._began
        return True

    def _join(self, route: Route) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the waypoints (n, 3) of a route, and which piece leads to each (n,)."""
        start_ends, goal_ends = self._ends
        pieces = [start_ends.connections[route.start].poses]
        pieces += [self.known.edges.poses(edge) for edge in route.edges]
        pieces += [goal_ends.connections[route.goal].poses]
        return join_pieces(pieces)

    def _refuse(self, route: Route, piece: int, code: str) -> None:
        """Close a piece of a route for this search: its edges pass, but the whole path does not."""
        start_ends, goal_ends = self._ends
        if piece == 0:
            start_ends.costs[route.start] = np.inf
        elif piece == len(route.edges) + 1:
            goal_ends.costs[route.goal] = np.inf
        else:
            edge = int(route.edges[piece - 1])
            self._refused.append((edge, PASSES, float(self.known.cost.flat[edge])))
            self.known.write(edge, code, np.inf)

    def _forget_refusals(self) -> None:
        """Let the edges pass again that were closed for this search only."""
        for edge, state, cost in self._refused:
            self.known.state.flat[edge], self.known.cost.flat[edge] = state, cost
        self._refused.clear()


def join_pieces(
    pieces: list[NDArray[np.float64]],
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the waypoints (n, 3) of pieces that follow each other, and the piece of each (n,)."""
    parts, owners = [pieces[0][:1]], [np.zeros(1, np.int64)]
    for index, piece in enumerate(pieces):
        parts.append(piece[1:])
        owners.append(np.full(len(piece) - 1, index))
    poses = np.concatenate(parts)
    poses[:, 2] = np.arctan2(np.sin(poses[:, 2]), np.cos(poses[:, 2]))
    return poses, np.concatenate(owners)
