"""Asks the model about pieces of path and about single nodes, and counts the work."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rover_physics.prediction.map_sweep import score_poses
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge_path import judge_paths
from rover_planner.planning.lattice.costs import true_cost
from rover_planner.planning.lattice.primitives import Gear
from rover_planner.planning.path_query import Candidate, PathQueryOptions, check_path


@dataclass(frozen=True)
class Judged:
    """What the model found of a piece of path."""

    code: str
    """Code of the limit that fails first, empty if the rover may drive it."""
    cost: float
    """Its cost [m], infinite if it fails."""


@dataclass
class Judge:
    """The model of one rover on one map with options."""

    rover: Rover
    """The rover."""
    terrain: Terrain
    """The ground, map frame."""
    options: PathQueryOptions
    """How paths are judged."""
    joint_angles: Mapping[str, float] | None = None
    """Angles [rad] of the manipulator's joints by name; None is stowed."""
    poses: int = field(default=0, init=False)
    """Number of poses asked for so far, a measure of the work done."""

    def judge(
        self, pieces: Sequence[NDArray[np.float64]], gears: Sequence[Gear]
    ) -> list[Judged]:
        """Judge pieces of path, each of poses (n, 3), up to their first failures.

        Ways out of pits are not asked for; that is done for the whole path.
        """
        found = judge_paths(
            self.rover,
            self.terrain,
            pieces,
            self.options.sweep_options(self.joint_angles),
            sigmas=self.options.map_sigmas,
            stop_at_failure=True,
            ask_ways_out=False,
        )
        self.poses += sum(len(prediction.poses) for prediction, _ in found)
        return [
            Judged("", true_cost(self.rover, gear, prediction, verdict))
            if verdict.traversable
            else Judged(verdict.code, np.inf)
            for gear, (prediction, verdict) in zip(gears, found, strict=True)
        ]

    def can_stand(self, poses: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return where the rover keeps its limits at single poses (n, 3), wheels ahead."""
        self.poses += len(poses)
        asked = self.options.sweep_options(self.joint_angles)
        return score_poses(self.rover, self.terrain, poses, asked).within_limits(self.rover)

    def check(self, poses: NDArray[np.float64]) -> Candidate:
        """Judge a whole path (n, 3) with all that belongs to it, up to its first failure."""
        self.poses += len(poses)
        return check_path(
            self.rover,
            self.terrain,
            poses,
            self.options,
            self.joint_angles,
            stop_at_failure=True,
        )
