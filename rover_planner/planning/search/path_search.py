# SPDX-License-Identifier: Apache-2.0
"""Searches a path between two poses, smooths it, and explains where there is none."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_physics.numerics.interruption import check_interruption
from rover_physics.numerics.plain_values import to_plain
from rover_physics.rover.steering_joints import tightest_radius
from rover_physics.terrain.grid import Terrain
from rover_planner.errors import PlanningError
from rover_planner.planning.candidates import check_pose
from rover_planner.planning.dubins import shortest_dubins_path
from rover_planner.planning.path_geometry import path_length
from rover_planner.planning.path_query import Candidate, Pose, generate_paths
from rover_planner.planning.search.connections import (
    MISSED_PRICE,
    Connection,
    connect_end,
    connect_frontier,
)
from rover_planner.planning.search.difficulty import (
    estimate_difficulty,
    find_groundless,
    steepest_climb,
)
from rover_planner.planning.search.edge_memory import EdgeMemory
from rover_planner.planning.search.edges import Gear, Piece
from rover_planner.planning.search.judge import PathJudge, cost_of_path
from rover_planner.planning.search.lattice_search import (
    ClosedArea,
    LatticeSearch,
    SearchProgress,
    find_closed_area,
    join_pieces,
)
from rover_planner.planning.search.nodes import Nodes
from rover_planner.planning.search.query import (
    LatticeSettings,
    SearchQuery,
    choose_window,
    cut_out,
)

FOUND, NO_WAY, OUT_OF_TIME = "found", "no_way", "out_of_time"
BEYOND = ("unknown_ground", "off_map")
"""Codes of goals that lie beyond the frontier of the known ground."""
START_REFUSED, GOAL_REFUSED = "start_refused", "goal_refused"
"""Outcomes of a search."""

OF_PATH = ("length", "energy", "time", "risk", "failure_chance")
"""Entries of a report that only a found path has."""
REPORTED = (
    "outcome", "reason", "cost", "expanded", "edges_judged", "edges", "seconds_first", "seconds",
    "repeatable", "warning",
)  # fmt: skip
"""Fields of a result that a report has."""
POSES_PER_SECOND = 20_000
"""Poses that the model may be asked about per second of the budget."""
EXPANSIONS_PER_POSE = 40
"""Expanded nodes that count as much as one pose."""
COARSE = 0.5
"""Distance of neighbouring nodes above which obstacles are finer than the lattice [wheelbases]."""
SMOOTHING = 0.2
"""Share of the budget for smoothing."""
SPANS = (4, 8, 16, 8, 4, 3, 2)
"""Numbers of pieces that one curve replaces, one pass over the path after the other."""
RADII = (2.0, 1.0)
"""Radii of the curves that are tried [tightest radii of the rover]."""
GAIN = 1e-3
"""Share of its cost that a curve must save."""
ASKED = 0.99
"""Accepted chance from which the chance of a path is not asked for where it is weighed."""


@dataclass(frozen=True, eq=False)
class SearchResult:
    """The path that was found, or why there is none."""

    outcome: str
    """FOUND, NO_WAY, OUT_OF_TIME, START_REFUSED or GOAL_REFUSED."""
    reason: str
    """One sentence for people."""
    path: Candidate | None
    """The path with prediction and verdict; None unless it was found."""
    pieces: Sequence[Piece]
    """Its pieces; empty without a path."""
    suboptimality: float
    """Largest factor by which it cost more, before smoothing, than the best path of the lattice;
    infinite if that is not known."""
    expanded: int
    """Number of expanded nodes."""
    edges_judged: int
    """Number of edges that the model has judged."""
    edges: int
    """Number of edges of the lattice."""
    seconds_first: float
    """Time until the first path was known [s], NaN without one."""
    seconds: float
    """Time of the whole search [s]."""
    repeatable: bool
    """True if the same question gives the same answer to the bit: the clock did not end it."""
    nodes: Nodes
    """The nodes of the lattice."""
    closed: ClosedArea | None
    """The closed-in area where no path exists; else None."""
    warning: str
    """Condition that may have hidden a path, such as a coarse lattice; empty without one."""

    @property
    def cost(self) -> float:
        """Its cost [m of level ground]; infinite without a path."""
        return math.inf if self.path is None else sum(one.cost for one in self.pieces)

    def report(self) -> dict[str, Any]:
        """Return the result as plain values for JSON; numbers that are not known are None.

        Lengths are in m, energy in J, times in s. Risk is the used share of the tightest safety
        limit.
        """
        path, closed = self.path, self.closed
        drive: dict[str, Any] = dict.fromkeys(OF_PATH)
        if path is not None:
            spent = path.length, path.prediction.energy[-1], path.prediction.time[-1]
            risks = path.verdict.risk, path.verdict.failure_chance
            drive = dict(zip(OF_PATH, (*spent, *risks), strict=True))
        found: dict[str, Any] = to_plain(
            {
                "found": self.outcome == FOUND,
                **{name: getattr(self, name) for name in REPORTED},
                **drive,
                "bound": self.suboptimality,
                "closed_area": None if closed is None else closed.area,
                "closed_by": None if closed is None else closed.causes,
            }
        )
        return found


def find_path(
    query: SearchQuery,
    settings: LatticeSettings | None = None,
    memory: EdgeMemory | None = None,
    on_progress: Callable[[SearchProgress], None] | None = None,
) -> SearchResult:
    """Search a path from start to goal.

    If chances are weighed, it is the path with the least cost + weight x chance of several: the
    first is the cheapest one whose chance is accepted, each further one the cheapest with at most
    half the chance of that before. What is uncertain is mostly common to a path, so that its
    chance is that of its worst place and does not add up from edge to edge.

    Args:
        query: What is asked.
        settings: How it is searched.
        memory: What earlier searches have found; None begins anew.
        on_progress: Called after each step of the search with what is known so far.

    Raises:
        PlanningError: Start or goal are not finite or not on the map.
        RoverError: The model refuses an option.
    """
    settings = settings or LatticeSettings()
    began, weight = time.perf_counter(), settings.chance_weight
    if weight == 0.0 or settings.ends_at_first:
        return _PathFinder(query, settings, memory, on_progress).answer()
    accepted = min(query.site.options.accepted_chance, ASKED)
    answers, totals, earlier = [], [], None
    while True:
        settings = replace(settings, budget=0.5 * settings.budget)
        options = query.site.options.change(accepted_chance=accepted)
        asked = replace(query.site, options=options)
        finder = _PathFinder(replace(query, site=asked), settings, memory, on_progress, earlier)
        answers.append(finder.answer())
        path, memory, earlier = answers[-1].path, None, finder.progress
        if path is None:
            break
        cost = cost_of_path(query.site.rover, answers[-1].pieces, path)
        accepted = 0.5 * path.verdict.failure_chance
        totals.append(cost + weight * path.verdict.failure_chance)
        if accepted == 0.0 or cost >= min(totals):
            break
    if not totals and query.site.options.asked_chance is None:  # what fails for sure may be taken
        answers.append(_PathFinder(query, settings, memory, on_progress, earlier).answer())
    best = answers[int(np.argmin(totals)) if totals else -1]
    return replace(
        best,
        seconds_first=answers[0].seconds_first,
        seconds=time.perf_counter() - began,
        repeatable=all(one.repeatable for one in answers),
    )


class _PathFinder:
    """One search with all that belongs to it."""

    def __init__(
        self,
        query: SearchQuery,
        settings: LatticeSettings,
        memory: EdgeMemory | None,
        on_progress: Callable[[SearchProgress], None] | None,
        earlier: SearchProgress | None = None,
    ):
        """Prepare a search; until it finds a path, it tells the progress of the `earlier` one."""
        self._began = time.perf_counter()
        self._query, self._settings = query, settings
        self._on_progress, self._earlier = on_progress, earlier
        self._site = query.site
        self._start = _check_end("start", query.start, query.site.terrain)
        ground = None if settings.frontier else query.site.terrain
        self._goal = _check_end("goal", query.goal, ground)
        self._memory = memory or EdgeMemory()
        self._judge = self._memory.begin(query.site)
        cell = settings.cell or 0.25 * query.site.rover.wheelbase
        self._nodes, self._is_limited = choose_window(query, cell)
        self._repeatable = True
        self._goals, self._to_goal, self._to_frontier = [self._goal], True, False
        self.progress = SearchProgress()

    def answer(self) -> SearchResult:
        """Search the path."""
        code, reason = self._judge.refuse(self._start, self._start)
        if code:
            return self._make_result(
                START_REFUSED, f"the rover cannot stand at the start: {reason}"
            )
        code, reason = self._judge.refuse(self._start, self._goal)
        if code:
            self._to_goal = False
            self._to_frontier = self._settings.frontier and code in BEYOND
            rings = self._judge.goals_near(self._start, self._goal, self._query.tolerance)
            self._goals = [] if self._to_frontier else list(chain.from_iterable(rings))
            if not (self._goals or self._to_frontier):
                return self._make_result(
                    GOAL_REFUSED, f"the rover cannot stand at the goal: {reason}"
                )
        progress = self.progress
        if self._to_goal:
            self._try_known_paths()
        if self._settings.ends_at_first and progress.best is not None:
            self._memory.keep_path(self._query, progress.pieces)
            return self._make_result(FOUND, "", path=progress.best, pieces=progress.pieces)
        search = self._prepare()
        try:
            return self._run(search)
        finally:
            search.reopen()

    def _run(self, search: LatticeSearch) -> SearchResult:
        """Search the lattice."""
        progress = search.run(self._tell_and_go_on)
        if progress.best is not None:
            path, pieces = self._smooth(progress)
            rest = self._describe_rest(path)
            return self._make_result(FOUND, rest, search, path=path, pieces=pieces)
        where = self._describe_extent()
        if not progress.exhausted:
            budget = self._settings.budget
            reason = f"no path within {where} was found in the budget of {budget:g} s; "
            return self._make_result(OUT_OF_TIME, f"{reason}there may be one", search)
        closed = find_closed_area(search)
        reason = f"no path within {where}: {closed.describe()}"
        return self._make_result(NO_WAY, reason, search, closed=closed)

    def _warn(self) -> str:
        """Return what is wrong with the lattice, in words."""
        cell, coarse = self._nodes.cell, COARSE * self._site.rover.wheelbase
        if cell <= coarse:
            return ""
        return (
            f"the lattice's cell of {cell:g} m is larger than {coarse:.2f} m, half the wheelbase: "
            "gaps between obstacles may lie between its places"
        )

    def _describe_rest(self, path: Candidate) -> str:
        """Return how far before a goal on unknown ground a path ends, in words."""
        if not self._to_frontier:
            return ""
        left = np.hypot(*(path.poses[-1] - self._goal)[:2])
        return f"the goal is beyond the known ground; the path ends {left:.1f} m before it"

    def _describe_extent(self) -> str:
        """Return what part of the map is searched, in words."""
        if not self._is_limited:
            return "the map"
        rows, columns = self._nodes.shape
        cell = self._nodes.cell
        return f"the {columns * cell:.0f} m x {rows * cell:.0f} m around start and goal"

    def _try_known_paths(self) -> None:
        """Take the last path between the same ends, or else the best direct one, if any passes.

        It is a first path, long before the lattice is prepared.
        """
        if not self._try_path(self._memory.recall_path(self._query)):
            for piece in self._make_direct_paths():
                self._try_path([piece])

    def _try_path(self, pieces: list[Piece]) -> bool:
        """Keep a path that passes if it is the best so far; return whether it passes."""
        if not pieces:
            return False
        path = self._judge.check(join_pieces(pieces)[0], stop_at_failure=True)
        if not path.verdict.traversable:
            return False
        priced = self._price(pieces, path)
        cost = sum(one.cost for one in priced)
        if cost < self.progress.cost:
            self.progress.keep(priced, path)
        return math.isfinite(cost)

    def _price(self, pieces: list[Piece], path: Candidate) -> list[Piece]:
        """Return the pieces of a path that passes with their costs."""
        if len(pieces) == 1:
            cost = cost_of_path(self._site.rover, pieces, path)
            return [replace(pieces[0], cost=cost)]
        new = [k for k, one in enumerate(pieces) if np.isnan(one.cost)]
        judged = self._judge.judge_pieces([pieces[k] for k in new])
        costs = dict(zip(new, (one.cost for one in judged), strict=True))
        return [replace(one, cost=costs.get(k, one.cost)) for k, one in enumerate(pieces)]

    def _make_direct_paths(self) -> list[Piece]:
        """Return the direct curve from start to goal, and turns on the spot if they are shorter.

        There is none if start and goal are the same.
        """
        found: list[Piece] = []
        ends, options = (self._start, self._goal), self._site.options.change(count=1)
        for gear, turns in ((Gear.FORWARD, False), (Gear.ON_THE_SPOT, True)):
            poses = generate_paths(self._site.rover, *ends, options, turns=turns)[0]
            if len(poses) > 1 and not (found and np.array_equal(poses, found[0].poses)):
                found.append(Piece(poses, gear))
        return found

    def _prepare(self) -> LatticeSearch:
        """Return the search, with estimates of the ground and the connections of the ends."""
        site, nodes = self._site, self._nodes
        rover, spacing = site.rover, site.options.waypoint_spacing
        edges = self._memory.recall_edges(site, nodes)
        climb = steepest_climb(rover, site.assumed_rover.friction)
        terrain = cut_out(site, nodes) if self._is_limited else site.terrain
        groundless = find_groundless(rover, terrain, nodes)
        edges.standing[groundless] = edges.state_of("unknown_ground")
        return LatticeSearch(
            self._judge,
            edges,
            connect_end(rover, nodes, self._start, spacing, is_goal=False),
            self._connect_goals(np.flatnonzero(~groundless)),
            estimate_difficulty(rover, terrain, nodes, climb, edges.primitives),
            self.progress,
        )

    def _connect_goals(self, known: NDArray[np.int64]) -> list[Connection]:
        """Return the connections of all goals; the way that is left from one has a price.

        A frontier is looked for among the nodes (n,) that may be on `known` ground.
        """
        if self._to_frontier:
            return connect_frontier(self._judge, self._nodes, known, self._start, self._goal)
        rover, spacing = self._site.rover, self._site.options.waypoint_spacing
        found = []
        for goal in self._goals:
            missed = MISSED_PRICE * float(np.hypot(*(goal - self._goal)[:2]))
            connections = connect_end(rover, self._nodes, goal, spacing, is_goal=True)
            found += [replace(one, surcharge=missed) for one in connections]
        return found

    def _tell_and_go_on(self, search: LatticeSearch) -> bool:
        """Tell of the progress of the search, and return whether it may go on."""
        if self._on_progress is not None:
            is_found = search.progress.best is not None
            self._on_progress(search.progress if is_found else self._earlier or search.progress)
        if self._settings.ends_at_first and search.progress.best is not None:
            return False
        budget = self._settings.budget
        work = self._judge.asked_poses + search.shortest.expanded / EXPANSIONS_PER_POSE
        if work > POSES_PER_SECOND * budget:
            return False
        in_time = time.perf_counter() - self._began < budget
        self._repeatable &= in_time
        return in_time

    def _smooth(self, progress: SearchProgress) -> tuple[Candidate, list[Piece]]:
        """Return the smoothed path, or the path itself where that does not pass; its pieces."""
        best, budget = progress.best, self._settings.budget
        assert best is not None
        spent = time.perf_counter() - self._began
        share = SMOOTHING if self._repeatable else SMOOTHING * min(1.0, budget / spent)
        most = round(share * budget * POSES_PER_SECOND)
        pieces = smooth(self._judge, progress.pieces, most)
        smoothed = self._judge.check(join_pieces(pieces)[0], stop_at_failure=True)
        if not smoothed.verdict.traversable:
            smoothed, pieces = best, progress.pieces
        if self._to_goal:
            self._memory.keep_path(self._query, pieces)
        return smoothed, pieces

    def _make_result(
        self,
        outcome: str,
        reason: str,
        search: LatticeSearch | None = None,
        path: Candidate | None = None,
        pieces: Sequence[Piece] = (),
        closed: ClosedArea | None = None,
    ) -> SearchResult:
        progress = self.progress
        is_bounded = progress.best is not None and progress.least_cost > 0.0
        return SearchResult(
            outcome=outcome,
            reason=reason,
            path=path,
            pieces=pieces,
            suboptimality=progress.cost / progress.least_cost if is_bounded else math.inf,
            expanded=0 if search is None else search.shortest.expanded,
            edges_judged=progress.judged,
            edges=0 if search is None else search.edges.count,
            seconds_first=progress.first_time - self._began,
            seconds=time.perf_counter() - self._began,
            repeatable=self._repeatable,
            nodes=self._nodes,
            closed=closed,
            warning=self._warn(),
        )


def _check_end(name: str, end: ArrayLike, terrain: Terrain | None) -> Pose:
    """Return the start or the goal (3,), checked; it must be on the terrain if there is one."""
    pose = check_pose(name, end)
    if terrain is not None and not terrain.contains(pose[0], pose[1]):
        xmin, xmax, ymin, ymax = terrain.bounds
        raise PlanningError(
            f"{name} is at ({pose[0]:.10g}, {pose[1]:.10g}), off the map, which goes from "
            f"x {xmin:.10g} to {xmax:.10g} and y {ymin:.10g} to {ymax:.10g} m"
        )
    return pose


def smooth(judge: PathJudge, pieces: list[Piece], most_poses: int) -> list[Piece]:
    """Return the pieces of a path that leads along fewer, wider curves and costs less.

    Args:
        judge: The model, which judges each new curve.
        pieces: The path.
        most_poses: Number of poses that the model may be asked about.
    """
    allowed = judge.asked_poses + most_poses
    for span in SPANS:
        first = 0
        while first + span <= len(pieces) and judge.asked_poses < allowed:
            check_interruption()
            found = _find_shortcut(judge, pieces[first : first + span])
            if found is not None:
                pieces = [*pieces[:first], found, *pieces[first + span :]]
                first += 1
            else:
                first += max(1, span // 2)
    return pieces


def _find_shortcut(judge: PathJudge, old: list[Piece]) -> Piece | None:
    """Return one curve driven forwards that costs less than some pieces; None if none does."""
    start, end = old[0].poses[0], old[-1].poses[-1]
    radius, spacing = tightest_radius(judge.site.rover), judge.site.options.waypoint_spacing
    surcharge = sum(one.surcharge for one in old)
    cost = (sum(one.cost for one in old) - surcharge) * (1.0 - GAIN)
    for scale in RADII:
        poses = shortest_dubins_path(start, end, scale * radius, spacing)
        if path_length(poses) >= cost:
            continue
        curve = Piece(poses, Gear.FORWARD)
        judged = judge.judge_pieces([curve])[0]
        if judged.cost < cost:
            return replace(curve, cost=judged.cost + surcharge, surcharge=surcharge)
    return None
