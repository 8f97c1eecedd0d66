"""Judges candidate paths between two poses, compares risk and energy, and explains the choice."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_physics.bounds.path import SIGMAS
from rover_physics.names import EQUAL
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.rover.turning import can_turn_on_the_spot, swing_radius, tightest_radius
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge_path import judge_path, judge_paths
from rover_physics.traversability.risk import used_share
from rover_physics.traversability.verdict import Verdict
from rover_planner.parameters.shared import CONTROL_MARGIN
from rover_planner.planning.candidates import generate_candidates, path_length

RISK_STEP = 0.05
"""Rounding step of risks [share of a limit]: paths of equal rounded risk differ by energy."""


@dataclass(frozen=True)
class PathQueryOptions:
    """Options of the generation and judgement of candidate paths."""

    count: int = 9
    """Largest number of candidate paths."""
    spacing: float = 0.3
    """Lateral distance between neighbouring candidates half-way [m]."""
    waypoint_spacing: float = 0.02
    """Largest distance between waypoints along a path [m]."""
    policy: str = EQUAL
    """How the wheels share the traction, one of `TORQUE_POLICIES`."""
    control_margin: float = CONTROL_MARGIN
    """Share of friction and torque left to the traction controller where it is needed."""
    friction: float | None = None
    """Coulomb friction where the terrain has none; None: that of the rover file."""
    max_torque: float | None = None
    """Largest wheel torque [N m]; None: that of the rover file."""
    soil: str | None = None
    """Preset soil where the terrain names none; None: Coulomb friction."""
    payload: float | None = None
    """Mass at the tip of the manipulator [kg]; None: that of the rover file."""
    map_sigmas: float = SIGMAS
    """Standard deviations to allow for on an uncertain map; 0 treats heights as exact."""

    def sweep_options(self, joint_angles: Mapping[str, float] | None = None) -> SweepOptions:
        """Return the options of the model; `joint_angles` [rad] of the arm, None is stowed."""
        return SweepOptions(
            policy=self.policy,
            control_margin=self.control_margin,
            friction=self.friction,
            max_torque=self.max_torque,
            soil=self.soil,
            payload=self.payload,
            joint_angles=joint_angles,
        )


@dataclass(frozen=True)
class Candidate:
    """A path with its prediction, its verdict and its cost."""

    poses: NDArray[np.float64]
    """x, y [m] and yaw [rad] of the body origin at each waypoint, (n, 3), map frame."""
    prediction: PathPrediction
    """The model's outputs at each waypoint; those of a refused candidate may end at its first
    failure or a little beyond it."""
    verdict: Verdict
    """Whether the rover may drive the path, and the reason if not."""
    cost: tuple[float, float]
    """Risk (used share of a safety limit, in steps of RISK_STEP) and energy [J]; both infinite
    if the path is not traversable."""

    @property
    def is_complete(self) -> bool:
        """Whether all waypoints were judged, also those beyond the first failure."""
        return len(self.prediction.poses) == len(self.poses)

    @property
    def length(self) -> float:
        """Length of the path [m]."""
        return path_length(self.poses)

    @property
    def reach(self) -> float:
        """Share of the path before the first failure, 0 to 1; 1 without a failure."""
        failure = self.verdict.first_failure
        if failure < 0:
            return 1.0
        return failure / max(1, len(self.poses) - 1)


@dataclass(frozen=True)
class PathAnswer:
    """The answer to a query: all candidates, the best one, and the one that is explained."""

    candidates: tuple[Candidate, ...]
    """The candidates in the order of their generation, the direct connection first."""
    best: int
    """Index of the traversable candidate with the lowest cost, -1 if there is none."""
    nearest: int
    """Index of the explained candidate: the best, or the one that gets furthest."""

    @property
    def chosen(self) -> Candidate:
        """The explained candidate, of index `nearest`."""
        return self.candidates[self.nearest]

    @property
    def number(self) -> int:
        """Number of the chosen candidate in texts and messages, counted from 1."""
        return self.nearest + 1

    @property
    def traversable(self) -> bool:
        """Whether any candidate is traversable."""
        return self.best >= 0

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
        driven = chosen.reach * chosen.length
        return (
            f"none of {total} candidate paths is traversable; number {self.number} gets furthest, "
            f"{driven:.2f} m of {chosen.length:.2f} m: {chosen.verdict.reason}"
        )


def answer_path_query(
    rover: Rover,
    terrain: Terrain,
    start,
    goal,
    options: PathQueryOptions | None = None,
    joint_angles: Mapping[str, float] | None = None,
) -> PathAnswer:
    """Evaluate the candidate paths from start to goal and choose the best traversable one.

    Of several candidates, a refused one is judged up to its first failure; `check_path` judges all
    of it, as is done for a single candidate.

    Args:
        rover: The rover; its steering sets the smallest radius of a candidate.
        terrain: The ground, map frame.
        start: (3,) x, y [m] and yaw [rad] of the body origin, map frame.
        goal: (3,) x, y [m] and yaw [rad] of the body origin, map frame.
        options: How candidates are generated and judged; None takes the defaults.
        joint_angles: Angles [rad] of the manipulator's joints by name; None is stowed.

    Raises:
        PlanningError: Start, goal or options are invalid.
        RoverError: The model refuses an option (ModelError) or the poses (PoseError).
    """
    options = options or PathQueryOptions()
    paths = generate_paths(rover, start, goal, options)
    sweep_options = options.sweep_options(joint_angles)
    judged = judge_paths(
        rover,
        terrain,
        paths,
        sweep_options,
        sigmas=options.map_sigmas,
        stop_at_failure=len(paths) > 1,
    )
    return choose(
        tuple(
            Candidate(poses, prediction, verdict, path_cost(rover, prediction, verdict))
            for poses, (prediction, verdict) in zip(paths, judged, strict=True)
        )
    )


def generate_paths(
    rover: Rover, start, goal, options: PathQueryOptions
) -> list[NDArray[np.float64]]:
    """Return the poses (n, 3) of the candidate paths of `answer_path_query`, the direct one first.

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


def check_path(
    rover: Rover,
    terrain: Terrain,
    poses: NDArray[np.float64],
    options: PathQueryOptions | None = None,
    joint_angles: Mapping[str, float] | None = None,
    *,
    stop_at_failure: bool = False,
) -> Candidate:
    """Evaluate and judge a given path of poses (n, 3); other arguments as `answer_path_query`.

    With `stop_at_failure`, the waypoints beyond the first failure are left out.

    Raises:
        RoverError: The model refuses an option (ModelError) or the poses (PoseError).
    """
    options = options or PathQueryOptions()
    asked = options.sweep_options(joint_angles)
    poses = np.array(poses, np.float64)
    prediction, verdict = judge_path(
        rover,
        terrain,
        poses,
        asked,
        sigmas=options.map_sigmas,
        stop_at_failure=stop_at_failure,
    )
    return Candidate(poses, prediction, verdict, path_cost(rover, prediction, verdict))


def choose(candidates: tuple[Candidate, ...]) -> PathAnswer:
    """Choose the traversable candidate with the lowest cost; of equal ones the first."""
    indices = range(len(candidates))
    passable = [k for k in indices if candidates[k].verdict.traversable]
    if passable:
        best = min(passable, key=lambda k: candidates[k].cost)
        return PathAnswer(candidates, best, best)
    return PathAnswer(candidates, -1, max(indices, key=lambda k: candidates[k].reach))


def path_cost(rover: Rover, prediction: PathPrediction, verdict: Verdict) -> tuple[float, float]:
    """Return the cost of a path: its risk in steps of RISK_STEP, and its energy [J].

    Both are infinite if the path is not traversable or one of them is not a number.
    """
    if not verdict.traversable:
        return (np.inf, np.inf)
    risk = np.floor(path_risk(rover, verdict) / RISK_STEP + 0.5) * RISK_STEP
    cost = (float(risk), float(prediction.energy[-1]))
    return (np.inf, np.inf) if math.isnan(sum(cost)) else cost


def path_risk(rover: Rover, verdict: Verdict) -> float:
    """Return the used share of the tightest safety limit of a judged path; 1 is at the limit."""
    return used_share(rover, verdict)
