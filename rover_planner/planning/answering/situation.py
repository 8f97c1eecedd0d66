# SPDX-License-Identifier: Apache-2.0
"""All that a traverse server knows when a question is asked, and the answers from it."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_physics.results.path_prediction import PathPrediction
from rover_physics.terrain.grid import Terrain
from rover_planner.errors import PlanningError
from rover_planner.maps.known_map import KnownMap
from rover_planner.maps.unobserved_ground import ALLOW
from rover_planner.maps.unobserved_ground import CODE as BLIND
from rover_planner.parameters.traverse_server import FAN, LATTICE
from rover_planner.planning.answering.judgement import Judgement, refusal
from rover_planner.planning.answering.search_watch import SearchWatch
from rover_planner.planning.answering.service_settings import ServiceSettings
from rover_planner.planning.answering.suspension_check import compare_suspension
from rover_planner.planning.lattice.blind_check import BlindCheck, physical
from rover_planner.planning.lattice.search import Progress
from rover_planner.planning.path_geometry import densify
from rover_planner.planning.path_planner import PathPlanner, PathSearch, Pose, add_way
from rover_planner.planning.path_query import Candidate
from rover_planner.planning.verdict_report import SuspensionReport
from rover_planner.planning.ways.memory import EdgeMemory
from rover_planner.planning.ways.question import WayQuestion
from rover_planner.planning.ways.way_search import GOAL_REFUSED, START_REFUSED, find_way

NO_PATH = "no path was received yet; publish one on ~/path"


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


@dataclass(frozen=True, eq=False)
class Situation:
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
    """Why the map is too old to be used; empty if it is not."""

    edge_memory: EdgeMemory = field(default_factory=EdgeMemory)
    """What earlier searches have found of the ground; grows with each search."""
    watch: SearchWatch | None = None
    """Watches searches for a way."""

    @property
    def terrain(self) -> Terrain | None:
        """The map to plan on; None if there is none."""
        return None if self.known_map is None else self.known_map.terrain

    def answer(self, start: ArrayLike, goal: ArrayLike, tolerance: float = 0.0) -> Judgement:
        """Find a path from start to goal, or the reason why there is none.

        Args:
            start: (3,) x, y [m], yaw [rad] of the body origin, map frame.
            goal: (3,) x, y [m], yaw [rad] of the body origin, map frame.
            tolerance: Largest distance from the goal's position [m] at which the path may end
                if the goal cannot be reached; the heading stays. 0 tries the goal only.

        Raises:
            PlanningError: The request is invalid.
            RoverError: The model refuses the request.
            NewerMapError: The map has changed while a way was searched, see `SearchWatch`.
        """
        if not (math.isfinite(tolerance) and tolerance >= 0.0):
            raise PlanningError(f"tolerance is {tolerance}; it must be a distance of at least 0 m")

        refused = self.refuse_map()
        if refused is not None:
            return refused
        ends = np.asarray(start, np.float64), np.asarray(goal, np.float64)
        if self.settings.planner == LATTICE:
            return self._search_way(ends, None)
        planner = self._planner()
        search = planner.search(*ends, tolerance)
        suspension = self._compare_suspension(planner.predict_standing)
        search = self._blind.choose(search)
        judged = _judgement(planner, search.answer.chosen, self._blind, suspension, search)
        are_on_map = all(planner.terrain.contains(*end[:2]) for end in ends)
        starts_blind = judged.code == BLIND and search.answer.chosen.verdict.first_failure == 0
        is_final = judged.traversable or starts_blind or not are_on_map
        if is_final or self.settings.planner == FAN:
            return judged
        return self._search_way(ends, judged)

    def _search_way(self, ends: tuple[Pose, Pose], refused: Judgement | None) -> Judgement:
        """Search a way around obstacles.

        Args:
            ends: Start and goal.
            refused: The judgement on the candidates; None if none were tried.
        """
        planner = self._planner()
        question = WayQuestion(
            planner.rover,
            planner.terrain,
            *ends,
            planner.options,
            self._blind if self.settings.blind_ground != ALLOW else None,
        )
        answer = find_way(question, self.settings.lattice, self.edge_memory, self._look)
        if answer.path is not None:
            candidates = None if refused is None else refused.search
            way = answer.path
            search = add_way(candidates, way, ends[1])
            suspension = self._compare_suspension(planner.predict_standing)
            return replace(_judgement(planner, way, self._blind, suspension, search), way=answer)
        if answer.outcome in (START_REFUSED, GOAL_REFUSED) and refused is not None:
            reason = f"{answer.reason}; the best candidate: {refused.reason}"
            return replace(refused, reason=reason, way=answer)
        why = "; ".join(filter(None, (answer.reason, answer.warning)))
        if refused is None:
            return replace(refusal(answer.outcome, why), way=answer)
        reason = f"{why}; the best candidate: {refused.reason}"
        return replace(refused, code=answer.outcome, reason=reason, way=answer)

    def _look(self, progress: Progress) -> None:
        """Let the watch look at a search."""
        if self.watch is not None and self.known_map is not None:
            self.watch.look(self.known_map, progress)

    def check_path(self) -> Judgement:
        """Judge the last path.

        Raises:
            PlanningError: The path is too long.
            RoverError: The model refuses the path.
        """
        missing = self.refuse_if_missing()
        if missing is not None:
            return missing
        assert self.path.poses is not None
        planner = self._planner()
        poses = densify(self.path.poses, self.settings.query.waypoint_spacing)
        candidate = self._blind.hold(planner.check(poses))
        suspension = self._compare_suspension(planner.predict_standing)
        return _judgement(planner, candidate, self._blind, suspension)

    def refuse_if_missing(self) -> Judgement | None:
        """Return a refusal if there is no path or no map to use, else None."""
        if self.path.poses is None:
            return refusal("no_path", self.path.refusal)
        return self.refuse_map()

    def refuse_map(self) -> Judgement | None:
        """Return a refusal if there is no map, or if it is too old, else None."""
        if self.known_map is None:
            return refusal(
                "no_map",
                "no map was received yet; publish one on elevation_cloud or call ~/load_map",
            )
        return refusal("stale_map", self.stale_map) if self.stale_map else None

    @property
    def _blind(self) -> BlindCheck:
        """Holds paths against what was seen of the map."""
        assert self.known_map is not None
        return BlindCheck(self.settings.rover, self.known_map.seen, self.settings.blind_ground)

    def compare_standing(self) -> SuspensionReport | None:
        """Compare measured and predicted suspension where the rover stands, if that is known.

        Raises:
            RoverError: The model refuses a setting.
        """
        if self.known_map is None:
            return None
        return self._compare_suspension(self._planner().predict_standing)

    def _planner(self) -> PathPlanner:
        """Return a planner for the map, the settings and the measured arm angles."""
        assert self.terrain is not None
        options = self.settings.query.change(joint_angles=self._manipulator_angles())
        return PathPlanner(self.settings.rover, self.terrain, options)

    def _compare_suspension(
        self, predict: Callable[[NDArray[np.float64]], PathPrediction]
    ) -> SuspensionReport | None:
        """Compare measured and predicted suspension where the rover stands, if that is known."""
        if self.measured_pose is None:
            return None
        tolerance = self.settings.suspension_tolerance
        return compare_suspension(predict(self.measured_pose), self.joints, tolerance)

    def _manipulator_angles(self) -> dict[str, float] | None:
        """Return the measured manipulator angles [rad], None (stowed) until all are known."""
        names = self.settings.manipulator_joints
        if not names or any(name not in self.joints for name in names):
            return None
        return {name: self.joints[name] for name in names}


def _judgement(
    planner: PathPlanner,
    candidate: Candidate,
    blind: BlindCheck,
    suspension: SuspensionReport | None,
    search: PathSearch | None = None,
) -> Judgement:
    """Return the judgement of a judged path; classes and the rest of it follow on demand."""

    def judge_rest() -> Judgement:
        return _judgement(planner, planner.check(candidate.poses), blind, suspension, search)

    return Judgement(
        candidate.verdict.code,
        candidate.verdict.reason,
        candidate,
        partial(planner.classify, physical(candidate)),
        suspension,
        search,
        find_ground=partial(blind.report, candidate),
        judge_rest=None if candidate.is_complete else judge_rest,
    )
