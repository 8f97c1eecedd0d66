# SPDX-License-Identifier: Apache-2.0
"""Plans and checks paths of a rover on a map; tries other goals near an unreachable one."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_physics.results.path_prediction import PathPrediction
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.classification import ClassifiedWaypoint, classify_judged
from rover_physics.traversability.judge import judge_poses
from rover_planner.planning.path_geometry import rings_within
from rover_planner.planning.path_query import (
    Candidate,
    PathAnswer,
    PathQueryOptions,
    answer_path_query,
    check_path,
)

Pose = NDArray[np.float64]
"""(3,) x, y [m] and yaw [rad] of the body origin, map frame."""
_QUERIES_PER_RING = 4


@dataclass(frozen=True, eq=False)
class PathSearch:
    """The answer to a query and the goal of its paths."""

    answer: PathAnswer
    """The candidate paths to the goal."""
    asked_goal: Pose
    """The requested goal."""
    goal: Pose
    """The goal of the candidates: the requested one or another one near it."""
    alternatives_tried: int
    """Number of other goals that were tried."""

    @property
    def goal_offset(self) -> float:
        """Distance between `goal` and the requested goal [m]."""
        return float(np.hypot(*(self.goal - self.asked_goal)[:2]))


def add_way(search: PathSearch | None, way: Candidate, goal: Pose) -> PathSearch:
    """Return the search with a traversable way as the chosen one, after its own candidates.

    The way may end elsewhere than at the requested `goal`.
    """
    candidates = (way,) if search is None else (*search.answer.candidates, way)
    last = len(candidates) - 1
    tried = 0 if search is None else search.alternatives_tried
    return PathSearch(PathAnswer(candidates, last, last), goal, way.poses[-1], tried)


@dataclass(frozen=True, eq=False)
class PathPlanner:
    """Finds, checks and classifies paths for one rover, map and arm configuration."""

    rover: Rover
    """The rover."""
    terrain: Terrain
    """The ground, map frame."""
    options: PathQueryOptions
    """How candidates are made and judged."""

    def search(self, start: Pose, goal: Pose, tolerance: float = 0.0) -> PathSearch:
        """Find a path from start to goal, or to a goal near it.

        Args:
            start: Start of the path.
            goal: End of the path.
            tolerance: Largest distance from the goal's position [m] at which the path may end
                if the goal cannot be reached; the heading stays. 0 tries the goal only.

        Returns:
            The answer for the goal, or for the first alternative goal that can be reached.

        Raises:
            PlanningError: Start, goal or options are invalid.
            RoverError: The model refuses an option or the poses.
        """
        answer, tried = self._query(start, goal), 0
        if not answer.traversable and self._fails_at(answer, goal, tolerance):
            for alternative in self._goals_to_stand_on(start, goal, tolerance):
                tried += 1
                other = self._query(start, alternative)
                if other.traversable:
                    return PathSearch(other, goal, alternative, tried)
        return PathSearch(answer, goal, goal, tried)

    def _fails_at(self, answer: PathAnswer, goal: Pose, tolerance: float) -> bool:
        """Return whether another goal within `tolerance` [m] may help.

        It may if some path fails where the ground under the rover is also ground under a rover
        at an allowed goal. Other paths fail on the way, which leads to the other goals too.
        """
        near = tolerance + self.rover.wheelbase
        failures = [
            one.poses[one.verdict.first_failure] - goal
            for one in answer.candidates
            if one.verdict.first_failure > 0
        ]
        return any(np.hypot(*failure[:2]) <= near for failure in failures)

    def check(self, poses: NDArray[np.float64]) -> Candidate:
        """Judge one given path of poses (n, 3).

        Raises:
            RoverError: The model refuses an option or the poses.
        """
        return check_path(self.rover, self.terrain, poses, self.options)

    def predict_standing(self, pose: Pose) -> PathPrediction:
        """Predict the rover standing at a pose.

        Raises:
            RoverError: The model refuses an option or the pose.
        """
        poses, options = pose[None, :], self.options.model
        return judge_poses(self.rover, self.terrain, poses, None, options, sigmas=0)[0]

    def classify(self, candidate: Candidate) -> tuple[ClassifiedWaypoint, ...]:
        """Return the class of each waypoint of a judged path; may evaluate the path once more."""
        return classify_judged(
            self.rover,
            self.terrain,
            candidate.prediction,
            candidate.verdict,
            self.options.model,
            sigmas=self.options.map_sigmas,
        )

    def _query(self, start: Pose, goal: Pose) -> PathAnswer:
        return answer_path_query(self.rover, self.terrain, start, goal, self.options)

    def _goals_to_stand_on(self, start: Pose, goal: Pose, tolerance: float) -> Iterator[Pose]:
        """Yield alternative goals where the rover can stand, nearest first, a few per ring.

        Goals on the start's side of a ring come first. If these cannot be reached, those behind
        them rarely can, and each goal costs the evaluation of all candidates.
        """
        for ring in rings_within(start, goal, tolerance):
            standing = (pose for pose in ring if self._can_stand(pose))
            yield from itertools.islice(standing, _QUERIES_PER_RING)

    def _can_stand(self, pose: Pose) -> bool:
        """Return whether the rover can stand at a pose; the way to the pose is not checked."""
        return self.check(pose[None, :]).verdict.traversable
