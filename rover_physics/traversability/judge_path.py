"""The main call of the package: a path in, the prediction and the verdict out."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from numpy.typing import ArrayLike

from rover_physics.bounds.path import SIGMAS, bound_path, check_sigmas
from rover_physics.names import EQUAL
from rover_physics.numerics.interruption import check_interruption
from rover_physics.numerics.quiet import quiet
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.prediction.sweep import sweep_in_full
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.bounded_verdict import judge_bounds
from rover_physics.traversability.entrapment import ask_for_ways_out
from rover_physics.traversability.first_failure import sweep_until_failure
from rover_physics.traversability.verdict import (
    MARGIN_CODES,
    Verdict,
    forgive,
    judge,
    name_margin,
    name_margin_at,
)

Judged = tuple[PathPrediction, Verdict]
"""A prediction and the verdict on it."""
Judge = Callable[[Sequence[ArrayLike], SweepOptions, bool], list[Judged]]
"""Function that judges paths with options; the last argument is `stop_at_failure`."""


def judge_path(
    rover: Rover,
    terrain: Terrain,
    poses: ArrayLike,
    options: SweepOptions = DEFAULT_OPTIONS,
    *,
    sigmas: float | None = SIGMAS,
    stop_at_failure: bool = False,
) -> tuple[PathPrediction, Verdict]:
    """Predict a path and judge it, including entrapment.

    If the terrain has a layer `elevation_std`, the prediction has bounds, and the verdict also
    refuses waypoints that break a limit in the worst case within them. The layer adds refusals and
    removes none.

    With a control margin, policy "optimal" also refuses waypoints that leave less than that of
    friction or torque, except those that are passable with equal torques.

    Args:
        rover: The rover.
        terrain: The ground.
        poses: (n, 3) waypoints, x, y [m] and yaw [rad] of base_link, map frame.
        options: As for `sweep_path`.
        sigmas: Number of standard deviations by which the map's heights may be wrong; 0 or None
            takes the map as exact.
        stop_at_failure: Whether to leave out the waypoints beyond the first failure (default: all
            waypoints are predicted and judged). It saves their time and changes neither whether
            the path is traversable nor code, reason and waypoint of the first failure.

    Returns:
        The prediction, and the verdict on it. With `stop_at_failure`, both end at the first
        failure or at a waypoint beyond it, and only the first refusal is sure to be the same as
        without.

    Raises:
        PoseError: Poses of wrong shape, or not finite.
        ModelError: An option that this rover cannot have, or `sigmas` below 0.
        SoilError: A soil that is not a preset.
    """
    return judge_paths(
        rover, terrain, [poses], options, sigmas=sigmas, stop_at_failure=stop_at_failure
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
) -> list[tuple[PathPrediction, Verdict]]:
    """Judge several paths at once, faster than one by one; see `judge_path`."""
    check_sigmas(sigmas)
    judge_with = partial(_judge_under_policy, rover, terrain, sigmas)
    judged = judge_with(paths, options, stop_at_failure)
    refused = [k for k, (_, verdict) in enumerate(judged) if not verdict.traversable]
    if options.kept_margin == 0.0 or not refused:
        return judged
    weigh = _weigh_first_failures if stop_at_failure else _weigh_margin
    weighed = weigh([paths[k] for k in refused], [judged[k] for k in refused], options, judge_with)
    for k, one in zip(refused, weighed, strict=True):
        judged[k] = one
    return judged


def _weigh_margin(
    paths: Sequence[ArrayLike], judged: Sequence[Judged], options: SweepOptions, judge_with: Judge
) -> list[Judged]:
    """Return refused paths without refusals of what equal torques pass, and name the margin.

    A waypoint that breaks its limits only less the margin may be refused as a lifting wheel,
    because no torques were found; the reason is the margin nevertheless.
    """
    equal = judge_with(paths, replace(options, policy=EQUAL), False)
    weighed = [
        (prediction, forgive(verdict, other))
        for (prediction, verdict), (_, other) in zip(judged, equal, strict=True)
    ]
    named = {"", *MARGIN_CODES}
    unnamed = [k for k, (_, verdict) in enumerate(weighed) if not set(verdict.codes) <= named]
    without = replace(options, control_margin=0.0)
    physical = judge_with([paths[k] for k in unnamed], without, False)
    for k, (_, other) in zip(unnamed, physical, strict=True):
        prediction, verdict = weighed[k]
        weighed[k] = prediction, name_margin(verdict, other, options.control_margin)
    return weighed


def _weigh_first_failures(
    paths: Sequence[ArrayLike], judged: Sequence[Judged], options: SweepOptions, judge_with: Judge
) -> list[Judged]:
    """Return refused paths as `_weigh_margin`, judged in full only where that is needed."""
    equal = judge_with(paths, replace(options, policy=EQUAL), True)
    weighed = []
    for path, (prediction, verdict), (_, other) in zip(paths, judged, equal, strict=True):
        first = _weigh_first_failure(path, verdict, other, options, judge_with)
        if first is not None:
            weighed.append((prediction, first))
            continue
        full = judge_with([path], options, False)
        passes = full[0][1].traversable
        weighed += full if passes else _weigh_margin([path], full, options, judge_with)
    return weighed


def _weigh_first_failure(
    path: ArrayLike, verdict: Verdict, equal: Verdict, options: SweepOptions, judge_with: Judge
) -> Verdict | None:
    """Return the weighed verdict up to the first failure; None if the whole path is needed.

    It is not needed if the path fails at the same waypoint with equal torques and, unless the
    reason names the margin already, not before it without margin.
    """
    at = verdict.first_failure
    if equal.first_failure != at:
        return None
    if verdict.code in MARGIN_CODES:
        return verdict
    physical = judge_with([path], replace(options, control_margin=0.0), True)[0][1]
    if physical.first_failure == at:
        return verdict
    if 0 <= physical.first_failure < at:
        return None
    return name_margin_at(verdict, [at], options.control_margin)


def _judge_under_policy(
    rover: Rover,
    terrain: Terrain,
    sigmas: float | None,
    paths: Sequence[ArrayLike],
    options: SweepOptions,
    stop_at_failure: bool,
) -> list[Judged]:
    """Judge several paths under the policy of the options."""
    if stop_at_failure:
        swept_paths = sweep_until_failure(rover, terrain, paths, options)
    else:
        in_full = sweep_in_full(rover, terrain, paths, options)
        swept_paths = [(swept, judge(rover, swept.prediction)) for swept in in_full]
    judged = []
    for swept, verdict in swept_paths:
        check_interruption()
        if verdict.code != "wheel_drop":
            verdict = ask_for_ways_out(rover, terrain, swept, verdict, options)
        prediction = swept.prediction
        bounds = bound_path(rover, terrain, prediction, options, sigmas)
        if bounds is not None:
            verdict = judge_bounds(rover, prediction, bounds, verdict)
            prediction = replace(prediction, bounds=bounds)
        judged.append((prediction, verdict))
    return judged
