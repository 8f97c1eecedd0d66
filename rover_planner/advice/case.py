# SPDX-License-Identifier: Apache-2.0
"""A path with all that its verdict depends on, and the case as it was judged or refused."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from rover_physics.limits.table import CHANCE, TRAPPED, Sense
from rover_physics.names import SERVO
from rover_physics.numerics.arrays import Floats
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.results.uses import RoverLimits, find_uses, limits_of
from rover_physics.rover.model import Rover
from rover_physics.rover.uncertainty import ACCEPTED_CHANCE
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_path, judge_paths
from rover_planner.errors import PlanningError
from rover_planner.planning.answering.budget import QuestionStoppedError
from rover_planner.planning.path_geometry import distance_along
from rover_planner.planning.path_query import Candidate
from rover_planner.planning.search.path_search import find_path
from rover_planner.planning.search.query import LatticeSettings, SearchQuery, Site

MOST_FRICTION = 1.5
"""Largest friction that is asked for."""
EDGE = 2.0
"""Length of path around a failure that decides whether a wheel falls there [wheel radii]."""
FIRST_ROWS = 2
"""Rows of a piece of path that tell nothing of the path."""
SEARCH = LatticeSettings(budget=1.0, ends_at_first=True)
"""Settings of the search of a path around."""


@dataclass(frozen=True, eq=False)
class Case:
    """A path, and for what it is judged."""

    site: Site
    """Rover, ground and options, also those of a path that is made anew."""
    poses: Floats
    """(n, 3) x, y [m] and yaw [rad] of the body origin, map frame."""

    @property
    def rover(self) -> Rover:
        """The rover."""
        return self.site.rover

    @property
    def terrain(self) -> Terrain:
        """The ground, map frame."""
        return self.site.terrain

    @property
    def options(self) -> SweepOptions:
        """Options of the model."""
        return self.site.options.model

    def change(self, **options: Any) -> "Case":
        """Return the case with other options."""
        return self.change_site(options=self.site.options.change(**options))

    def change_site(self, **changes: Any) -> "Case":
        """Return the case with another rover, ground or options."""
        return replace(self, site=replace(self.site, **changes))

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
            sigmas=self.site.options.map_sigmas,
            stop_at_failure=True,
            accepted_chance=self.site.options.accepted_chance,  # 1, too: the chance is told
        )
        path = self.site.refuse_ground(Candidate(self.poses, *judged))
        return JudgedCase(**vars(path), case=self)


def case_of(site: Site, poses: Floats) -> Case:
    """Return the case of a path that was judged; what is advised has an accepted chance."""
    asked = site.options.asked_chance
    accepted = ACCEPTED_CHANCE if asked is None else asked
    options = site.options.change(accepted_chance=accepted, waypoint_spacing=0.0)
    return Case(replace(site, options=options), poses)


@dataclass(frozen=True, eq=False)
class JudgedCase(Candidate):
    """The path of a case as it was judged; where it is refused, where and by what it fails."""

    case: Case
    """The case."""

    @property
    def passes(self) -> bool:
        """True if the path keeps all limits, and fails with no more than the accepted chance."""
        return self.verdict.traversable

    @cached_property
    def use(self) -> Floats:
        """(n,) largest use of a limit at each waypoint and on the way there."""
        return self._uses.max(axis=1)

    @property
    def largest_use(self) -> tuple[float, float, str]:
        """Largest use of a limit on the path, the distance [m] where it is, and of which limit."""
        place, limit = divmod(int(self._uses.argmax()), len(self._limits))
        name = self._limits.rows[limit].code.replace("_", " ")
        return float(self.use[place]), float(self.distance[place]), name

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

    @property
    def place(self) -> int:
        """Index of the waypoint that fails first."""
        return self.verdict.first_failure

    @property
    def time(self) -> float:
        """Time of the path [s], as if the rover could drive on where it fails."""
        return self._sum_up("time", float(self.distance[-1]) / self.case.rover.nominal_speed)

    @property
    def energy(self) -> float:
        """Energy of the path [J] in the same way; 0 if none of it is known."""
        return self._sum_up("energy", 0.0)

    def _sum_up(self, name: str, usual: float) -> float:
        """Return the sum at the end of the path; if unknown, as before by distance, or `usual`."""
        values, distance = getattr(self._whole, name), self.distance
        if np.isfinite(values[-1]):
            return float(values[-1])
        known = np.flatnonzero(np.isfinite(values) & (distance > 0.0))
        if not known.size:
            return usual
        return float(values[known[-1]] * distance[-1] / distance[known[-1]])

    @cached_property
    def _whole(self) -> PathPrediction:
        """The prediction of all of the path, on ground that holds if the wheels slip on this."""
        slips = self.verdict.code == "friction"
        case = self.case.change(friction=MOST_FRICTION) if slips else self.case
        return judge_path(case.rover, case.terrain, case.poses, case.options, sigmas=0)[0]

    @property
    def place_on_ground(self) -> tuple[float, float]:
        """Position (x, y) [m] of the highest wheel where the rover last settled before it."""
        prediction, row = self.prediction, self.place
        while row > 0 and not prediction.settled[row]:
            row -= 1
        centres = prediction.wheel_centres[row]
        x, y = centres[int(np.argmax(centres[:, 2])), :2]
        return float(x), float(y)

    @cached_property
    def path_around(self) -> Floats | None:
        """Another path (n, 3) from start to goal that passes; None if none is found in time."""
        case = self.case
        query = SearchQuery(case.site, case.poses[0], case.poses[-1])
        try:
            found = find_path(query, SEARCH)
        except QuestionStoppedError:
            raise
        except PlanningError:
            return None  # an end is not on the map
        return None if found.path is None else found.path.poses

    def fails_alike(self, case: Case) -> bool:
        """Return whether a piece of path around this failure shows that another case fails, too.

        The rows of its path are near those of this one. The first rows of the piece have another
        motion than in the path, and wheels behind the failure may fall in ways that the piece does
        not show. Nor does it show whether the rover is trapped.
        """
        if self.verdict.code == TRAPPED:
            return False
        near = EDGE * self.case.rover.wheel.radius * np.array([-1.0, 1.0])
        first, last = np.searchsorted(self.distance, self.distance[self.place] + near).tolist()
        begin = max(0, min(first, self.place - FIRST_ROWS))
        accepted = case.site.options.accepted_chance
        (_, verdict), *_ = judge_paths(
            case.rover,
            case.terrain,
            [case.poses[begin : last + 1]],
            case.options,
            sigmas=case.site.options.map_sigmas,
            stop_at_failure=True,
            check_entrapment=False,
            accepted_chance=accepted if self.verdict.code == CHANCE else None,
        )
        row = verdict.first_failure
        if verdict.code == CHANCE and verdict.failure_chance_at[row] <= accepted:
            return False
        return (FIRST_ROWS if begin else 0) <= row <= self.place - begin
