# SPDX-License-Identifier: Apache-2.0
"""Searches a way between two poses, smooths it, and explains where there is none."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_physics.rover.steering_joints import tightest_radius
from rover_planner.errors import PlanningError
from rover_planner.planning.angles import wrap
from rover_planner.planning.candidates import generate_candidates
from rover_planner.planning.lattice.connections import Connection, connect_goal, connect_start
from rover_planner.planning.lattice.difficulty import estimate_difficulty, steepest_climb
from rover_planner.planning.lattice.edges import UNJUDGED
from rover_planner.planning.lattice.ground_estimate import estimate_ground
from rover_planner.planning.lattice.headings import HEADINGS
from rover_planner.planning.lattice.judge import Judge
from rover_planner.planning.lattice.nodes import Nodes
from rover_planner.planning.lattice.primitives import Gear
from rover_planner.planning.lattice.search import LatticeSearch, Progress, Stretch, join_pieces
from rover_planner.planning.path_query import Candidate
from rover_planner.planning.ways.frontier import connect_frontier
from rover_planner.planning.ways.memory import EdgeMemory
from rover_planner.planning.ways.no_way import ClosedArea, find_closed_area
from rover_planner.planning.ways.question import WayQuestion
from rover_planner.planning.ways.smoothing import smooth
from rover_planner.planning.ways.window import choose_window, cut_out

FOUND, NO_WAY, OUT_OF_TIME = "found", "no_way", "out_of_time"
BEYOND = ("unknown_ground", "off_map")
"""Codes of goals that lie beyond the frontier of the known ground."""
START_REFUSED, GOAL_REFUSED = "start_refused", "goal_refused"
"""Outcomes of a search."""

POSES_PER_SECOND = 20_000
"""Poses that the model may be asked about per second of the budget."""
EXPANSIONS_PER_POSE = 40
"""Expanded nodes that count as much as one pose."""
COARSE = 0.5
"""Distance of neighbouring nodes above which obstacles are finer than the lattice [wheelbases]."""
SMOOTHING = 0.2
"""Share of the budget for smoothing."""


@dataclass(frozen=True)
class LatticeSettings:
    """How a way is searched."""

    budget: float = 2.0
    """Time for the search [s]."""
    cell: float | None = None
    """Distance of neighbouring nodes [m]; None: a quarter of the wheelbase."""
    frontier: bool = False
    """Whether a way may end at the frontier of the known ground, as near as possible to a goal
    beyond it."""
    ends_at_first: bool = False
    """Whether the first way is the answer; else better ones are searched for the whole budget."""

    def __post_init__(self) -> None:
        for name in ("budget", "cell"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise PlanningError(f"{name} is {value}; it must be a finite number above 0")


@dataclass(frozen=True, eq=False)
class WayAnswer:
    """The way that was found, or why there is none."""

    outcome: str
    """FOUND, NO_WAY, OUT_OF_TIME, START_REFUSED or GOAL_REFUSED."""
    reason: str
    """One sentence for people."""
    path: Candidate | None
    """The way with prediction and verdict; None unless it was found."""
    cost: float
    """Its cost [m of level ground]; infinite without a way."""
    bound: float
    """How much more it cost before smoothing, at most, than the best path of the lattice, as a
    factor; infinite if that is not known."""
    expanded: int
    """Number of expanded nodes."""
    edges_judged: int
    """Number of edges that the model has judged."""
    edges: int
    """Number of edges of the lattice."""
    seconds_first: float
    """Time until the first way was known [s], NaN without one."""
    seconds: float
    """Time of the whole search [s]."""
    repeatable: bool
    """Whether the same question gives the same answer to the bit: the clock did not end it."""
    nodes: Nodes
    """The nodes of the lattice."""
    closed: ClosedArea | None
    """What is closed in where no way exists; else None."""
    warning: str
    """What may have hidden a way, such as a coarse lattice; empty if nothing has."""
    asked: NDArray[np.bool_]
    """(rows, columns) True for the places where the model was asked whether the rover can stand,
    in this search or in an earlier one that the memory holds; row 0 at the smallest y."""


def find_way(
    question: WayQuestion,
    settings: LatticeSettings | None = None,
    memory: EdgeMemory | None = None,
    on_progress: Callable[[Progress], None] | None = None,
) -> WayAnswer:
    """Search a way from start to goal.

    Args:
        question: What is asked.
        settings: How it is searched.
        memory: What earlier searches have found; None begins anew.
        on_progress: Called after each step of the search with what is known so far.

    Raises:
        PlanningError: Start or goal are not finite or not on the map.
        RoverError: The model refuses an option.
    """
    return _WaySearch(question, settings or LatticeSettings(), memory, on_progress).answer()


class _WaySearch:
    """One search with all that belongs to it."""

    def __init__(
        self,
        question: WayQuestion,
        settings: LatticeSettings,
        memory: EdgeMemory | None,
        on_progress: Callable[[Progress], None] | None,
    ):
        self._began = time.perf_counter()
        self._question, self._settings, self._on_progress = question, settings, on_progress
        self._start = _check_end("start", question, may_be_off_map=False)
        self._goal = _check_end("goal", question, may_be_off_map=settings.frontier)
        self._judge = Judge(
            question.rover,
            question.terrain,
            question.options,
            question.blind,
        )
        cell = settings.cell or 0.25 * question.rover.wheelbase
        self._nodes, self._is_limited = choose_window(question, cell)
        self._memory = memory or EdgeMemory()
        self._repeatable, self._to_frontier = True, False

    def answer(self) -> WayAnswer:
        """Search the way."""
        for name, outcome, pose in (
            ("start", START_REFUSED, self._start),
            ("goal", GOAL_REFUSED, self._goal),
        ):
            code, reason = self._judge.refuse(pose)
            is_frontier = self._settings.frontier and outcome == GOAL_REFUSED
            self._to_frontier = is_frontier and code in BEYOND
            if code and not self._to_frontier:
                return self._answer(outcome, f"the rover cannot stand at the {name}: {reason}")
        search = self._prepare()
        if not self._to_frontier:
            self._try_directly(search)
        progress = search.run(self._allowed)
        if progress.best is not None:
            way = self._smooth(search)
            return self._answer(FOUND, self._describe_rest(way[0]), search, way=way)
        where = self._describe_extent()
        if not progress.exhausted:
            budget = self._settings.budget
            reason = f"no way within {where} was found in the budget of {budget:g} s; "
            return self._answer(OUT_OF_TIME, f"{reason}there may be one", search)
        closed = find_closed_area(search)
        reason = f"no way within {where}: {closed.describe()}"
        return self._answer(NO_WAY, reason, search, closed=closed)

    def _warn(self) -> str:
        """Return what is wrong with the lattice, in words."""
        cell, coarse = self._nodes.cell, COARSE * self._question.rover.wheelbase
        if cell <= coarse:
            return ""
        return (
            f"the lattice's cell of {cell:g} m is larger than {coarse:.2f} m, half the wheelbase: "
            "gaps between obstacles may lie between its places"
        )

    def _describe_rest(self, path: Candidate) -> str:
        """Return how far before a goal on unknown ground a way ends, in words."""
        left = np.hypot(*(path.poses[-1] - self._goal)[:2])
        if not self._to_frontier:
            return ""
        return f"the goal is beyond the known ground; the way ends {left:.1f} m before it"

    def _describe_extent(self) -> str:
        """Return what part of the map is searched, in words."""
        if not self._is_limited:
            return "the map"
        rows, columns = self._nodes.shape
        cell = self._nodes.cell
        return f"the {columns * cell:.0f} m x {rows * cell:.0f} m around start and goal"

    def _prepare(self) -> LatticeSearch:
        """Return the search, with the estimates of the ground and the connections of the ends."""
        question, nodes = self._question, self._nodes
        spacing = question.options.waypoint_spacing
        known = self._memory.recall(question, nodes)
        friction = question.options.model.friction or question.rover.friction
        climb = steepest_climb(question.rover, friction)
        terrain = cut_out(question, nodes)
        ground = estimate_ground(question.rover, terrain, nodes)
        lists = known.edges.samples, known.difficulty
        known.standing[ground.groundless] = known.state_of("unknown_ground")
        self._groundless = ground.groundless
        return LatticeSearch(
            self._judge,
            known,
            connect_start(question.rover, nodes, self._start, spacing),
            self._connect_goal(),
            ground.doubt,
            estimate_difficulty(question.rover, terrain, nodes, climb, lists),
        )

    def _connect_goal(self) -> list[Connection]:
        """Return the connections to the goal, or the places where a way to it may end."""
        rover, spacing = self._question.rover, self._question.options.waypoint_spacing
        if self._to_frontier:
            return connect_frontier(self._judge, self._nodes, self._goal)
        return connect_goal(rover, self._nodes, self._goal, spacing)

    def _try_directly(self, search: LatticeSearch) -> None:
        """Let the search begin with the direct curve, if the rover may drive it."""
        poses = generate_candidates(
            self._start,
            self._goal,
            count=1,
            waypoint_spacing=self._question.options.waypoint_spacing,
            min_radius=tightest_radius(self._question.rover),
        )[0]
        if len(poses) > 1:
            search.offer(Stretch(poses, Gear.FORWARD))

    def _allowed(self, search: LatticeSearch) -> bool:
        """Return whether the search may go on; tell of its progress."""
        if self._on_progress is not None:
            self._on_progress(search.progress)
        if self._settings.ends_at_first and search.progress.best is not None:
            return False
        budget = self._settings.budget
        work = self._judge.poses + search.shortest.expanded / EXPANSIONS_PER_POSE
        if work > POSES_PER_SECOND * budget:
            return False
        in_time = time.perf_counter() - self._began < budget
        self._repeatable &= in_time
        return in_time

    def _smooth(self, search: LatticeSearch) -> tuple[Candidate, float]:
        """Return the smoothed path, or the path itself where that does not pass, and its cost."""
        best, budget = search.progress.best, self._settings.budget
        assert best is not None
        spent = time.perf_counter() - self._began
        share = SMOOTHING if self._repeatable else SMOOTHING * min(1.0, budget / spent)
        most = round(share * budget * POSES_PER_SECOND)
        radius = tightest_radius(self._question.rover)
        stretches = smooth(self._judge, search.progress.stretches, radius, most)
        poses, _ = join_pieces([one.poses for one in stretches])
        smoothed = self._judge.check(poses)
        if not smoothed.verdict.traversable:
            return best, search.progress.cost
        return smoothed, sum(one.cost for one in stretches)

    def _answer(
        self,
        outcome: str,
        reason: str,
        search: LatticeSearch | None = None,
        way: tuple[Candidate | None, float] = (None, math.inf),
        closed: ClosedArea | None = None,
    ) -> WayAnswer:
        progress = Progress() if search is None else search.progress
        asked = np.zeros(self._nodes.shape, bool) if search is None else self._asked(search)
        known = progress.best is not None and progress.bound > 0.0
        bound = progress.cost / progress.bound if known else math.inf
        return WayAnswer(
            outcome=outcome,
            reason=reason,
            path=way[0],
            cost=way[1],
            bound=bound,
            expanded=0 if search is None else search.shortest.expanded,
            edges_judged=progress.judged,
            edges=0 if search is None else search.known.edges.count,
            seconds_first=progress.first_time - self._began,
            seconds=time.perf_counter() - self._began,
            repeatable=self._repeatable,
            nodes=self._nodes,
            closed=closed,
            warning=self._warn(),
            asked=asked,
        )

    def _asked(self, search: LatticeSearch) -> NDArray[np.bool_]:
        """Return the places (rows, columns) where the model was asked about a node."""
        was_asked = (search.known.standing != UNJUDGED) & ~self._groundless
        return np.asarray(was_asked.reshape(*self._nodes.shape, HEADINGS).any(axis=2))


def _check_end(name: str, question: WayQuestion, *, may_be_off_map: bool) -> NDArray[np.float64]:
    """Return the start or the goal (3,), checked."""
    pose = np.array(getattr(question, name), dtype=float)
    if pose.shape != (3,) or not np.isfinite(pose).all():
        raise PlanningError(
            f"{name} is {pose.tolist()}; it must be three finite numbers x, y, yaw"
        )
    if not (may_be_off_map or question.terrain.contains(pose[0], pose[1])):
        xmin, xmax, ymin, ymax = question.terrain.bounds
        raise PlanningError(
            f"{name} is at ({pose[0]:g}, {pose[1]:g}), off the map, which goes from x {xmin:g} to "
            f"{xmax:g} and y {ymin:g} to {ymax:g} m"
        )
    pose[2] = wrap(pose[2])
    return pose
