# SPDX-License-Identifier: Apache-2.0
"""Searches a path around obstacles on a lattice of motion primitives, with the full model.

The search is lazy (LazySP; Dellin and Srinivasa 2016, A unifying formalism for shortest path
problems with expensive edge evaluations): find the shortest path by what is known, ask the model
about its nodes, then about its edges, and again. A node where the rover cannot stand belongs to no
path. First the search is cautious: edges on difficult ground are dearer, so that a first path is
found soon. Then it is exact: edges that are not judged cost what they would on level ground, so
that the cost of the shortest path is a bound from below on that of any path on the lattice.
"""

import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.interruption import check_interruption
from rover_planner.angles import wrap
from rover_planner.planning.path_query import Candidate
from rover_planner.planning.search.connections import Connection
from rover_planner.planning.search.difficulty import Difficulty, difficulty_of
from rover_planner.planning.search.edges import PASSES, UNJUDGED, Edges, Piece
from rover_planner.planning.search.graph import Route, Seeds, ShortestPaths, spread
from rover_planner.planning.search.judge import PathJudge
from rover_planner.planning.search.nodes import HEADINGS

CAUTIONS = (12.0, 1.0, 0.0)
"""Weights of the difficulties, one after the other; with 0 the search is exact."""
FEW_NODES, NODES_ASKED = 200, 0.05
"""Number of nodes around refused ones that are asked about at least, and in addition for each node
that the last search expanded: then both take about as long."""
FIRST_PIECES = 4
"""Number of pieces of a path that are judged first."""
MOST_REFUSED = 3
"""Number of refused connections of start or goal from which on others are judged, too: it may be
closed in, and each of them costs a search."""
NEAR_OPTIMAL = 0.02
"""A path is good enough if no path of the lattice costs less by more than this share."""
_WORDS = {
    "off_map": "the edge of the map",
    "unknown_ground": "unknown ground",
    "wheel_drop": "drops",
    "wheel_lift": "lifting wheels",
    "tip_over": "tip-over",
    "not_settled": "ground that the wheels do not fit",
}
"""Words for codes that do not speak for themselves."""


@dataclass
class SearchProgress:
    """Progress of a search: its best path so far, and a bound on the cost of any path."""

    best: Candidate | None = None
    """The best path that passes as a whole."""
    cost: float = np.inf
    """Its cost [m]."""
    least_cost: float = 0.0
    """Bound from below on the cost of any path of the lattice [m]."""
    exhausted: bool = False
    """True if the lattice has no path left to look at."""
    judged: int = 0
    """Number of edges that the model has judged."""
    first_time: float = np.nan
    """Time of the monotonic clock when the first path was found [s]."""
    pieces: list[Piece] = field(default_factory=list)
    """The pieces of the best path."""

    def keep(self, pieces: list[Piece], candidate: Candidate) -> bool:
        """Keep a path, judged as a whole, as the best if it passes; return whether it does."""
        if not candidate.verdict.traversable:
            return False
        self.best, self.pieces = candidate, pieces
        self.cost = sum(one.cost for one in pieces)
        if np.isnan(self.first_time):
            self.first_time = time.perf_counter()
        return True


class _Ends:
    """The connections of the start or of the goals, with what is known of them."""

    def __init__(self, connections: list[Connection]):
        self.connections = connections
        self.nodes = np.array([one.node for one in connections], np.int64)
        self.costs = np.array([one.cost + one.surcharge for one in connections])
        self.seeds = Seeds(self.nodes, self.costs)
        """The nodes with their costs."""
        self.judged = np.zeros(len(connections), bool)
        self.codes: list[str] = []
        """Codes of the connections that were refused."""
        self.many = MOST_REFUSED
        """Number of refused connections from which on further ones are judged."""

    def piece(self, k: int) -> Piece:
        """Return connection k as a piece of path with its cost."""
        return self.connections[k].piece(float(self.costs[k]))

    def is_open(self, k: int) -> bool:
        """Return whether connection k is not judged."""
        return not self.judged[k]

    def write(self, k: int, code: str, cost: float) -> None:
        """Keep what was found of connection k: the code of its failure, "" for none, its cost."""
        self.judged[k], self.costs[k] = True, cost + self.connections[k].surcharge
        self.codes += [code] if code else []

    @property
    def open_nodes(self) -> NDArray[np.int64]:
        """The nodes (k,) of the connections that may pass."""
        return self.nodes[np.isfinite(self.costs)]


Part = tuple[Edges | _Ends, int]
"""A part of a route: an edge, or a connection of the start or of the goal."""


@dataclass
class LatticeSearch:
    """A search from a start to one of some goals over the edges of a lattice."""

    judge: PathJudge
    """The model."""
    edges: Edges
    """The edges; what is known of them grows with the search."""
    starts: list[Connection]
    """Connections from the start to nodes."""
    goals: list[Connection]
    """Connections from nodes to the goal, or to all that are allowed."""
    difficulty: Difficulty
    """Estimates how likely edges are refused."""
    progress: SearchProgress = field(default_factory=SearchProgress)
    """Its progress."""

    def __post_init__(self) -> None:
        self.ends = _Ends(self.starts), _Ends(self.goals)
        """Judged connections of the start and of the goal."""
        self.shortest = ShortestPaths(self.edges, self.difficulty, self.ends[0].seeds)
        self._refused: list[tuple[int, float]] = []

    def run(self, allowed: Callable[["LatticeSearch"], bool]) -> SearchProgress:
        """Search until the best path is found, no path is left, or it is not allowed to go on.

        Afterwards call `reopen`.
        """
        for caution in CAUTIONS:
            while allowed(self) and not self._step(caution):
                check_interruption()
            if self.progress.exhausted:
                break
        return self.progress

    def reopen(self) -> None:
        """Open the edges again that are closed for this search only."""
        for edge, cost in self._refused:
            self.edges.write(edge, "", cost)

    def _step(self, caution: float) -> bool:
        """Find the shortest path and ask the model about it; return whether this phase is over."""
        starts, goals = (ends.seeds for ends in self.ends)
        route, progress = self.shortest.find(starts, goals, caution), self.progress
        if route is None:
            progress.exhausted, progress.least_cost = True, progress.cost
            return True
        if caution == 0.0:
            progress.least_cost = max(progress.least_cost, min(route.cost, progress.cost))
        if route.cost * (1.0 + NEAR_OPTIMAL) >= progress.cost:
            return True
        if not (self._stand_along(route) and self._judge_route(route)):
            return False
        return self._take(route) and caution > 0.0

    def _stand_along(self, route: Route) -> bool:
        """Ask about the nodes of a route; return whether the rover can stand at all new ones."""
        ends = self.starts[route.start].node, self.goals[route.goal].node
        new = self._unjudged(np.unique(np.concatenate([self.edges.ends(route.edges), ends])))
        refused = new[~self._stand(new)]
        self._explore(refused)
        return not len(refused)

    def _unjudged(self, nodes: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return those of nodes (n,) at which the model was not asked whether the rover stands."""
        return nodes[self.edges.standing[nodes] == UNJUDGED]

    def _explore(self, refused: NDArray[np.int64]) -> None:
        """Ask about the nodes around refused ones, and around those refused in turn.

        Obstacles are larger than a node. The work is in proportion to that of the last search.
        """
        allowed = FEW_NODES + round(NODES_ASKED * self.shortest.last_expanded)
        while len(refused) and allowed > 0:
            around = self._unjudged(self.edges.nodes.around(refused))[:allowed]
            allowed -= len(around)
            refused = around[~self._stand(around)]

    def _stand(self, nodes: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Ask whether the rover can stand at nodes (n,)."""
        if not len(nodes):
            return np.ones(0, bool)
        codes = self.judge.stand(self.edges.nodes.poses(nodes))
        self.edges.standing[nodes] = [self.edges.state_of(code) for code in codes]
        self.shortest.note(nodes)
        return self.edges.standing[nodes] == PASSES

    def _judge_route(self, route: Route) -> bool:
        """Judge what is open of a route, the hardest first; return whether all of it passes.

        More and more pieces are judged at a time.
        """
        parts = [(kept, index) for kept, index in self._parts(route) if kept.is_open(index)]
        parts, size = sorted(parts, key=self._hardness, reverse=True), FIRST_PIECES
        while parts:
            if not self._judge(parts[:size]):
                self._judge_ends()
                return False
            parts, size = parts[size:], 2 * size
        return True

    def _parts(self, route: Route) -> list[Part]:
        """Return the parts of a route in the order of the drive."""
        starts, goals = self.ends
        inner: list[Part] = [(self.edges, edge) for edge in route.edges.tolist()]
        return [(starts, route.start), *inner, (goals, route.goal)]

    def _hardness(self, part: Part) -> float:
        """Return how likely a part is refused; the connections of the ends come first."""
        kept, index = part
        if kept is not self.edges:
            return np.inf
        node, k = divmod(index, self.edges.width)
        return float(difficulty_of(self.difficulty, self.edges.nodes.shape[1], node, k))

    def _judge_ends(self) -> None:
        """Judge as many further connections of start or goal as were refused, if many were."""
        for ends in self.ends:
            refused = int(np.isinf(ends.costs).sum())
            if refused < ends.many:
                continue
            ends.many = 2 * refused
            rows = np.flatnonzero(~ends.judged)
            rows = rows[np.argsort(ends.costs[rows], kind="stable")][:refused]
            self._stand(np.unique(self._unjudged(ends.nodes[rows])))
            stands = self.edges.standing[ends.nodes[rows]] == PASSES
            self._judge([(ends, k) for k in rows[stands].tolist()])
            ends.judged[rows], ends.costs[rows[~stands]] = True, np.inf

    def _judge(self, parts: Sequence[Part]) -> bool:
        """Judge parts, keep what is found, and return whether all pass."""
        if not parts:
            return True
        found = self.judge.judge_pieces([kept.piece(index) for kept, index in parts])
        for (kept, index), judged in zip(parts, found, strict=True):
            kept.write(index, judged.code, judged.cost)
            self.progress.judged += kept is self.edges
        self._note(parts)
        return not any(judged.code for judged in found)

    def _note(self, parts: Sequence[Part]) -> None:
        """Note that the costs of parts have changed."""
        edges = [index for kept, index in parts if kept is self.edges]
        self.shortest.note(self.edges.ends(np.array(edges, np.int64)))

    def _take(self, route: Route) -> bool:
        """Judge a route as a whole and keep it if it is the best; return whether it passes."""
        pieces = [kept.piece(index) for kept, index in self._parts(route)]
        if sum(one.cost for one in pieces) >= self.progress.cost:
            return True
        poses, owners = join_pieces(pieces)
        candidate = self.judge.check(poses, stop_at_failure=True)
        if not self.progress.keep(pieces, candidate):
            owner = owners[candidate.verdict.first_failure]
            self._refuse(route, int(owner), candidate.verdict.code)
            return False
        return True

    def _refuse(self, route: Route, number: int, code: str) -> None:
        """Close a part of a route for this search: it passes, but the whole path does not."""
        kept, index = part = self._parts(route)[number]
        if isinstance(kept, Edges):
            self._refused.append((index, float(kept.cost.flat[index])))
        kept.write(index, code, np.inf)
        self._note([part])


def join_pieces(pieces: Sequence[Piece]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the waypoints (n, 3) of pieces that follow each other, and the piece of each (n,)."""
    parts, owners = [pieces[0].poses[:1]], [np.zeros(1, np.int64)]
    for index, piece in enumerate(pieces):
        parts.append(piece.poses[1:])
        owners.append(np.full(len(piece.poses) - 1, index))
    poses = np.concatenate(parts)
    poses[:, 2] = wrap(poses[:, 2])
    return poses, np.concatenate(owners)


@dataclass(frozen=True, eq=False)
class ClosedArea:
    """The places that the start, or the goal, is connected with."""

    around_goal: bool
    """True if it lies around the goal; else around the start."""
    places: NDArray[np.bool_]
    """(rows, columns) True for its places, row 0 at the smallest y."""
    area: float
    """Its area [m2]."""
    causes: dict[str, float]
    """Shares of the codes among the edges that would lead across its border, the largest first."""

    def describe(self) -> str:
        """Return one sentence for people."""
        whose = "from which the goal can be reached" if self.around_goal else "reachable"
        shares = ", ".join(
            f"{_WORDS.get(code, code.replace('_', ' '))} {round(100 * share)} %"
            for code, share in self.causes.items()
        )
        return f"{self.area:.1f} m2 {whose}, closed in by: {shares or 'nothing that is known'}"


def find_closed_area(search: LatticeSearch) -> ClosedArea:
    """Return the smaller one of the areas that start and goal are connected with.

    Edges that were not judged count as open, so that the areas are bounds from above.
    """
    edges = search.edges
    graph, nodes, areas = search.shortest.graph(0.0), edges.nodes, []
    for around_goal, ends in enumerate(search.ends):
        inside = np.zeros(nodes.count, bool)
        crossing = np.zeros(len(edges.codes) + 1, np.int64)
        spread(graph, ends.open_nodes, bool(around_goal), inside, crossing)
        counts: Counter[str] = Counter()
        for code, count in zip([*edges.codes, "off_map"], crossing.tolist(), strict=True):
            counts[code] += count
        counts.update(ends.codes)
        total = max(sum(counts.values()), 1)
        causes = {code: count / total for code, count in counts.most_common() if count}
        places = np.asarray(inside.reshape(*nodes.shape, HEADINGS).any(axis=2))
        area = float(places.sum()) * nodes.cell**2
        areas.append(ClosedArea(bool(around_goal), places, area, causes))
    return min(areas, key=lambda one: one.area)
