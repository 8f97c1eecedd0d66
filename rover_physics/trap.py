"""Trapped? A path is refused where the rover can go in, but neither on nor back.

Forces at rest are the same both ways; what differs is edges, off which a wheel drops and which it
has to climb on the way back. The way back is the path driven backwards from where it ends, or
fails, to before the last drop; the way on is straight ahead for LOOK_AHEAD wheelbases.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.limits import Verdict, judge
from rover_physics.prediction import PathPrediction
from rover_physics.rover import Rover
from rover_physics.sweep import sweep_path
from rover_physics.terrain import Terrain
from rover_physics.uncertainty import SIGMAS, bound_path, check_sigmas, judge_bounds

LOOK_AHEAD = 1.5
"""Wheelbases that the way on is looked at beyond the end of a path."""
DROP = 0.1
"""Drop, in wheel radii, from which on the way back is asked for."""
RUN_UP = 1.0
"""Wheelbases before the drop to which the way back has to lead."""


def judge_path(
    rover: Rover,
    terrain: Terrain,
    poses: ArrayLike,
    *,
    sigmas: float | None = SIGMAS,
    **arguments: Any,
) -> tuple[PathPrediction, Verdict]:
    """Predict a path and judge it, with the question whether the rover would be trapped on it.

    On a terrain with a layer `elevation_std` the prediction has bounds, and the verdict also
    refuses what the heights of the map make possible. It passes nothing that it would refuse
    without the layer.

    Args:
        rover: The rover.
        terrain: The ground.
        poses: (n, 3) waypoints, x, y [m] and yaw [rad].
        sigmas: Standard deviations of the map to allow for; 0 or None takes it as exact.
        **arguments: Those of `sweep_path`.

    Raises:
        PoseError: poses of wrong shape, or not finite.
        ModelError: an argument that makes no sense.
    """
    check_sigmas(sigmas)
    prediction, verdict = _judge_as_mapped(rover, terrain, poses, arguments)
    bounds = bound_path(rover, terrain, prediction, sigmas, **arguments)
    if bounds is None:
        return prediction, verdict
    verdict = judge_bounds(rover, prediction, bounds, verdict)
    return replace(prediction, bounds=bounds), verdict


def _judge_as_mapped(
    rover: Rover, terrain: Terrain, poses: ArrayLike, arguments: dict[str, Any]
) -> tuple[PathPrediction, Verdict]:
    """Predict and judge a path on the heights of the map as they are."""
    prediction = sweep_path(rover, terrain, poses, **arguments)
    verdict = judge(rover, prediction)
    drop = _find_last_drop(rover, prediction, verdict)
    if drop < 0 or verdict.code == "wheel_drop":
        return prediction, verdict
    on = verdict.reason or _find_way_on(rover, terrain, prediction, arguments)
    if not on:
        return prediction, verdict
    back = _find_way_back(rover, terrain, prediction, verdict, drop, arguments)
    if not back:
        return prediction, verdict
    what = f"trapped: a wheel drops {prediction.wheel_drop[drop].max():.3f} m"
    return prediction, _refuse(verdict, drop, what, on, back)


def _find_last_drop(rover: Rover, prediction: PathPrediction, verdict: Verdict) -> int:
    """Return the last waypoint before the end or failure to which a wheel drops, -1 if none."""
    end = len(prediction.poses) if verdict.first_failure < 0 else verdict.first_failure
    dropped = prediction.wheel_drop[:end].max(axis=1, initial=0.0) > DROP * rover.wheel.radius
    places = np.flatnonzero(dropped)
    return int(places[-1]) if len(places) else -1


def _wheelbase(rover: Rover) -> float:
    wheels = rover.suspension.wheels
    return wheels["front"][0] - wheels["rear"][0]


def _find_way_on(rover: Rover, terrain: Terrain, prediction: PathPrediction, arguments) -> str:
    """Return why the rover can't go on straight ahead from the end, empty if it can."""
    x, y, yaw = prediction.poses[-1]
    spacing = _spacing(prediction)
    ahead = np.arange(0.0, LOOK_AHEAD * _wheelbase(rover) + spacing, spacing)
    poses = np.column_stack(
        [x + ahead * np.cos(yaw), y + ahead * np.sin(yaw), np.full(len(ahead), yaw)]
    )
    return judge(rover, sweep_path(rover, terrain, poses, **arguments)).reason


def _find_way_back(
    rover: Rover,
    terrain: Terrain,
    prediction: PathPrediction,
    verdict: Verdict,
    drop: int,
    arguments,
) -> str:
    """Return why the rover can't drive back to before the drop, empty if it can."""
    end = len(prediction.poses) if verdict.first_failure < 0 else verdict.first_failure
    run_up = prediction.distance[drop] - RUN_UP * _wheelbase(rover)
    first = int(np.searchsorted(prediction.distance, max(run_up, 0.0)))
    back = prediction.poses[first:end][::-1]
    return judge(rover, sweep_path(rover, terrain, back, backward=True, **arguments)).reason


def _spacing(prediction: PathPrediction) -> float:
    steps = np.diff(prediction.distance)
    steps = steps[steps > 0.0]
    return float(np.median(steps)) if steps.size else 0.02


def _refuse(verdict: Verdict, drop: int, what: str, on: str, back: str) -> Verdict:
    reason = f"{what}; no way on: {on}; no way back: {back}"
    codes, reasons = list(verdict.codes), list(verdict.reasons)
    codes[drop], reasons[drop] = "trapped", reason
    return replace(
        verdict,
        traversable=False,
        codes=tuple(codes),
        reasons=tuple(reasons),
        first_failure=drop,
        code="trapped",
        reason=reason,
    )
