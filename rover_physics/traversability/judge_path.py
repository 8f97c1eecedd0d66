"""The main question: a path in, what the rover would do on it and the verdict out."""

from collections.abc import Sequence
from dataclasses import replace

from numpy.typing import ArrayLike

from rover_physics.bounds.path import SIGMAS, bound_path, check_sigmas
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.prediction.sweep import sweep_paths
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.bounded_verdict import judge_bounds
from rover_physics.traversability.entrapment import ask_for_ways_out
from rover_physics.traversability.verdict import Verdict, judge


def judge_path(
    rover: Rover,
    terrain: Terrain,
    poses: ArrayLike,
    options: SweepOptions = DEFAULT_OPTIONS,
    *,
    sigmas: float | None = SIGMAS,
) -> tuple[PathPrediction, Verdict]:
    """Predict a path and judge it, entrapment included.

    On a terrain with a layer `elevation_std` the prediction has bounds, and the verdict also
    refuses what the heights of the map make possible. It passes nothing that it would refuse
    without the layer.

    Args:
        rover: The rover.
        terrain: The ground.
        poses: (n, 3) waypoints, x, y [m] and yaw [rad] of base_link, map frame.
        options: As for `sweep_path`.
        sigmas: Standard deviations of the map to allow for; 0 or None takes it as exact.

    Returns:
        The prediction, and the verdict on it.

    Raises:
        PoseError: Poses of wrong shape, or not finite.
        ModelError: An option that this rover cannot have, or `sigmas` below 0.
        SoilError: A soil that is not among the presets.
    """
    return judge_paths(rover, terrain, [poses], options, sigmas=sigmas)[0]


def judge_paths(
    rover: Rover,
    terrain: Terrain,
    paths: Sequence[ArrayLike],
    options: SweepOptions = DEFAULT_OPTIONS,
    *,
    sigmas: float | None = SIGMAS,
) -> list[tuple[PathPrediction, Verdict]]:
    """Judge several paths at once, which is faster than one after the other; see `judge_path`."""
    check_sigmas(sigmas)
    judged = []
    for prediction in sweep_paths(rover, terrain, paths, options):
        verdict = judge(rover, prediction)
        if verdict.code != "wheel_drop":
            verdict = ask_for_ways_out(rover, terrain, prediction, verdict, options)
        bounds = bound_path(rover, terrain, prediction, options, sigmas)
        if bounds is not None:
            verdict = judge_bounds(rover, prediction, bounds, verdict)
            prediction = replace(prediction, bounds=bounds)
        judged.append((prediction, verdict))
    return judged
