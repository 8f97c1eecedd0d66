"""The quasi-static model along a path: poses in, `PathPrediction` out."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.errors import PoseError
from rover_physics.numerics.interruption import check_interruption
from rover_physics.numerics.plausible import MAX_COORDINATE
from rover_physics.numerics.quiet import quiet
from rover_physics.numerics.read_only import view_read_only
from rover_physics.numerics.threads import limit_threads
from rover_physics.prediction.crossing import Crossings, Evaluate, find_crossings
from rover_physics.prediction.drops import ROUNDING, Falls, find_falls
from rover_physics.prediction.evaluation import AHEAD, NONE_HELD, RESULT, effort, evaluate
from rover_physics.prediction.packed_model import PackedModel, pack_model
from rover_physics.prediction.path_kernels import Wheels, add_up
from rover_physics.prediction.path_motion import motions_of, path_motions
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.prediction.servo_path import (
    climb_costs,
    find_drift,
    find_lift_heights,
    stop_in_slots,
)
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, POLICIES, SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.status import PoseStatus, TorquePolicy
from rover_physics.terrain.grid import Terrain

POLICY_NAMES = {int(policy): name for name, policy in POLICIES.items()}

Sums = tuple[float, float, float]
"""Distance [m], time [s] and energy [J] since the start of a path."""
NO_SUMS = (0.0, 0.0, 0.0)


def sweep_path(
    rover: Rover,
    terrain: Terrain,
    poses: ArrayLike,
    options: SweepOptions = DEFAULT_OPTIONS,
) -> PathPrediction:
    """Predict the rover at each pose of a path.

    Args:
        rover: The rover.
        terrain: The ground; its friction and soil layers override the options.
        poses: (n, 3) x, y [m] and yaw [rad] of base_link in the map frame, n >= 1.
        options: Torque policy, friction, soil, arm and direction.

    Raises:
        PoseError: Poses of wrong shape, or not finite.
        ModelError: An option that this rover cannot have.
        SoilError: A soil of the terrain, or of the options, that is not a preset.
    """
    return sweep_paths(rover, terrain, [poses], options)[0]


@quiet
def sweep_paths(
    rover: Rover,
    terrain: Terrain,
    paths: Sequence[ArrayLike],
    options: SweepOptions = DEFAULT_OPTIONS,
) -> list[PathPrediction]:
    """Predict the rover along several paths at once, faster than one by one.

    Args:
        rover: The rover.
        terrain: The ground.
        paths: Poses of each path, as `sweep_path` takes them.
        options: As for `sweep_path`.

    Raises:
        PoseError, ModelError, SoilError: As `sweep_path`.
    """
    return [swept.prediction for swept in sweep_in_full(rover, terrain, paths, options)]


@quiet
def sweep_poses(
    rover: Rover,
    terrain: Terrain,
    poses: ArrayLike,
    curvature: ArrayLike,
    options: SweepOptions = DEFAULT_OPTIONS,
) -> PathPrediction:
    """Predict the rover at single poses that form no path.

    What would lie between poses, crossings, falls and drops, is left out. Time, energy and
    distance are 0 where the rover settled.

    Args:
        rover: The rover.
        terrain: The ground; its friction and soil layers override the options.
        poses: (n, 3) x, y [m] and yaw [rad] of base_link in the map frame, n >= 1.
        curvature: (n,) curvature of the motion of base_link at each pose [1/m], positive to the
            left, 0 straight ahead, inf or -inf on the spot.
        options: As for `sweep_path`.

    Raises:
        PoseError: Poses of wrong shape, or not finite; curvatures of wrong shape, or NaN.
        ModelError, SoilError: As `sweep_path`.
    """
    model, places = pack_model(rover, terrain, options), check_poses(poses)
    results = evaluator(model)(places, motions=motions_of(model, places, curvature))
    return predict_poses(model, places, results)


def predict_poses(model: PackedModel, places: np.ndarray, results: Any) -> PathPrediction:
    """Return the prediction of single poses (n, 3) that form no path from their RESULTs (n,)."""
    prediction = _collect(
        places,
        results,
        model,
        wheel_drop=np.zeros((len(places), 6)),
        drift=np.zeros((len(places), 2)),
        lift_height=np.zeros((len(places), 6)),
        falling=np.zeros((len(places), 6), bool),
        start=NO_SUMS,
        between=None,
        waypoint=np.arange(len(places)),
    )
    nothing = np.where(prediction.settled, 0.0, np.nan)
    return replace(prediction, energy=nothing, time=nothing, distance=np.zeros(len(places)))


@dataclass(frozen=True, eq=False)
class SweptPath:
    """A prediction along a path with the results that it is made of."""

    path: np.ndarray
    """(k, 3) all poses of the path; the rest is about the first n of them."""
    prediction: PathPrediction
    """The prediction."""
    results: Any
    """(n,) RESULT of each waypoint."""
    crossings: Crossings
    """Poses between the waypoints."""

    def cut(self, waypoints: int) -> "SweptPath":
        """Return what is about the first waypoints."""
        crossings = self.crossings.select(self.crossings.waypoint < waypoints)
        prediction = self.prediction.cut(waypoints)
        return SweptPath(self.path, prediction, self.results[:waypoints], crossings)


@quiet
def sweep_in_full(
    rover: Rover, terrain: Terrain, paths: Sequence[ArrayLike], options: SweepOptions
) -> list[SweptPath]:
    """Sweep several paths and keep the results; arguments and errors as `sweep_paths`."""
    model = pack_model(rover, terrain, options)
    if not paths:
        return []
    checked = [check_poses(poses) for poses in paths]
    ends = np.cumsum([len(poses) for poses in checked])
    poses, evaluate_at = np.concatenate(checked), evaluator(model)
    motions = np.concatenate([path_motions(model, path) for path in checked])
    with limit_threads(effort(model.settings, len(poses))):  # set once, not per round
        results = evaluate_at(poses, motions=motions)
        crossings = find_crossings(
            terrain, wheels_of(model), poses, results, evaluate_at, joined_paths(ends)
        )
    swept = []
    for first, end in zip([0, *ends[:-1]], ends, strict=True):
        check_interruption()
        part = crossings.between(first, end) if len(paths) > 1 else crossings
        swept.append(make_prediction(model, poses[first:end], results[first:end], part)[0])
    return swept


def joined_paths(ends: np.ndarray) -> np.ndarray:
    """Return (n - 1,) False where a path ends and the next begins.

    `ends` (k,) are the numbers of waypoints up to the end of each path.
    """
    joined = np.ones(ends[-1] - 1, bool)
    joined[ends[:-1] - 1] = False
    return joined


def evaluator(model: PackedModel) -> Evaluate:
    """Return the function that evaluates a model at poses, as `find_crossings` takes it."""

    def evaluate_at(
        at: np.ndarray, held: np.ndarray = NONE_HELD, motions: np.ndarray = AHEAD
    ) -> Any:
        return evaluate(model.records, at, held, motions)

    return evaluate_at


def wheels_of(model: PackedModel) -> Wheels:
    """Return size and limits of the rover's wheels.

    Forces beyond what friction and motors give never balance, whatever the safety limits.
    """
    linkage, settings = model.record.linkage, model.record.settings
    torque = settings.allowed_torque / settings.max_torque
    return Wheels(
        float(linkage.radius),
        float(linkage.reach),
        min(float(settings.allowed_friction), 1.0) + ROUNDING,
        min(float(torque), 1.0) + ROUNDING,
        float(settings.allowed_drop) + ROUNDING,
        bool(settings.policy == TorquePolicy.SERVO),
    )


def make_prediction(
    model: PackedModel,
    poses: np.ndarray,
    results: Any,
    crossings: Crossings,
    start: Sums = NO_SUMS,
) -> tuple[SweptPath, Falls]:
    """Return the prediction of one path from its results, and its falls.

    Distance, time and energy at the first pose are `start`.
    """
    wheels = wheels_of(model)
    falls = find_falls(wheels, poses, results, crossings)
    if model.settings["policy"] == TorquePolicy.SERVO:
        results, crossings = results.copy(), replace(crossings, results=crossings.results.copy())
        stop_in_slots(poses, results, crossings)
    lift, lift_between = find_lift_heights(wheels, poses, results, crossings)
    between = _collect(
        crossings.poses,
        crossings.results,
        model,
        wheel_drop=np.zeros((len(crossings.poses), 6)),
        drift=np.zeros((len(crossings.poses), 2)),
        lift_height=lift_between,
        falling=falls.between,
        start=NO_SUMS,
        between=None,
        waypoint=crossings.waypoint,
    )
    prediction = _collect(
        poses,
        results,
        model,
        wheel_drop=falls.drops,
        lift_height=lift,
        drift=find_drift(wheels, float(model.record.linkage.length), poses, results, crossings),
        falling=falls.at_waypoints,
        start=start,
        between=between,
        waypoint=np.arange(len(poses)),
    )
    if model.settings["policy"] == TorquePolicy.SERVO:
        time, energy = climb_costs(poses, results, crossings).T
        prediction = replace(
            prediction, time=prediction.time + time, energy=prediction.energy + energy
        )
    return SweptPath(poses, prediction, results, crossings), falls


def check_poses(poses: ArrayLike) -> np.ndarray:
    """Return a copy of poses as a float array (n, 3).

    Raises:
        PoseError: Wrong shape or type, no pose, values that are not finite or beyond
            MAX_COORDINATE.
    """
    try:
        array = np.array(poses, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise PoseError(f"poses are not numbers: {error}") from error
    if array.ndim != 2 or array.shape[1] != 3 or not len(array):
        raise PoseError(f"poses have shape {array.shape}; it must be (n, 3): x, y, yaw, n >= 1")
    plausible = np.abs(array) <= MAX_COORDINATE  # False for NaN
    if not plausible.all():
        row, column = np.argwhere(~plausible)[0]
        name, value = ["x", "y", "yaw"][column], array[row, column]
        most = f"{MAX_COORDINATE:g} {'rad' if name == 'yaw' else 'm'}"
        raise PoseError(f"{name} of pose {row} is {value}; poses must be finite and within {most}")
    return array


def sum_up(
    model: PackedModel, poses: np.ndarray, results: Any, crossings: Crossings, start: Sums
) -> Sums:
    """Return distance [m], time [s] and energy [J] at the last pose from those at the first."""
    if model.settings["policy"] == TorquePolicy.SERVO:
        before = crossings.select(crossings.waypoint < len(poses))
        time, energy = climb_costs(poses, results, before)[-1]
        start = (start[0], start[1] + time, start[2] + energy)
    path, sums = (view_read_only(poses), view_read_only(results)), np.empty((3, len(poses)))
    return add_up(*path, model.record.linkage.steering_rate, start, sums)


def _collect(
    poses: np.ndarray, results: np.ndarray, model: PackedModel, start: Sums, **more: Any
) -> PathPrediction:
    settings, rate = model.settings, model.record.linkage.steering_rate
    same: dict[str, Any] = {name: results[name] for name in RESULT.names or () if name != "q"}
    q, settled = results["q"], results["status"] == PoseStatus.SETTLED
    position = np.empty((len(poses), 3))
    position[:, :2], position[:, 2] = poses[:, :2], q[:, 0]
    if not settled.all():
        position[~settled] = np.nan
        same["wheel_speed"] = np.where(settled[:, None], results["wheel_speed"], np.nan)
        asked = settled | (results["status"] == PoseStatus.STEERING)
        same["steering_angle"] = np.where(asked[:, None], results["steering_angle"], np.nan)
    sums = np.empty((3, len(poses)))
    add_up(view_read_only(poses), view_read_only(results), rate, start, sums)
    distance, time, energy = sums
    return PathPrediction(
        poses=poses,
        settled=settled,
        position=position,
        roll=q[:, 1],
        pitch=q[:, 2],
        rocker_angle=q[:, 3:4] * (1.0, -1.0),
        bogie_angle=q[:, 4:6],
        energy=energy,
        time=time,
        distance=distance,
        policy=POLICY_NAMES[int(settings["policy"])],
        control_margin=float(settings["control_margin"]),
        **same,
        **more,
    )
