# SPDX-License-Identifier: Apache-2.0
"""A refused path, and where and by what it fails first."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_physics.results.path_prediction import PathPrediction
from rover_planner.advice.case import Case, JudgedCase
from rover_planner.errors import PlanningError
from rover_planner.planning.answering.budget import QuestionStoppedError
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.search.path_search import find_path
from rover_planner.planning.search.query import LatticeSettings, SearchQuery

MOST_FRICTION = 1.5
"""Largest friction that is asked for."""
BEFORE = 1.5
"""Length of path that decides about drift and lifts of servos [wheelbases]: sums over one."""
EDGE = 2.0
"""Length of path around a failure that decides whether a wheel falls there [wheel radii]."""
SEARCH = LatticeSettings(budget=1.0, ends_at_first=True)
"""Settings of the search of a path around."""


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
        """Time of the path [s], as if the rover could drive on where it fails."""
        total = self._sum_up("time")
        length = float(self.judged.distance[-1])
        return length / self.case.rover.nominal_speed if total is None else total

    @property
    def energy(self) -> float:
        """Energy of the path [J] in the same way; 0 if none of it is known."""
        return self._sum_up("energy") or 0.0

    def _sum_up(self, name: str) -> float | None:
        """Return the sum at the end of the path: where it is not known, as before by distance."""
        values, distance = getattr(self._whole, name), self.judged.distance
        if np.isfinite(values[-1]):
            return float(values[-1])
        known = np.flatnonzero(np.isfinite(values) & (distance > 0.0))
        if not known.size:
            return None
        return float(values[known[-1]] * distance[-1] / distance[known[-1]])

    @cached_property
    def _whole(self) -> PathPrediction:
        """The prediction of all of the path, on ground that holds if the wheels slip on this."""
        slips = self.judged.verdict.code == "friction"
        return (self.case.change(friction=MOST_FRICTION) if slips else self.case).predict()

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

    def rows_around(self, place: int, fails_by_sum: bool) -> slice:
        """Return the rows of the path that show whether a waypoint fails, perhaps by a sum."""
        rover, distance = self.case.rover, self.judged.distance
        before = BEFORE * rover.wheelbase if fails_by_sum else EDGE * rover.wheel.radius
        near = distance[place] - before, distance[place] + EDGE * rover.wheel.radius
        first, last = np.searchsorted(distance, near)
        return slice(max(0, min(int(first), place - 1)), int(last) + 1)
