# SPDX-License-Identifier: Apache-2.0
"""The main calls of the package: paths or poses in, predictions and verdicts out."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.bounds.path import SIGMAS, bound_path, check_sigmas
from rover_physics.chance.failure_chance import check_accepted_chance, find_failure_chance
from rover_physics.names import EQUAL
from rover_physics.numerics.interruption import check_interruption
from rover_physics.numerics.quiet import quiet
from rover_physics.prediction.packed_model import PackedModel, pack_model
from rover_physics.prediction.path_kernels import NO_CROSSINGS
from rover_physics.prediction.path_motion import motions_of
from rover_physics.prediction.sweep import SweptPath, check_poses, predict_paths, predict_poses
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.bounded_verdict import refuse_worst_case
from rover_physics.traversability.entrapment import course_of, refuse_if_trapped
from rover_physics.traversability.verdict import (
    Verdict,
    hold_against_limits,
    refuse_chance,
    with_refusals,
)


def judge_path(
    rover: Rover,
    terrain: Terrain,
    poses: ArrayLike,
    options: SweepOptions = DEFAULT_OPTIONS,
    *,
    sigmas: float | None = SIGMAS,
    stop_at_failure: bool = False,
    accepted_chance: float | None = None,
) -> tuple[PathPrediction, Verdict]:
    """Predict a path and judge it, including entrapment.

    If the terrain has a layer `elevation_std`, the prediction has bounds, and the verdict also
    refuses waypoints that break a limit in the worst case within them. The layer adds refusals and
    removes none.

    With a control margin, policy "optimal" also refuses poses that leave less than that of
    friction or torque, except those that are passable with equal torques.

    Args:
        rover: The rover.
        terrain: The ground; its friction and soil layers override the options.
        poses: (n, 3) waypoints, x, y [m] and yaw [rad] of base_link, map frame, n >= 1.
        options: Torque policy, friction, soil, arm and direction.
        sigmas: Number of standard deviations by which the map's heights may be wrong; 0 or None
            takes the map as exact.
        stop_at_failure: Whether to leave out the waypoints beyond the first failure (default: all
            waypoints are predicted and judged). It saves their time and changes neither whether
            the path is traversable nor code, reason and waypoint of the first failure.
        accepted_chance: Largest chance of failure, 0 to 1, of a path that is traversable; the
            verdict then has the chance, except of a path that stopped at its first failure
            (docs/uncertainty.md); with `stop_at_failure`, one above the accepted chance may be
            larger than told. None does not ask for it.

    Returns:
        The prediction, and the verdict on it. With `stop_at_failure`, both end at the first
        failure or at a waypoint beyond it, and only the first refusal is sure to be the same as
        without.

    Raises:
        PoseError: Poses of wrong shape, or not finite.
        ModelError: An option that this rover cannot have, `sigmas` below 0, or `accepted_chance`
            outside 0 to 1.
        SoilError: A soil that is not a preset.
    """
    return judge_paths(
        rover,
        terrain,
        [poses],
        options,
        sigmas=sigmas,
        stop_at_failure=stop_at_failure,
        accepted_chance=accepted_chance,
    )[0]


@quiet
def judge_paths(
    rover: Rover,
    terrain: Terrain,
    paths: Sequence[ArrayLike],
    options: SweepOptions = DEFAULT_OPTIONS,
    *,
    sigmas: float | None = SIGMAS,
    stop_at_failure: bool = False,
    check_entrapment: bool = True,
    accepted_chance: float | None = None,
) -> list[tuple[PathPrediction, Verdict]]:
    """Judge several paths at once, faster than one by one.

    Args:
        rover: The rover.
        terrain: The ground.
        paths: Poses of each path, (n, 3) x, y [m] and yaw [rad], map frame.
        options: As for `judge_path`.
        sigmas: As for `judge_path`.
        stop_at_failure: As for `judge_path`.
        check_entrapment: False where pieces of a longer path are judged, and the whole of it
            later.
        accepted_chance: As for `judge_path`.

    Returns:
        Prediction and verdict of each path, as of `judge_path`.

    Raises:
        PoseError, ModelError, SoilError: As `judge_path`.
    """
    check_sigmas(sigmas)
    check_accepted_chance(accepted_chance)
    model = pack_model(rover, terrain, options)
    checked = [check_poses(poses) for poses in paths]
    judged = []
    for swept in predict_paths(model, checked, stop_at_failure):
        check_interruption()
        verdict = hold_against_limits(rover, swept.prediction)
        if check_entrapment and verdict.code != "wheel_drop":
            verdict = refuse_if_trapped(model, course_of(model, swept), verdict)
        prediction, verdict = add_bounds(model, swept.prediction, verdict, sigmas)
        if accepted_chance is not None and (verdict.traversable or not stop_at_failure):
            enough = accepted_chance if stop_at_failure else 1.0
            chance = find_failure_chance(model, swept, enough=enough)
            verdict = refuse_chance(verdict, chance, accepted_chance)
        judged.append((prediction, verdict))
    return judged


@quiet
def judge_poses(
    rover: Rover,
    terrain: Terrain,
    poses: ArrayLike,
    curvature: ArrayLike | None = None,
    options: SweepOptions = DEFAULT_OPTIONS,
    *,
    sigmas: float | None = SIGMAS,
    accepted_chance: float | None = None,
) -> tuple[PathPrediction, Verdict]:
    """Predict and judge single poses that form no path; what lies between them is not looked at.

    Crossings, falls, drops and entrapment are left out. Time, energy and distance are 0 where the
    rover settled.

    Args:
        rover: The rover.
        terrain: The ground.
        poses: (n, 3) x, y [m] and yaw [rad] of base_link, map frame, n >= 1.
        curvature: (n,) curvature of the motion of base_link at each pose [1/m], positive to the
            left, 0 straight ahead, inf or -inf on the spot. None: straight ahead.
        options: As for `judge_path`.
        sigmas: As for `judge_path`.
        accepted_chance: As for `judge_path`; the chance that any of the poses fails.

    Returns:
        The prediction, and the verdict on all poses.

    Raises:
        PoseError: Poses or curvatures of wrong shape, or not numbers.
        ModelError, SoilError: As `judge_path`.
    """
    check_sigmas(sigmas)
    check_accepted_chance(accepted_chance)
    model, places = pack_model(rover, terrain, options), check_poses(poses)
    bends = np.zeros(len(places)) if curvature is None else curvature
    prediction, verdict = _judge_in_motion(model, places, motions_of(model, places, bends), sigmas)
    if accepted_chance is not None:
        swept = SweptPath(places, prediction, NO_CROSSINGS)
        chance = find_failure_chance(model, swept, on_path=False)
        verdict = refuse_chance(verdict, chance, accepted_chance)
    return prediction, verdict


def _judge_in_motion(
    model: PackedModel, places: np.ndarray, motions: np.ndarray, sigmas: float | None
) -> tuple[PathPrediction, Verdict]:
    """Judge single poses (n, 3) with motions (n, 3) as of `path_motions`."""
    prediction = predict_poses(model, places, motions)
    return add_bounds(model, prediction, hold_against_limits(model.rover, prediction), sigmas)


def add_bounds(
    model: PackedModel, prediction: PathPrediction, verdict: Verdict, sigmas: float | None
) -> tuple[PathPrediction, Verdict]:
    """Return a prediction with its bounds and the verdict with their refusals.

    On a map with exact heights both stay as they are.
    """
    bounds = bound_path(model.rover, model.terrain, prediction, model.options, sigmas)
    if bounds is None:
        return prediction, verdict
    worst = refuse_worst_case(model.rover, prediction, bounds, verdict)
    if model.options.kept_margin > 0.0:
        worst = _pass_with_equal_torques(model, prediction, verdict, worst)
    return replace(prediction, bounds=bounds), worst


def _pass_with_equal_torques(
    model: PackedModel, prediction: PathPrediction, verdict: Verdict, worst: Verdict
) -> Verdict:
    """Return the worst case without refusals of waypoints that equal torques pass in theirs.

    `verdict` is the one without bounds, of which all refusals stay.
    """
    codes, reasons = list(worst.codes), list(worst.reasons)
    rows = [i for i, code in enumerate(codes) if code and not verdict.codes[i]]
    if not rows:
        return worst
    places, motions = prediction.poses[rows], np.ascontiguousarray(prediction.motion[rows])
    _, other = _judge_in_motion(model.change(policy=EQUAL), places, motions, worst.map_sigmas)
    for i, code in zip(rows, other.codes, strict=True):
        if not code:
            codes[i] = reasons[i] = ""
    return with_refusals(worst, codes, reasons)
