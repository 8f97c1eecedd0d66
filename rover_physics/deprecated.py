# SPDX-License-Identifier: Apache-2.0
"""Names of version 0.1 that work for one more version, with a warning."""

import warnings
from collections.abc import Sequence

from numpy.typing import ArrayLike

from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_paths, judge_poses


def sweep_path(
    rover: Rover, terrain: Terrain, poses: ArrayLike, options: SweepOptions = DEFAULT_OPTIONS
) -> PathPrediction:
    """Return the prediction of `judge_path` on an exact map."""
    _warn("sweep_path", "judge_path")
    return _sweep(rover, terrain, [poses], options)[0]


def sweep_paths(
    rover: Rover,
    terrain: Terrain,
    paths: Sequence[ArrayLike],
    options: SweepOptions = DEFAULT_OPTIONS,
) -> list[PathPrediction]:
    """Return the predictions of `judge_paths` on an exact map."""
    _warn("sweep_paths", "judge_paths")
    return _sweep(rover, terrain, paths, options)


def sweep_poses(
    rover: Rover,
    terrain: Terrain,
    poses: ArrayLike,
    curvature: ArrayLike,
    options: SweepOptions = DEFAULT_OPTIONS,
) -> PathPrediction:
    """Return the prediction of `judge_poses` on an exact map."""
    _warn("sweep_poses", "judge_poses")
    return judge_poses(rover, terrain, poses, curvature, options, sigmas=0)[0]


def _sweep(
    rover: Rover, terrain: Terrain, paths: Sequence[ArrayLike], options: SweepOptions
) -> list[PathPrediction]:
    judged = judge_paths(rover, terrain, paths, options, sigmas=0, check_entrapment=False)
    return [prediction for prediction, _ in judged]


def _warn(old: str, new: str) -> None:
    text = f"{old} goes with the next version; {new} returns the prediction and the verdict"
    warnings.warn(text, DeprecationWarning, stacklevel=3)
