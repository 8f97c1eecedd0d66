"""The quasi-static model along a path: poses in, `PathPrediction` out."""

import threading
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.contact.settling import NOT_SETTLED, OFF_MAP, SETTLED, UNKNOWN_GROUND
from rover_physics.errors import PoseError
from rover_physics.numerics.threads import limit_threads
from rover_physics.prediction.crossing import Crossings, find_crossings
from rover_physics.prediction.drops import find_falls
from rover_physics.prediction.evaluation import NO_EQUILIBRIUM, NONE_HELD, RESULT, effort, evaluate
from rover_physics.prediction.model_setup import POLICIES, Setup, set_up
from rover_physics.prediction.path_kernels import add_up
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain

__all__ = [
    "NOT_SETTLED",
    "NO_EQUILIBRIUM",
    "OFF_MAP",
    "POLICIES",
    "SETTLED",
    "UNKNOWN_GROUND",
    "sweep_path",
    "sweep_paths",
]

POLICY_NAMES = {number: name for name, number in POLICIES.items()}

sweep_lock = threading.Lock()  # not all of numba's threading layers allow two callers


def sweep_path(
    rover: Rover,
    terrain: Terrain,
    poses: ArrayLike,
    *,
    friction: float | None = None,
    max_torque: float | None = None,
    policy: str = "equal",
    joint_angles: Mapping[str, float] | None = None,
    payload: float | None = None,
    tool_force: ArrayLike | None = None,
    tool_moment: ArrayLike | None = None,
    soil: str | None = None,
    backward: bool = False,
) -> PathPrediction:
    """Predict the rover at each pose of a path.

    Args:
        rover: The rover.
        terrain: The ground; its layers of friction and soil hold where it has them.
        poses: (n, 3) x, y [m] and yaw [rad] of base_link in the map frame, n >= 1.
        friction: Friction coefficient instead of the rover's own.
        max_torque: Largest wheel torque [N m] instead of the rover's own.
        policy: "equal": all wheels pull alike; "optimal": the torques that need least friction.
        joint_angles: Arm angles [rad] by joint name; stowed where not given.
        payload: Mass at the arm's tip [kg] instead of the rover's own.
        tool_force: (3,) force [N] that the surroundings exert on the arm's tip, body frame.
        tool_moment: (3,) moment [N m] that they exert on it, body frame.
        soil: Preset soil where the terrain's soil layer has none or there is no layer; None:
            Coulomb friction. docs/soil.md has the presets.
        backward: The rover drives backwards along the poses.

    Raises:
        PoseError: poses of wrong shape, or not finite.
        ModelError: an argument that makes no sense.
        SoilError: a soil of the terrain, or `soil`, that is not among the presets.
    """
    setup = set_up(
        rover,
        terrain,
        friction=friction,
        max_torque=max_torque,
        policy=policy,
        joint_angles=joint_angles,
        payload=payload,
        tool_force=tool_force,
        tool_moment=tool_moment,
        soil=soil,
        backward=backward,
    )
    return _sweep(rover, terrain, setup, [check_poses(poses)])[0]


def sweep_paths(
    rover: Rover, terrain: Terrain, paths: Sequence[ArrayLike], **arguments: Any
) -> list[PathPrediction]:
    """Predict the rover along several paths at once, which is faster than one after the other.

    Args:
        rover: The rover.
        terrain: The ground.
        paths: Poses of each path, as `sweep_path` takes them.
        arguments: Further arguments of `sweep_path`.

    Raises:
        PoseError, ModelError, SoilError: As `sweep_path`.
    """
    setup = set_up(rover, terrain, **arguments)
    return _sweep(rover, terrain, setup, [check_poses(poses) for poses in paths])


def _sweep(
    rover: Rover, terrain: Terrain, setup: Setup, paths: Sequence[np.ndarray]
) -> list[PathPrediction]:
    def evaluate_at(at: np.ndarray, held: np.ndarray = NONE_HELD) -> Any:
        with sweep_lock:
            return evaluate(*setup, at, held)

    if not paths:
        return []
    ends = np.cumsum([len(poses) for poses in paths])
    poses = np.concatenate(paths)
    joined = np.ones(len(poses) - 1, bool)
    joined[ends[:-1] - 1] = False
    radius, direction = rover.wheel.radius, float(setup.settings["direction"])
    with limit_threads(effort(setup.settings, len(poses))):  # told once, not for each round
        results = evaluate_at(poses)
        crossings = find_crossings(terrain, radius, poses, results, evaluate_at, direction, joined)
    predictions = []
    for first, end in zip([0, *ends[:-1]], ends, strict=True):
        part = crossings.between(first, end) if len(paths) > 1 else crossings
        predictions.append(
            _predict(setup.settings, radius, poses[first:end], results[first:end], part)
        )
    return predictions


def _predict(
    settings: Any, radius: float, poses: np.ndarray, results: np.ndarray, crossings: Crossings
) -> PathPrediction:
    """Return what results and crossings of one path say of it."""
    falls = find_falls(radius, poses, results, crossings, float(settings["direction"]))
    between = _collect(
        crossings.poses,
        crossings.results,
        settings,
        wheel_drop=np.zeros((len(crossings.poses), 6)),
        falling=falls.between,
        between=None,
        waypoint=crossings.waypoint,
    )
    return _collect(
        poses,
        results,
        settings,
        wheel_drop=falls.drops,
        falling=falls.at_waypoints,
        between=between,
        waypoint=np.arange(len(poses)),
    )


def check_poses(poses: ArrayLike) -> np.ndarray:
    """Return poses as float array (n, 3).

    Raises:
        PoseError: Wrong shape or type, no pose, or values that are not finite.
    """
    try:
        array = np.ascontiguousarray(poses, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise PoseError(f"poses are not numbers: {error}") from error
    if array.ndim != 2 or array.shape[1] != 3 or not len(array):
        raise PoseError(f"poses have shape {array.shape}; it must be (n, 3): x, y, yaw, n >= 1")
    finite = np.isfinite(array)
    if not finite.all():
        row, column = np.argwhere(~finite)[0]
        name, value = ["x", "y", "yaw"][column], array[row, column]
        raise PoseError(f"{name} of pose {row} is {value}; poses must be finite")
    return array


def _collect(poses: np.ndarray, results: np.ndarray, settings: Any, **more: Any) -> PathPrediction:
    same: dict[str, Any] = {name: results[name] for name in RESULT.names or () if name != "q"}
    q, settled = results["q"], results["status"] == SETTLED
    position = np.empty((len(poses), 3))
    position[:, :2], position[:, 2] = poses[:, :2], q[:, 0]
    position[~settled] = np.nan
    sums = np.empty((3, len(poses)))
    add_up(poses, results, settings["speed"], sums)
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
        **same,
        **more,
    )
