# SPDX-License-Identifier: Apache-2.0
"""A path with all that its verdict depends on, and the case as it was judged."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from rover_physics.bounds.path import SIGMAS
from rover_physics.limits.table import CHANCE
from rover_physics.names import WHEEL_POSITIONS
from rover_physics.numerics.arrays import Floats
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.uses import find_uses, limits_of
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_path, judge_paths
from rover_physics.traversability.verdict import Verdict

ACCEPTED_CHANCE = 0.05
"""Largest chance of failure of a path that is advised: one drive of twenty."""


@dataclass(frozen=True, eq=False)
class Case:
    """A path, and rover, ground and options for which it is judged."""

    rover: Rover
    """The rover."""
    terrain: Terrain
    """The ground, map frame."""
    poses: Floats
    """(n, 3) x, y [m] and yaw [rad] of the body origin, map frame."""
    options: SweepOptions = DEFAULT_OPTIONS
    """Torque policy, friction, torque, soil, arm and direction."""
    sigmas: float = SIGMAS
    """Standard deviations by which the map's heights may be wrong."""
    accepted_chance: float = ACCEPTED_CHANCE
    """Largest chance of failure of a path that passes."""

    def change(self, **options: Any) -> "Case":
        """Return the case with other options."""
        return replace(self, options=replace(self.options, **options))

    def judge(self) -> "JudgedCase":
        """Judge the path up to its first failure; of one that passes, all is predicted.

        Raises:
            RoverError: The model refuses the path or an option.
        """
        judged = judge_path(
            self.rover,
            self.terrain,
            self.poses,
            self.options,
            sigmas=self.sigmas,
            stop_at_failure=True,
            accepted_chance=self.accepted_chance,
        )
        return JudgedCase(self, *judged)

    def fails_at(self, place: int, rows: slice, by_chance: bool) -> bool:
        """Return whether a piece of the path shows that a waypoint in it, or one before it, fails.

        Its first row has another motion than in the path, and wheels behind the place may fall in
        ways that the piece does not show.
        """
        (_, verdict), *_ = judge_paths(
            self.rover,
            self.terrain,
            [self.poses[rows]],
            self.options,
            sigmas=self.sigmas,
            stop_at_failure=True,
            check_entrapment=False,
            accepted_chance=self.accepted_chance if by_chance else None,
        )
        row = verdict.first_failure
        if verdict.code == CHANCE and verdict.failure_chance_at[row] <= self.accepted_chance:
            return False
        return (0 if rows.start == 0 else 1) <= row <= place - rows.start


@dataclass(frozen=True, eq=False)
class JudgedCase:
    """A case with its prediction and verdict."""

    case: Case
    """The case."""
    prediction: PathPrediction
    """The prediction, perhaps only up to the first failure."""
    verdict: Verdict
    """The verdict."""

    @property
    def passes(self) -> bool:
        """True if the path keeps all limits, and fails with no more than the accepted chance."""
        return self.verdict.traversable

    @cached_property
    def use(self) -> Floats:
        """(n,) largest use of a limit at each waypoint and on the way there."""
        use = np.zeros(len(self.prediction.poses))
        for part in (self.prediction, self.prediction.between):
            if part is not None and len(part.poses):
                limits = limits_of(self.case.rover, part.policy)
                of_rows = np.fmax.reduce(find_uses(limits, part.results).use, axis=1)
                np.fmax.at(use, part.waypoint, of_rows)
        return use

    @property
    def largest_use(self) -> tuple[float, float]:
        """Largest use of a limit on the path, and the distance [m] where it is."""
        place = int(self.use.argmax())
        return float(self.use[place]), float(self.distance[place])

    @cached_property
    def distance(self) -> Floats:
        """(n,) distance along the path [m]."""
        return distance_along(self.case.poses)

    def loads_of_axles(self, waypoint: int) -> dict[str, float]:
        """Return the load [N] of each axle at a waypoint by its name; NaN where unknown."""
        loads = self.prediction.wheel_loads[waypoint]
        return {name: float(loads[k] + loads[k + 3]) for k, name in enumerate(WHEEL_POSITIONS)}


def distance_along(poses: Floats) -> Floats:
    """Return the distance (n,) [m] along a path (n, 3)."""
    steps = np.diff(poses[:, :2], axis=0)
    return np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])
