# SPDX-License-Identifier: Apache-2.0
"""Candidate paths between two poses: their options, risk and energy, and the choice explained.

Also the assumptions of a prediction in a file, so that it can be judged again under the same.
"""

import json
import math
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.errors import RoverError
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.rover.model import Rover
from rover_physics.rover.steering_joints import can_turn_on_the_spot, swing_radius, tightest_radius
from rover_physics.rover.uncertainty import ACCEPTED_CHANCE, SIGMAS
from rover_physics.traversability.verdict import Verdict, with_refusals
from rover_planner.errors import PlanningError
from rover_planner.planning.candidates import generate_candidates
from rover_planner.planning.path_geometry import path_length

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
    rover: Rover, start, goal, options: PathQueryOptions, *, turns: bool = True
) -> list[NDArray[np.float64]]:
    """Return the poses (n, 3) of the candidate paths, the direct one first.

    The options must have their lengths, see `PathQueryOptions.fit`. Without `turns` there is no
    path with turns on the spot.

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
        swing_radius=swing_radius(rover) if turns and can_turn_on_the_spot(rover) else None,
    )


def choose(candidates: tuple[Candidate, ...]) -> PathAnswer:
    """Choose the traversable candidate with the lowest cost; of equal ones the first."""
    indices = range(len(candidates))
    passable = [k for k in indices if candidates[k].verdict.traversable]
    if passable:
        return PathAnswer(candidates, min(passable, key=lambda k: candidates[k].cost))
    return PathAnswer(candidates, max(indices, key=lambda k: candidates[k].passable_share))


@dataclass(frozen=True)
class Assumptions:
    """Rover and options of a prediction, as a file keeps them; None is the rover's own value."""

    __pydantic_config__ = {"extra": "forbid", "strict": True, "allow_inf_nan": False}  # noqa: RUF012

    rover: str
    """Name of the rover."""
    policy: str
    """Torque policy."""
    control_margin: float = 0.0
    """Share of friction and torque left to the controller."""
    friction: float | None = None
    """Coulomb friction where the terrain has none."""
    max_torque: float | None = None
    """Largest wheel torque [N m]."""
    soil: str | None = None
    """Preset soil where the terrain names none; None: Coulomb friction."""
    payload: float | None = None
    """Mass at the arm's tip [kg]."""
    joint_angles: dict[str, float] | None = None
    """Arm angles [rad] by joint name; None is stowed."""
    has_tool_load: bool = False
    """True if a force or moment acted on the arm's tip."""
    map_sigmas: float = SIGMAS
    """Standard deviations that were allowed for."""

    def change(self, rover: Rover) -> Rover:
        """Return a rover with the values that were assumed in place of its own."""
        wheel, arm = rover.wheel, rover.manipulator
        if self.max_torque is not None:
            wheel = replace(wheel, max_torque=self.max_torque)
        if self.payload is not None and arm is not None:
            arm = replace(arm, payload=self.payload)
        friction = rover.friction if self.friction is None else self.friction
        return replace(rover, friction=friction, wheel=wheel, manipulator=arm)

    def change_options(self, options: PathQueryOptions) -> PathQueryOptions:
        """Return options with the policy, margin, soil and deviations that were assumed.

        Raises:
            RoverError: The policy or the margin is invalid.
        """
        return options.change(
            policy=self.policy,
            control_margin=self.control_margin,
            soil=self.soil,
            map_sigmas=self.map_sigmas,
        )


def assume(rover: Rover, options: SweepOptions, map_sigmas: float = SIGMAS) -> Assumptions:
    """Return the assumptions of a prediction."""
    told = ("policy", "control_margin", "friction", "max_torque", "soil", "payload")
    return Assumptions(
        rover=rover.name,
        **{name: getattr(options, name) for name in told},
        joint_angles=options.arm_angles,
        has_tool_load=options.tool_force is not None or options.tool_moment is not None,
        map_sigmas=map_sigmas,
    )


def write_assumptions(assumptions: Assumptions) -> str:
    """Return assumptions as JSON in one line."""
    return json.dumps(asdict(assumptions), separators=(",", ":"), ensure_ascii=False)


def read_assumptions(text: str) -> Assumptions:
    """Return the assumptions that `write_assumptions` has written.

    Raises:
        PlanningError: The text is something else.
    """
    from pydantic import TypeAdapter, ValidationError

    try:
        assumptions: Assumptions = TypeAdapter(Assumptions).validate_json(text)
        assumptions.change_options(PathQueryOptions())
    except (ValidationError, RoverError) as error:
        reason = str(error).splitlines()[0]
        raise PlanningError(f"assumptions are invalid: {reason}") from None
    return assumptions
