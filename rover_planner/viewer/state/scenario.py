# SPDX-License-Identifier: Apache-2.0
"""The question that is judged and the answer that is shown: frozen values for all threads."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from rover_physics.chance.failure_chance import FailureChance
from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.verdict import Verdict
from rover_planner.planning.path_query import Candidate, PathQueryOptions
from rover_planner.planning.search.path_search import SearchResult
from rover_planner.planning.search.query import LatticeSettings, Site
from rover_planner.viewer.state.drive import RoverState, Trajectory
from rover_planner.viewer.state.path_limits import (
    Failure,
    PathLimits,
    find_failure,
    find_path_limits,
)

Pose = tuple[float, float, float]
CANDIDATES = PathQueryOptions(count=5)
"""Options of the candidates that the page begins with."""
SPACING = 5.0
"""Distance between candidates half-way where none is told [wheel radii]."""


@dataclass(frozen=True, eq=False)
class Scenario:
    """Everything that a verdict depends on."""

    loaded: Rover
    """The rover as it was loaded."""
    rover: Rover
    """The same with its numbers as they were changed since."""
    terrain: Terrain
    """The ground."""
    start: Pose
    """x, y [m] and yaw [rad], map frame."""
    goal: Pose
    """The same."""
    options: PathQueryOptions = CANDIDATES
    """Options of the candidates and of the model, also the pose of the arm."""
    recorded: Floats | None = None
    """Poses (n, 3) of a recorded path that takes the place of candidates."""
    search: LatticeSettings = field(default_factory=LatticeSettings)
    """Options of the search of a path around obstacles."""

    @property
    def site(self) -> Site:
        """The rover on the ground, with the options."""
        return Site(self.rover, self.terrain, self.options)

    @property
    def candidates(self) -> PathQueryOptions:
        """Options of the candidates, with lengths of the rover as it was loaded."""
        spacing = self.options.spacing or SPACING * self.loaded.wheel.radius
        return replace(self.options, spacing=spacing).fit(self.loaded)

    @property
    def arm(self) -> dict[str, float]:
        """Angles [rad] of all joints of the arm by name."""
        arm = self.loaded.manipulator
        stowed = {} if arm is None else dict(zip(arm.joints, arm.stowed, strict=True))
        return {**stowed, **(self.options.model.arm_angles or {})}

    def change_options(self, **changes: Any) -> "Scenario":
        """Return the scenario with other options of the model.

        Raises:
            RoverError: A value is out of range.
        """
        return replace(self, options=self.options.change(**changes))

    def as_loaded(self) -> "Scenario":
        """Return the scenario with the rover as it was loaded, its arm stowed."""
        return replace(self, rover=self.loaded).change_options(joint_angles=None)

    def has_paths_of(self, other: "Scenario") -> bool:
        """Return whether the candidate paths are the same, whatever the rover's numbers are."""
        return (
            self.loaded is other.loaded
            and self.terrain is other.terrain
            and (self.start, self.goal) == (other.start, other.goal)
            and replace(self.options, model=other.options.model) == other.options
            and self.recorded is other.recorded
        )

    def take_values(self, other: "Scenario") -> "Scenario":
        """Return this scenario with the values of another, and its path between the same ends."""
        same = (self.start, self.goal) == (other.start, other.goal)
        return replace(
            self,
            rover=other.rover,
            options=other.options,
            recorded=other.recorded if same else self.recorded,
        )


@dataclass(frozen=True, eq=False)
class JudgedPath(Candidate):
    """A path as it was judged for a scenario, and why; what follows is computed once."""

    scenario: Scenario
    """Values for which it was judged."""

    @cached_property
    def trajectory(self) -> Trajectory:
        """The drive, up to the first failure."""
        return Trajectory(self.scenario.rover, self.limits.rows)

    @cached_property
    def limits(self) -> PathLimits:
        """Its uses of the limits, up to the first failure."""
        return find_path_limits(self.scenario.rover, self.prediction, self.verdict)

    @cached_property
    def failure(self) -> Failure | None:
        """The first failure; None if the path can be driven."""
        if self.verdict.first_failure < 0:
            return None
        asked = self.scenario
        return find_failure(asked.rover, asked.terrain, self.verdict, self.limits)

    def state_at(self, time: float) -> RoverState | None:
        """Return the rover at a time [s]; from where it fails on, as it fails.

        Where a wheel rolls off an edge, the model is asked for several states at one time.
        """
        state, failure = self.trajectory.state_at(time), self.failure
        if failure is None or time < failure.state.time - 1e-6:
            return state
        if state is None:
            return failure.state
        stands = self.limits.rows.prediction.settled[failure.row]
        return replace(failure.state, spin=state.spin) if stands else state

    def is_of(self, poses: Floats, values: Scenario) -> bool:
        """Return whether it is a path with these poses under these values."""
        mine, others = (
            (one.rover, one.arm, one.options.change(joint_angles=None))
            for one in (self.scenario, values)
        )
        return mine == others and (self.poses is poses or np.array_equal(self.poses, poses))


@dataclass(frozen=True, eq=False)
class Shown:
    """All paths, the one that a person looks at, and what it is compared with."""

    scenario: Scenario
    """Values for which the path that is looked at was judged."""
    paths: tuple[JudgedPath, ...]
    """Candidates, then paths around obstacles; each as it was judged last."""
    index: int
    """Index of the path that is looked at."""
    generated: int
    """Number of candidates; paths beyond were searched."""
    reference: JudgedPath | None = None
    """The same path with the values of the reference; None if nothing differs from it."""
    by_policy: Mapping[str, tuple[Scenario, Verdict | str]] = field(default_factory=dict)
    """Its known verdicts under torque policies, or why a policy has none, each with the values of
    the page for which it was judged."""
    chance: FailureChance | None = None
    """The chance that the path fails, up to where a limit is broken; None while it is not known,
    or for a replay."""
    around: SearchResult | None = None
    """The finding of a search around obstacles for the scenario; None if none was made."""

    @property
    def path(self) -> JudgedPath:
        """The path that is looked at."""
        return self.paths[self.index]

    @property
    def verdict(self) -> Verdict:
        """The verdict on it."""
        return self.path.verdict

    @property
    def old(self) -> frozenset[int]:
        """Indices of the paths that were judged for other values."""
        now = self.scenario
        return frozenset(k for k, one in enumerate(self.paths) if one.scenario is not now)

    @property
    def best(self) -> int | None:
        """Index of the best path that passes, None if none is known."""
        passing = [
            (one.cost, k)
            for k, one in enumerate(self.paths)
            if k not in self.old and one.verdict.traversable
        ]
        return min(passing)[1] if passing else None

    @property
    def offer(self) -> int | None:
        """Index of a path that passes while the one that is looked at does not."""
        return None if self.verdict.traversable else self.best
