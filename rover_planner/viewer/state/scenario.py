# SPDX-License-Identifier: Apache-2.0
"""The question that is judged and the answer that is shown: frozen values for all threads."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.verdict import Verdict
from rover_planner.planning.path_query import Candidate, PathAnswer, PathQueryOptions
from rover_planner.planning.search.path_search import SearchResult
from rover_planner.planning.search.query import LatticeSettings
from rover_planner.viewer.state.trajectory import Trajectory

Pose = tuple[float, float, float]


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
    options: PathQueryOptions
    """Options of the candidates and of the model."""
    arm_angles: Mapping[str, float]
    """Angles [rad] of the arm's joints by name; joints that are not named are stowed."""
    recorded: Floats | None = None
    """Poses (n, 3) of a recorded path that takes the place of candidates."""
    search: LatticeSettings = field(default_factory=LatticeSettings)
    """Options of the search of a path around obstacles."""

    @property
    def asked_options(self) -> PathQueryOptions:
        """The options with the arm as it is."""
        return self.options.change(joint_angles=self.arm_angles)

    def has_paths_of(self, other: "Scenario") -> bool:
        """Return whether the candidate paths are the same but for changed numbers of the rover."""
        return (
            self.loaded is other.loaded
            and self.terrain is other.terrain
            and (self.start, self.goal) == (other.start, other.goal)
            and self.options == other.options
            and self.recorded is other.recorded
        )


@dataclass(frozen=True)
class PolicyVerdict:
    """The verdict of a path under one torque policy."""

    policy: str
    """One of `TORQUE_POLICIES`."""
    traversable: bool | None
    """True if the rover can drive the path; None if this policy cannot judge it or did not yet."""
    reason: str
    """Reason of a refusal; empty if it can."""
    is_old: bool = False
    """True if it is of other values than the verdict beside it, or not known yet."""


@dataclass(frozen=True, eq=False)
class Shown:
    """The shown path with its verdict, and those of all candidates, which may be older."""

    scenario: Scenario
    """Values for which the shown path was judged."""
    answer: PathAnswer
    """All candidates."""
    answered: Scenario
    """Values for which they were judged."""
    index: int
    """Index of the shown path among the candidates."""
    candidate: Candidate
    """The shown path as it was judged last."""
    trajectory: Trajectory
    """The drive along it."""
    summary: str
    """Sentence on what was judged and for how long; empty for a recorded path."""
    by_policy: tuple[PolicyVerdict, ...] = ()
    """Its verdicts under all torque policies; empty for a replay, whose soil is not known."""
    around: SearchResult | None = None
    """The finding of a search around obstacles for `answered`; None if none was made."""

    @property
    def verdict(self) -> Verdict:
        """The verdict on the shown path."""
        return self.candidate.verdict

    @property
    def reason(self) -> str:
        """The reason of a refusal, after why no path was found; empty if the path passes."""
        reason = self.verdict.reason
        is_old = self.answered is not self.scenario
        if not reason or is_old or self.around is None or self.around.path is not None:
            return reason
        return f"{self.around.reason}; the shown path: {reason}"

    @property
    def needs_search(self) -> bool:
        """True if all candidates are refused, and no search around obstacles was made yet."""
        asked = self.scenario
        return (
            asked.recorded is None
            and self.answered is asked
            and self.around is None
            and not self.answer.traversable
            and all(asked.terrain.contains(*end[:2]) for end in (asked.start, asked.goal))
        )

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """The candidates, with the shown one as it was judged last."""
        candidates = list(self.answer.candidates)
        candidates[self.index] = self.candidate
        return tuple(candidates)
