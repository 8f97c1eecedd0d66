"""Predictions and verdicts of single poses that form no path, each with a curvature."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.bounds.path import SIGMAS, bound_path, check_sigmas
from rover_physics.numerics.interruption import check_interruption
from rover_physics.numerics.quiet import quiet
from rover_physics.prediction.packed_model import PackedModel
from rover_physics.prediction.path_motion import check_curvature
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.prediction.sweep import check_poses, predict_poses, sweep_poses
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.bounded_verdict import judge_bounds
from rover_physics.traversability.judge_path import weigh_margin
from rover_physics.traversability.long_path import Take
from rover_physics.traversability.verdict import Verdict, judge, with_refusals, worst_of

PART = 8192
"""Number of poses that are predicted at a time by `judge_many_poses`."""


@quiet
def judge_poses(
    rover: Rover,
    terrain: Terrain,
    poses: ArrayLike,
    curvature: ArrayLike,
    options: SweepOptions = DEFAULT_OPTIONS,
    *,
    sigmas: float | None = SIGMAS,
) -> tuple[PathPrediction, Verdict]:
    """Predict and judge single poses; what would lie between them is not looked at.

    Crossings, falls, drops and entrapment are left out, as the poses form no path.

    Args:
        rover: The rover.
        terrain: The ground.
        poses: (n, 3) x, y [m] and yaw [rad] of base_link, map frame.
        curvature: (n,) as for `sweep_poses`.
        options: As for `sweep_path`.
        sigmas: As for `judge_path`.

    Raises:
        PoseError: Poses or curvatures of wrong shape, or not numbers.
        ModelError, SoilError: As `judge_path`.
    """
    prediction, verdict = _judge(rover, terrain, poses, curvature, options, sigmas)
    if options.kept_margin == 0.0 or verdict.traversable:
        return prediction, verdict

    def judge_others(rows: Sequence[int], others: SweepOptions) -> list[Verdict]:
        return [_judge(rover, terrain, poses, curvature, others, sigmas)[1] for _ in rows]

    return prediction, weigh_margin([verdict], options, judge_others)[0]


def judge_many_poses(
    rover: Rover,
    terrain: Terrain,
    poses: ArrayLike,
    curvature: ArrayLike,
    options: SweepOptions = DEFAULT_OPTIONS,
    *,
    sigmas: float | None = SIGMAS,
    take: Take,
) -> Verdict:
    """Judge single poses as `judge_poses` does, without keeping the predictions.

    Args:
        rover: The rover.
        terrain: The ground.
        poses: (n, 3) as for `judge_poses`.
        curvature: (n,) as for `judge_poses`.
        options: As for `judge_poses`.
        sigmas: As for `judge_poses`.
        take: Called with the prediction of the first poses, then of the next ones, and so on.

    Raises:
        PoseError, ModelError, SoilError: As `judge_poses`.
    """
    places = check_poses(poses)
    bends = check_curvature(curvature, len(places))
    codes: list[str] = []
    reasons: list[str] = []
    worst: Verdict | None = None
    for first in range(0, len(places), PART):
        check_interruption()
        part = slice(first, first + PART)
        prediction, verdict = judge_poses(
            rover, terrain, places[part], bends[part], options, sigmas=sigmas
        )
        codes += verdict.codes
        reasons += verdict.reasons
        worst = verdict if worst is None else worst_of(worst, verdict)
        take(prediction)
    assert worst is not None
    return with_refusals(worst, codes, reasons)


def judge_results(
    rover: Rover, model: PackedModel, poses: np.ndarray, results: Any
) -> tuple[str, ...]:
    """Return the codes (n,) of single poses (n, 3) from their RESULTs, "" where none fails."""
    return judge(rover, predict_poses(model, poses, results)).codes if len(poses) else ()


def _judge(
    rover: Rover,
    terrain: Terrain,
    poses: ArrayLike,
    curvature: ArrayLike,
    options: SweepOptions,
    sigmas: float | None,
) -> tuple[PathPrediction, Verdict]:
    """Judge single poses under the policy of the options."""
    check_sigmas(sigmas)
    prediction = sweep_poses(rover, terrain, poses, curvature, options)
    verdict = judge(rover, prediction)
    bounds = bound_path(rover, terrain, prediction, options, sigmas)
    if bounds is not None:
        verdict = judge_bounds(rover, prediction, bounds, verdict)
        prediction = replace(prediction, bounds=bounds)
    return prediction, verdict
