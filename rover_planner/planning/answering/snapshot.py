# SPDX-License-Identifier: Apache-2.0
"""All that a traverse server knows when a question is asked, and the answers from it."""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_physics.names import SUSPENSION_JOINTS
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_poses
from rover_planner.errors import PlanningError
from rover_planner.maps.known_map import KnownMap
from rover_planner.maps.unobserved_ground import UNOBSERVED_CODE
from rover_planner.parameters.traverse_server import FAN, LATTICE
from rover_planner.planning.answering.judgement import PathJudgement, SuspensionReport, refusal
from rover_planner.planning.answering.service_settings import ServiceSettings
from rover_planner.planning.learned_ground import LearnedGround
from rover_planner.planning.marked_places import NONE_MARKED, MarkedPlaces
from rover_planner.planning.path_geometry import densify
from rover_planner.planning.path_query import Candidate, PathAnswer, add_path
from rover_planner.planning.search.edge_memory import EdgeMemory
from rover_planner.planning.search.judge import PathJudge
from rover_planner.planning.search.lattice_search import SearchProgress
from rover_planner.planning.search.path_search import GOAL_REFUSED, START_REFUSED, find_path
from rover_planner.planning.search.query import SearchQuery, Site

NO_PATH = "no path was received yet; publish one on ~/path"
REPORT_PERIOD = 0.2
"""Least time between two reports of a search [s]."""


class NewerMapError(Exception):
    """The map has changed while a path was searched on it."""


class SearchWatch:
    """Watches the searches of one question.

    The question is to be answered again after a NewerMapError: what is known of unchanged ground
    is remembered. After `patience` a changed map no longer ends the search, so that maps that
    change all the time do not keep the question from its answer.
    """

    def __init__(
        self,
        newest_map: Callable[[], KnownMap | None],
        send_report: Callable[[dict[str, Any]], object],
        patience: float,
    ):
        """Watch the searches of a question.

        Args:
            newest_map: Returns the newest map.
            send_report: Takes a report, in the thread of the search: True if a path is `found`,
                its `cost` (infinite without one) and the `bound` from below on that of any path of
                the lattice (0 while it is not known) in metres of level ground, the number of
                `edges_judged`, and the `seconds` since the question's first search began.
            patience: Time from the first search on in which a changed map ends a search [s].
        """
        self._newest_map, self._send_report, self._patience = newest_map, send_report, patience
        self._began: float | None = None
        self._sent_at = 0.0

    def look(self, searched: KnownMap, progress: SearchProgress) -> None:
        """Report how far the search on a map is.

        Raises:
            NewerMapError: The map has changed.
        """
        now = time.monotonic()
        if self._began is None:
            self._began = now
        seconds = now - self._began
        if now - self._sent_at >= REPORT_PERIOD:
            self._sent_at = now
            self._send_report(
                {
                    "found": progress.best is not None,
                    "cost": progress.cost,
                    "bound": progress.least_cost,
                    "edges_judged": progress.judged,
                    "seconds": seconds,
                }
            )
        newest = self._newest_map()
        has_changed = newest is not None and newest.fingerprint != searched.fingerprint
        if has_changed and seconds < self._patience:
            raise NewerMapError("the map has changed while a path was searched on it")


@dataclass(frozen=True, eq=False)
class GivenPath:
    """The path of the topic ~/path, or the reason why it was refused."""

    poses: NDArray[np.float64] | None = None
    """(n, 3) x, y [m] and yaw [rad], map frame; None if there is none or it was refused."""
    refusal: str = NO_PATH
    """Reason why there is none."""
    hash: str = ""
    """`msg_adapters.identity.path_hash` of the message."""
    stamp: str = ""
    """Stamp of the message, "seconds.nanoseconds"."""
    code: str = "no_path"
    """Code of the refusal."""

    def judge(self, snapshot: "Snapshot") -> PathJudgement:
        """Judge whether the rover can drive it; errors are those of `Snapshot.check_path`."""
        if self.poses is None:
            return refusal(self.code, self.refusal)
        return snapshot.check_path(self.poses).complete()


@dataclass(frozen=True, eq=False)
class Snapshot:
    """Settings, map, path and measurements at one time; answers do not change with later ones."""

    settings: ServiceSettings
    """The settings."""
    path: GivenPath = field(default_factory=GivenPath)
    """The last path."""
    joints: Mapping[str, float] = field(default_factory=dict)
    """Measured joint angles [rad] by name."""
    known_map: KnownMap | None = None
    """The map; None before the first one."""
    map_age: float = math.nan
    """Age of the map [s]; NaN without map."""
    measured_pose: NDArray[np.float64] | None = None
    """(3,) x, y [m] and yaw [rad] of the body, map frame, measured just now together with the
    suspension; None if it is not known."""
    stale_map: str = ""
    """Reason why the map is too old to be used; empty if it is not."""
    ground: LearnedGround | None = None
    """The learned ground; the settings assume it if they are to."""
    class_friction: Mapping[int, float] = field(default_factory=dict)
    """Friction that is assumed on the classes of ground of the map, if the learned ground is."""
    marked: MarkedPlaces = NONE_MARKED
    """Places that are impassable."""

    edge_memory: EdgeMemory = field(default_factory=EdgeMemory)
    """Edges that earlier searches have judged; grows with each search."""
    watch: SearchWatch | None = None
    """Watches searches around obstacles."""

    @property
    def terrain(self) -> Terrain | None:
        """The map to plan on; None if there is none."""
        return None if self.known_map is None else self.known_map.terrain

    def answer(self, start: ArrayLike, goal: ArrayLike, tolerance: float = 0.0) -> PathJudgement:
        """Find a path from start to goal, or the reason why there is none.

        Args:
            start: (3,) x, y [m], yaw [rad] of the body origin, map frame.
            goal: (3,) x, y [m], yaw [rad] of the body origin, map frame.
            tolerance: Largest distance from the goal's position [m] at which the path may end
                if the goal cannot be reached; the heading stays. 0 tries the goal only.

        Raises:
            PlanningError: The request is invalid.
            RoverError: The model refuses the request.
            NewerMapError: The map has changed while a path was searched, see `SearchWatch`.
        """
        if not (math.isfinite(tolerance) and tolerance >= 0.0):
            raise PlanningError(f"tolerance is {tolerance}; it must be a distance of at least 0 m")

        refused = self.refuse_map()
        if refused is not None:
            return refused
        site, ends = self._site(), (np.asarray(start, float), np.asarray(goal, float))
        query = SearchQuery(site, *ends, tolerance)
        start_is_on_map, goal_is_on_map = (site.terrain.contains(*end[:2]) for end in ends)
        are_on_map = start_is_on_map and goal_is_on_map
        may_search = are_on_map or (start_is_on_map and self.settings.lattice.frontier)
        planner = self.settings.parameters.planner
        if planner == LATTICE:
            if may_search:
                return self._search_around(query, None)
            tolerance = 0.0
        if not (are_on_map or tolerance):  # no candidate helps: one tells as much as all
            site = replace(site, options=site.options.change(count=1))
        search = PathJudge(site).search(*ends, tolerance)
        judged = self._describe(site, search.chosen, search)
        if not are_on_map and not judged.traversable:
            judged = replace(judged, is_brief=True)  # of what lies off the map nothing is told
        starts_unobserved = (
            judged.code == UNOBSERVED_CODE and search.chosen.verdict.first_failure == 0
        )
        is_final = judged.traversable or starts_unobserved or not may_search
        if is_final or planner == FAN:
            return judged
        return self._search_around(query, judged)

    def _search_around(self, query: SearchQuery, refused: PathJudgement | None) -> PathJudgement:
        """Search a path around obstacles.

        Args:
            query: The query.
            refused: The judgement on the candidates; None if none were tried.
        """
        assert self.known_map is not None
        look = None if self.watch is None else partial(self.watch.look, self.known_map)
        found = find_path(query, self.settings.lattice, self.edge_memory, look)
        if found.path is not None:
            before = None if refused is None else refused.search
            search = add_path(before, found.path, np.asarray(query.goal))
            return replace(self._describe(query.site, found.path, search), around=found)
        is_end = found.outcome in (START_REFUSED, GOAL_REFUSED)
        warning = found.warning if refused is None or not is_end else ""
        why = "; ".join(filter(None, (found.reason, warning)))
        if refused is None:
            return replace(refusal(found.outcome, why), around=found)
        code = refused.code if is_end else found.outcome
        reason = f"{why}; the best candidate: {refused.reason}"
        return replace(refused, code=code, reason=reason, around=found)

    def check_path(
        self, poses: NDArray[np.float64], *, stop_at_failure: bool = False
    ) -> PathJudgement:
        """Judge a path of poses (n, 3), if wanted only up to its first failure.

        Raises:
            PlanningError: The path is too long.
            RoverError: The model refuses the path.
        """
        refused = self.refuse_map()
        if refused is not None:
            return refused
        site = self._site()
        waypoints, _ = densify(poses, site.options.waypoint_spacing)
        path = PathJudge(site).check(waypoints, stop_at_failure=stop_at_failure)
        return self._describe(site, path)

    def refuse_map(self) -> PathJudgement | None:
        """Return a refusal if there is no map, or if it is too old, else None."""
        if self.known_map is None:
            return refusal(
                "no_map",
                "no map was received yet; publish one on elevation_cloud or call ~/load_map",
            )
        return refusal("stale_map", self.stale_map) if self.stale_map else None

    def compare_standing(self) -> SuspensionReport | None:
        """Compare measured and predicted suspension where the rover stands.

        None: it is not known where that is, nothing was measured, or the rover does not settle.

        Raises:
            RoverError: The model refuses a setting.
        """
        if self.known_map is None or self.measured_pose is None:
            return None
        site, pose = self._site(), self.measured_pose[None, :]
        options = site.options.model
        prediction, _ = judge_poses(site.rover, site.terrain, pose, None, options, sigmas=0)
        predicted = (*prediction.rocker_angle[0].tolist(), *prediction.bogie_angle[0].tolist())
        mismatch = {
            name: self.joints[name] - angle
            for name, angle in zip(SUSPENSION_JOINTS, predicted, strict=True)
            if name in self.joints
        }
        if not mismatch or not prediction.settled[0]:
            return None
        largest = max(abs(difference) for difference in mismatch.values())
        return SuspensionReport(mismatch, largest <= self.settings.parameters.suspension_tolerance)

    def _site(self) -> Site:
        """Return the rover on the map, with the settings and the measured arm angles."""
        assert self.known_map is not None
        settings, names = self.settings, self.settings.manipulator_joints
        known = {name: self.joints[name] for name in names if name in self.joints}
        is_stowed = not names or len(known) < len(names)  # until all are known
        options = settings.query.change(joint_angles=None if is_stowed else known)
        rule = settings.parameters.blind_ground
        ground, seen = self.known_map.terrain, self.known_map.seen
        return Site(settings.rover, ground, options, seen, rule, self.marked)

    def _describe(
        self, site: Site, candidate: Candidate, search: PathAnswer | None = None
    ) -> PathJudgement:
        """Return the judgement of a judged path; classes and the rest of it follow on demand."""
        code, reason = candidate.verdict.code, candidate.verdict.reason
        return PathJudgement(code, reason, candidate, site, self.compare_standing(), search)
