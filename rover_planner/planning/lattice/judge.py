"""Asks the model about pieces of path and about single nodes, and counts the work."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge_path import judge_paths
from rover_physics.traversability.judge_poses import judge_poses
from rover_physics.traversability.sure_failures import find_sure_failures
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
        """Judge pieces of path, each of poses (n, 3).

        Ways out of pits are not asked for; that is done for the whole path.
        """
        asked = self.options.sweep_options(self.joint_angles)
        codes = find_sure_failures(self.rover, self.terrain, pieces, asked)
        judged = [Judged(code, np.inf) for code in codes]
        rest = [k for k, code in enumerate(codes) if not code]
        found = judge_paths(
            self.rover,
            self.terrain,
            [pieces[k] for k in rest],
            asked,
            sigmas=self.options.map_sigmas,
            stop_at_failure=True,
            ask_ways_out=False,
        )
        self.poses += sum(map(len, pieces))
        for k, (prediction, verdict) in zip(rest, found, strict=True):
            passes = verdict.traversable
            cost = true_cost(self.rover, gears[k], prediction, verdict) if passes else np.inf
            judged[k] = Judged(verdict.code, cost)
        return judged

    def stand(self, poses: NDArray[np.float64]) -> tuple[str, ...]:
        """Return the codes (n,) of what fails at single poses (n, 3), wheels ahead; "" if none."""
        self.poses += len(poses)
        _, verdict = judge_poses(
            self.rover,
            self.terrain,
            poses,
            np.zeros(len(poses)),
            self.options.sweep_options(self.joint_angles),
            sigmas=self.options.map_sigmas,
        )
        return verdict.codes

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
