"""Plans and checks paths of one rover on one map; where a goal cannot be reached, tries others."""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.classification import ClassifiedWaypoint, classify_judged
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
    """The answer to a query, and the goal that it is for."""

    answer: PathAnswer
    """The candidate paths to the goal."""
    asked_goal: Pose
    """The goal that was asked for."""
    goal: Pose
    """The goal of the candidates: the one that was asked for, or another near it."""
    alternatives_tried: int
    """Number of other goals that were tried."""

    @property
    def goal_offset(self) -> float:
        """Distance of the goal from the one that was asked for [m]."""
        return float(np.hypot(*(self.goal - self.asked_goal)[:2]))


@dataclass(frozen=True, eq=False)
class PathPlanner:
    """Finds, checks and classifies paths; all of them for the same rover, map and arm angles."""

    rover: Rover
    """The rover."""
    terrain: Terrain
    """The ground, map frame."""
    options: PathQueryOptions
    """How candidates are made and judged."""
    joint_angles: Mapping[str, float] | None
    """Angles [rad] of the manipulator's joints by name; None is stowed."""

    def search(self, start: Pose, goal: Pose, tolerance: float = 0.0) -> PathSearch:
        """Find a path from start to goal, or to a goal near it.

        Args:
            start: Where the path starts.
            goal: Where it is to end.
            tolerance: How far from the goal's position the path may end [m] where the goal
                itself cannot be reached; the heading stays. 0 is exact.

        Returns:
            The answer for the goal, or for the first other goal that can be reached.

        Raises:
            PlanningError: start, goal or options make no candidate paths.
            RoverError: The model refuses an option or the poses.
        """
        answer, tried = self._query(start, goal), 0
        if not answer.traversable and answer.chosen.verdict.first_failure > 0:
            for alternative in self._goals_to_stand_on(start, goal, tolerance):
                tried += 1
                other = self._query(start, alternative)
                if other.traversable:
                    return PathSearch(other, goal, alternative, tried)
        return PathSearch(answer, goal, goal, tried)

    def check(self, poses: NDArray[np.float64]) -> Candidate:
        """Judge one given path of poses (n, 3).

        Raises:
            RoverError: The model refuses an option or the poses.
        """
        return check_path(self.rover, self.terrain, poses, self.options, self.joint_angles)

    def classify(self, candidate: Candidate) -> tuple[ClassifiedWaypoint, ...]:
        """Return the class of each waypoint of a judged path; may sweep it once more."""
        return classify_judged(
            self.rover,
            self.terrain,
            candidate.prediction,
            candidate.verdict,
            self.options.sweep_options(self.joint_angles),
            sigmas=self.options.map_sigmas,
        )

    def _query(self, start: Pose, goal: Pose) -> PathAnswer:
        return answer_path_query(
            self.rover, self.terrain, start, goal, self.options, self.joint_angles
        )

    def _goals_to_stand_on(self, start: Pose, goal: Pose, tolerance: float) -> Iterator[Pose]:
        """Yield other goals at which the rover can stand, the nearest first, a few of each ring.

        A ring's goals on the start's side come first: where those cannot be reached, the ones
        behind them rarely can, and each costs a sweep of all candidates.
        """
        for ring in rings_within(start, goal, tolerance):
            standing = (pose for pose in ring if self._can_stand(pose))
            yield from itertools.islice(standing, _QUERIES_PER_RING)

    def _can_stand(self, pose: Pose) -> bool:
        """Tell whether the rover can stand at a pose, without asking how it gets there."""
        return self.check(pose[None, :]).verdict.traversable
