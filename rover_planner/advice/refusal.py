# SPDX-License-Identifier: Apache-2.0
"""A refused path, and where and by what it fails first."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rover_physics.names import SERVO
from rover_physics.numerics.arrays import Floats
from rover_planner.advice.case import Case, JudgedCase
from rover_planner.errors import PlanningError
from rover_planner.planning.answering.budget import QuestionStoppedError
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.search.path_search import find_path
from rover_planner.planning.search.query import LatticeSettings, SearchQuery

BEFORE = 1.5
"""Length of path that decides about a failure with servos [wheelbases]: they drift over one."""
EDGE = 2.0
"""Length of path around a failure that decides whether a wheel falls there [wheel radii]."""
SEARCH = LatticeSettings(budget=1.0, ends_at_first=True)
"""How a path around is searched."""


@dataclass(frozen=True, eq=False)
class Refusal:
    """A case that fails."""

    judged: JudgedCase
    """The case, predicted up to its first failure or a little beyond."""

    @property
    def case(self) -> Case:
        """The case."""
        return self.judged.case

    @property
    def place(self) -> int:
        """Index of the waypoint that fails first."""
        return self.judged.verdict.first_failure

    @property
    def time(self) -> float:
        """Time of the path [s], as if the rest of it were as what lies before the failure."""
        to_failure, share = self._sum_before_failure("time")
        length = float(self.judged.distance[-1])
        return to_failure / share if share > 0.0 else length / self.case.rover.nominal_speed

    @property
    def energy(self) -> float:
        """Energy of the path [J] in the same way; 0 if nothing lies before the failure."""
        to_failure, share = self._sum_before_failure("energy")
        return to_failure / share if share > 0.0 else 0.0

    def _sum_before_failure(self, name: str) -> tuple[float, float]:
        """Return a sum up to the failure, and the share of the path that this is."""
        row = max(0, self.place - 1)
        value = float(getattr(self.judged.prediction, name)[row])
        distance = self.judged.distance
        is_known = np.isfinite(value) and distance[row] > 0.0
        return value, float(distance[row] / distance[-1]) if is_known else 0.0

    @property
    def place_on_ground(self) -> tuple[float, float]:
        """Position (x, y) [m] of the highest wheel where the rover last settled before it."""
        prediction, row = self.judged.prediction, self.place
        while row > 0 and not prediction.settled[row]:
            row -= 1
        centres = prediction.wheel_centres[row]
        x, y = centres[int(np.argmax(centres[:, 2])), :2]
        return float(x), float(y)

    @cached_property
    def path_around(self) -> Floats | None:
        """Another path (n, 3) from start to goal that passes; None if none is found in time."""
        case = self.case
        options = PathQueryOptions(
            model=case.options, map_sigmas=case.sigmas, accepted_chance=case.accepted_chance
        )
        ends = case.poses[0], case.poses[-1]
        try:
            found = find_path(SearchQuery(case.rover, case.terrain, *ends, options), SEARCH)
        except QuestionStoppedError:
            raise
        except PlanningError:
            return None  # an end is not on the map
        return None if found.path is None else found.path.poses

    def rows_around(self, place: int, policy: str) -> slice:
        """Return the rows of the path that decide whether a waypoint fails under a policy."""
        rover, distance = self.case.rover, self.judged.distance
        before = BEFORE * rover.wheelbase if policy == SERVO else EDGE * rover.wheel.radius
        near = distance[place] - before, distance[place] + EDGE * rover.wheel.radius
        first, last = np.searchsorted(distance, near)
        return slice(max(0, min(int(first), place - 1)), int(last) + 1)
