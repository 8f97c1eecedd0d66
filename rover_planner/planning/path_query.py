# SPDX-License-Identifier: Apache-2.0
"""Candidate paths between two poses: their options, risk and energy, and the choice explained."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.bounds.path import SIGMAS
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.rover.model import Rover
from rover_physics.rover.steering_joints import can_turn_on_the_spot, swing_radius, tightest_radius
from rover_physics.rover.uncertainty import ACCEPTED_CHANCE
from rover_physics.traversability.verdict import Verdict, with_refusals
from rover_planner.planning.candidates import generate_candidates, path_length

Pose = NDArray[np.float64]
"""(3,) x, y [m] and yaw [rad] of the body origin, map frame."""
RISK_STEP = 0.05
"""Rounding step of risks [share of a limit]: paths of equal rounded risk differ by energy."""
WAYPOINTS = 5.0
"""Usual number of waypoints in a wheel radius."""
CANDIDATE_SPACING = 15.0
"""Usual distance between candidates half-way [usual distances of waypoints]: three wheel radii."""


def waypoint_spacing_for(rover: Rover) -> float:
    """Return the usual distance between waypoints of a rover [m].

    What lies between waypoints is looked at up to a wheel radius apart.
    """
    return rover.wheel.radius / WAYPOINTS


@dataclass(frozen=True)
class PathQueryOptions:
    """Options of the generation and judgement of candidate paths."""

    count: int = 9
    """Largest number of candidate paths."""
    spacing: float = 0.0
    """Lateral distance between neighbouring candidates half-way [m]; 0: three wheel radii."""
    waypoint_spacing: float = 0.0
    """Largest distance between waypoints along a path [m]; 0: a fifth of the wheel radius."""
    model: SweepOptions = DEFAULT_OPTIONS
    """Torque policy, friction, torque, soil, payload and arm of the model."""
    map_sigmas: float = SIGMAS
    """Standard deviations to allow for on an uncertain map; 0 treats heights as exact."""
    accepted_chance: float = ACCEPTED_CHANCE
    """Largest chance of failure of a path that is traversable; 1 does not ask for it."""

    @property
    def asked_chance(self) -> float | None:
        """The accepted chance as the model takes it: None does not ask for it."""
        return self.accepted_chance if self.accepted_chance < 1.0 else None

    def fit(self, rover: Rover) -> "PathQueryOptions":
        """Return the options with the lengths of a rover where none are given."""
        usual = waypoint_spacing_for(rover)
        return replace(
            self,
            spacing=self.spacing or CANDIDATE_SPACING * usual,
            waypoint_spacing=self.waypoint_spacing or usual,
        )

    def change(self, **changes: Any) -> "PathQueryOptions":
        """Return the options with other values of their fields, or of those of the model.

        Raises:
            ModelError: A value of the model is out of range.
        """
        own = {name: changes.pop(name) for name in tuple(changes) if name in vars(self)}
        model = own.pop("model", self.model)
        return replace(self, **own, model=replace(model, **changes))


@dataclass(frozen=True)
class Candidate:
    """A path with its prediction and its verdict."""

    poses: NDArray[np.float64]
    """x, y [m] and yaw [rad] of the body origin at each waypoint, (n, 3), map frame."""
    prediction: PathPrediction
    """The model's outputs at each waypoint; those of a refused candidate may end at its first
    failure or a little beyond it."""
    verdict: Verdict
    """Verdict on the path, with the reason if the rover may not drive it."""

    @property
    def cost(self) -> tuple[float, float]:
        """Risk (used share of a safety limit, in steps of RISK_STEP) and energy [J].

        Both are infinite if the path is not traversable or one of them is not a number.
        """
        if not self.verdict.traversable:
            return (math.inf, math.inf)
        risk = np.floor(self.verdict.risk / RISK_STEP + 0.5) * RISK_STEP
        cost = (float(risk), float(self.prediction.energy[-1]))
        return (math.inf, math.inf) if math.isnan(sum(cost)) else cost

    @property
    def is_complete(self) -> bool:
        """True if all waypoints were judged, also those beyond the first failure."""
        return len(self.prediction.poses) == len(self.poses)

    @property
    def length(self) -> float:
        """Length of the path [m]."""
        return path_length(self.poses)

    @property
    def passable_length(self) -> float:
        """Length of the path before its first failure [m]; all of it without one."""
        failure = self.verdict.first_failure
        return self.length if failure < 0 else path_length(self.poses[: failure + 1])

    @property
    def passable_share(self) -> float:
        """Share of the length before the first failure, 0 to 1."""
        return self.passable_length / self.length if self.length > 0.0 else 0.0

    def refuse_at(self, waypoint: int, code: str, reason: str) -> "Candidate":
        """Return the path, refused at a waypoint for what the model does not know."""
        codes, reasons = [""] * len(self.poses), [""] * len(self.poses)
        codes[waypoint], reasons[waypoint] = code, reason
        return replace(self, verdict=with_refusals(self.verdict, codes, reasons))


@dataclass(frozen=True)
class PathAnswer:
    """The answer to a query: all candidates, the best one, and the one that is explained."""

    candidates: tuple[Candidate, ...]
    """The candidates in the order of their generation, the direct connection first."""
    choice: int
    """Index of the explained candidate: the best, which is the traversable one with the lowest
    cost, or the one that gets furthest."""
    goal: Pose | None = None
    """Goal of the candidates of a search: the requested one or another one near it."""
    goal_offset: float = 0.0
    """Its distance from the requested goal [m]."""
    alternatives_tried: int = 0
    """Number of other goals that the search has tried."""

    @property
    def chosen(self) -> Candidate:
        """The explained candidate, of index `choice`."""
        return self.candidates[self.choice]

    @property
    def number(self) -> int:
        """Number of the chosen candidate in texts and messages, counted from 1."""
        return self.choice + 1

    @property
    def traversable(self) -> bool:
        """True if any candidate is traversable."""
        return self.chosen.verdict.traversable

    def explain(self) -> str:
        """Return one sentence: which path was chosen, or why none is traversable."""
        chosen = self.chosen
        total = len(self.candidates)
        passable = sum(candidate.verdict.traversable for candidate in self.candidates)
        if self.traversable:
            risk, energy = chosen.cost
            return (
                f"{passable} of {total} candidate paths traversable; chose {self.number}: "
                f"{chosen.length:.2f} m, {energy:.1f} J, risk {risk:.2f}"
            )
        return (
            f"none of {total} candidate paths is traversable; number {self.number} gets furthest, "
            f"{chosen.passable_length:.2f} m of {chosen.length:.2f} m: {chosen.verdict.reason}"
        )


def add_path(answer: PathAnswer | None, path: Candidate, goal: Pose) -> PathAnswer:
    """Return the answer with a traversable path as the chosen one, after its own candidates.

    The path may end elsewhere than at the requested `goal`.
    """
    candidates = (path,) if answer is None else (*answer.candidates, path)
    tried = 0 if answer is None else answer.alternatives_tried
    offset = float(np.hypot(*(path.poses[-1] - goal)[:2]))
    return PathAnswer(candidates, len(candidates) - 1, path.poses[-1], offset, tried)


def generate_paths(
    rover: Rover, start, goal, options: PathQueryOptions
) -> list[NDArray[np.float64]]:
    """Return the poses (n, 3) of the candidate paths, the direct one first.

    The options must have their lengths, see `PathQueryOptions.fit`.

    Raises:
        PlanningError: Start, goal or options are invalid.
    """
    return generate_candidates(
        start,
        goal,
        count=options.count,
        spacing=options.spacing,
        waypoint_spacing=options.waypoint_spacing,
        min_radius=tightest_radius(rover),
        swing_radius=swing_radius(rover) if can_turn_on_the_spot(rover) else None,
    )


def choose(candidates: tuple[Candidate, ...]) -> PathAnswer:
    """Choose the traversable candidate with the lowest cost; of equal ones the first."""
    indices = range(len(candidates))
    passable = [k for k in indices if candidates[k].verdict.traversable]
    if passable:
        return PathAnswer(candidates, min(passable, key=lambda k: candidates[k].cost))
    return PathAnswer(candidates, max(indices, key=lambda k: candidates[k].passable_share))
