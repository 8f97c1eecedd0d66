# SPDX-License-Identifier: Apache-2.0
"""A path with all that its verdict depends on, and the case as it was judged."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from rover_physics.bounds.path import SIGMAS
from rover_physics.chance.failure_chance import SUMS
from rover_physics.limits.table import CHANCE, Sense
from rover_physics.names import SERVO, WHEEL_POSITIONS
from rover_physics.numerics.arrays import Floats
from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.sweep import check_poses, predict_paths
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.uses import RoverLimits, find_uses, limits_of
from rover_physics.rover.model import Rover
from rover_physics.rover.uncertainty import ACCEPTED_CHANCE
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_path, judge_paths
from rover_physics.traversability.verdict import Verdict
from rover_planner.planning.path_geometry import distance_along


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

    def predict(self) -> PathPrediction:
        """Predict all of the path, also beyond its first failure."""
        model = pack_model(self.rover, self.terrain, self.options)
        return predict_paths(model, [check_poses(self.poses)], stop_at_failure=False)[0].prediction

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
        return self._uses.max(axis=1)

    @property
    def largest_use(self) -> tuple[float, float]:
        """Largest use of a limit on the path, and the distance [m] where it is."""
        place = int(self.use.argmax())
        return float(self.use[place]), float(self.distance[place])

    @property
    def nearest_limit(self) -> str:
        """Name of the limit that is used most, such as "tip over"."""
        place = int(self.use.argmax())
        return self._limits.rows[int(self._uses[place].argmax())].code.replace("_", " ")

    @property
    def fails_by_sum(self) -> bool:
        """True if no limit is broken that a waypoint breaks without the path before it."""
        broken = self._uses[self.verdict.first_failure] > 1.0
        rows = zip(self._limits.rows, broken, strict=True)
        return all(row.reads in SUMS for row, is_broken in rows if is_broken)

    @property
    def _limits(self) -> RoverLimits:
        return limits_of(self.case.rover, self.prediction.policy)

    @cached_property
    def _uses(self) -> Floats:
        """(n, k) use of each limit at each waypoint and on the way there.

        Speed servos use all friction or lift a wheel for a while without failing: those limits
        count where they are broken.
        """
        uses = np.zeros((len(self.prediction.poses), len(self._limits)))
        for part in (self.prediction, self.prediction.between):
            if part is not None and len(part.poses):
                np.fmax.at(uses, part.waypoint, find_uses(self._limits, part.results).use)
        if self.prediction.policy == SERVO:
            saturate = [
                row.sense == Sense.SHARE or not row.has_number for row in self._limits.rows
            ]
            uses[:, saturate] = np.where(uses[:, saturate] > 1.0, uses[:, saturate], 0.0)
        return uses

    @cached_property
    def distance(self) -> Floats:
        """(n,) distance along the path [m]."""
        return distance_along(self.case.poses)

    def loads_of_axles(self, waypoint: int) -> dict[str, float]:
        """Return the load [N] of each axle at a waypoint by its name; NaN where unknown."""
        loads = self.prediction.wheel_loads[waypoint]
        return {name: float(loads[k] + loads[k + 3]) for k, name in enumerate(WHEEL_POSITIONS)}

