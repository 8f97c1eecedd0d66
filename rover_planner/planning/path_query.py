"""Candidate paths between two poses: judged, compared by risk and energy, and explained."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_physics.bounds.path import SIGMAS
from rover_physics.names import EQUAL
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge_path import judge_paths
from rover_physics.traversability.verdict import Verdict
from rover_planner.planning.candidates import generate_candidates, path_length

RISK_STEP = 0.05
"""Risks this close [share of a limit] count as equal, so that energy decides between them."""


@dataclass(frozen=True)
class PathQueryOptions:
    """How candidate paths are made and judged."""

    count: int = 9
    """Largest number of candidate paths."""
    spacing: float = 0.3
    """Lateral distance between neighbouring candidates half-way [m]."""
    waypoint_spacing: float = 0.02
    """Largest distance between waypoints along a path [m]."""
    policy: str = EQUAL
    """How the wheels share the traction, one of `TORQUE_POLICIES`."""
    friction: float | None = None
    """Coulomb friction where the terrain has none; None: that of the rover file."""
    max_torque: float | None = None
    """Largest wheel torque [N m]; None: that of the rover file."""
    soil: str | None = None
    """Preset soil where the terrain names none; None: Coulomb friction."""
    payload: float | None = None
    """Mass at the tip of the manipulator [kg]; None: that of the rover file."""
    map_sigmas: float = SIGMAS
    """Standard deviations of an uncertain map to allow for; 0 takes its heights as exact."""

    def sweep_options(self, joint_angles: Mapping[str, float] | None = None) -> SweepOptions:
        """Return the options of the model; joint angles [rad] are the arm's, None is stowed."""
        return SweepOptions(
            policy=self.policy,
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
    """The model's outputs at each waypoint."""
    verdict: Verdict
    """Whether the rover may drive it, and the reason if not."""
    cost: tuple[float, float]
    """Risk (share of the safety limits that is used, in steps of RISK_STEP) and energy [J];
    infinite where the path is not traversable."""

    @property
    def length(self) -> float:
        """Length of the path [m]."""
        return path_length(self.poses)

    @property
    def reach(self) -> float:
        """Share of the path before the first failure: 0 to 1, and 1 where there is none."""
        failure = self.verdict.first_failure
        if failure < 0:
            return 1.0
        return failure / max(1, len(self.poses) - 1)


@dataclass(frozen=True)
class PathAnswer:
    """The answer to a query: all candidates, the chosen one, and the one that explains it."""

    candidates: tuple[Candidate, ...]
    """The candidates in the order they were made, the direct connection first."""
    best: int
    """Index of the traversable candidate of the least cost, -1 if there is none."""
    nearest: int
    """Index of the candidate to explain: the best, or the one that gets furthest."""

    @property
    def chosen(self) -> Candidate:
        """The candidate to explain."""
        return self.candidates[self.nearest]

    @property
    def number(self) -> int:
        """Number of the chosen candidate as words and messages count: 1 is the first made."""
        return self.nearest + 1

    @property
    def traversable(self) -> bool:
        """Whether any candidate is traversable."""
        return self.best >= 0

    def explain(self) -> str:
        """Say in one sentence which path was chosen, or why there is none."""
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
    """Sweep the candidate paths from start to goal and choose the best traversable one.

    Args:
        rover: The rover; its wheelbase is the smallest radius of a candidate.
        terrain: The ground, map frame.
        start: x, y [m] and yaw [rad] of the body origin, map frame.
        goal: The same.
        options: How candidates are made and judged.
        joint_angles: Measured angles [rad] of the manipulator's joints by name.

    Raises:
        PlanningError: start, goal or options make no candidate paths.
        RoverError: The model refuses an option (ModelError) or the poses (PoseError).
    """
    options = options or PathQueryOptions()
    paths = generate_candidates(
        start,
        goal,
        count=options.count,
        spacing=options.spacing,
        waypoint_spacing=options.waypoint_spacing,
        min_radius=smallest_radius(rover),
    )
    return choose(tuple(_check_paths(rover, terrain, paths, options, joint_angles)))


def check_path(
    rover: Rover,
    terrain: Terrain,
    poses: NDArray[np.float64],
    options: PathQueryOptions | None = None,
    joint_angles: Mapping[str, float] | None = None,
) -> Candidate:
    """Sweep one given path of poses (n, 3) and judge it; arguments as for answer_path_query.

    Raises:
        RoverError: The model refuses an option (ModelError) or the poses (PoseError).
    """
    return _check_paths(rover, terrain, [poses], options or PathQueryOptions(), joint_angles)[0]


def _check_paths(
    rover: Rover,
    terrain: Terrain,
    paths: Sequence[NDArray[np.float64]],
    options: PathQueryOptions,
    joint_angles: Mapping[str, float] | None,
) -> list[Candidate]:
    asked = options.sweep_options(joint_angles)
    judged = judge_paths(rover, terrain, paths, asked, sigmas=options.map_sigmas)
    return [
        Candidate(prediction.poses, prediction, verdict, path_cost(rover, prediction, verdict))
        for prediction, verdict in judged
    ]


def choose(candidates: tuple[Candidate, ...]) -> PathAnswer:
    """Choose the traversable candidate of the least cost; of equals the one made first."""
    indices = range(len(candidates))
    passable = [k for k in indices if candidates[k].verdict.traversable]
    if passable:
        best = min(passable, key=lambda k: candidates[k].cost)
        return PathAnswer(candidates, best, best)
    return PathAnswer(candidates, -1, max(indices, key=lambda k: candidates[k].reach))


def path_cost(rover: Rover, prediction: PathPrediction, verdict: Verdict) -> tuple[float, float]:
    """Return the cost of a path: its risk in steps of RISK_STEP, and its energy [J]."""
    if not verdict.traversable:
        return (np.inf, np.inf)
    risk = np.floor(path_risk(rover, verdict) / RISK_STEP + 0.5) * RISK_STEP
    return (float(risk), float(prediction.energy[-1]))


def path_risk(rover: Rover, verdict: Verdict) -> float:
    """Return how much of a safety limit the path uses up, of the limit it comes closest to.

    Friction utilisation, torque saturation and tilt count as value over limit; the tip-over ratio
    and the belly clearance, which must not fall short, as limit over value. 1 is at a limit. On an
    uncertain map the values are the bounds.
    """
    limits = rover.limits
    friction = np.fmax(verdict.max_friction_utilisation, verdict.friction_utilisation_bound)
    torque = np.fmax(verdict.max_torque_saturation, verdict.torque_saturation_bound)
    tilt = np.fmax(verdict.max_tilt, verdict.tilt_bound)
    tip_over = np.fmin(verdict.min_tip_over_ratio, verdict.tip_over_ratio_bound)
    belly = np.fmin(verdict.min_belly_clearance, verdict.belly_clearance_bound)
    return max(
        friction / limits.friction_utilisation,
        torque / limits.torque_saturation,
        tilt / limits.tilt,
        limits.tip_over_ratio / max(tip_over, 1e-9),
        limits.belly_clearance / max(belly, 1e-9),
    )


def smallest_radius(rover: Rover) -> float:
    """Return the radius [m] of the tightest curve to plan for: the rover's wheelbase.

    With the end wheels steered, those on the inside of such a curve turn by about 40 degrees.
    """
    wheels = rover.suspension.wheels
    return float(wheels["front"][0] - wheels["rear"][0])
