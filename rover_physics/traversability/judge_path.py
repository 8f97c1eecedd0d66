"""The main question: a path in, what the rover would do on it and the verdict out."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from numpy.typing import ArrayLike

from rover_physics.bounds.path import SIGMAS, bound_path, check_sigmas
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.prediction.sweep import sweep_paths
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.bounded_verdict import judge_bounds
from rover_physics.traversability.entrapment import ask_for_ways_out
from rover_physics.traversability.verdict import Verdict, judge


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
        SoilError: a soil that is not among the presets.
    """
    return judge_paths(rover, terrain, [poses], sigmas=sigmas, **arguments)[0]


def judge_paths(
    rover: Rover,
    terrain: Terrain,
    paths: Sequence[ArrayLike],
    *,
    sigmas: float | None = SIGMAS,
    **arguments: Any,
) -> list[tuple[PathPrediction, Verdict]]:
    """Judge several paths at once, which is faster than one after the other; see `judge_path`."""
    check_sigmas(sigmas)
    judged = []
    for prediction in sweep_paths(rover, terrain, paths, **arguments):
        verdict = judge(rover, prediction)
        if verdict.code != "wheel_drop":
            verdict = ask_for_ways_out(rover, terrain, prediction, verdict, arguments)
        bounds = bound_path(rover, terrain, prediction, sigmas, **arguments)
        if bounds is not None:
            verdict = judge_bounds(rover, prediction, bounds, verdict)
            prediction = replace(prediction, bounds=bounds)
        judged.append((prediction, verdict))
    return judged
