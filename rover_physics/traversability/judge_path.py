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
from rover_physics.traversability.entrapment import ask_for_ways_out, course_of
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
    ask_ways_out: bool = True,
) -> list[tuple[PathPrediction, Verdict]]:
    """Judge several paths at once, faster than one by one; see `judge_path`.

    Without `ask_ways_out`, entrapment is not looked for: pieces of a longer path are judged, and
    the whole of it later.
    """
    check_sigmas(sigmas)
    judge_with = partial(_judge_under_policy, rover, terrain, (sigmas, ask_ways_out))
    judged = judge_with(paths, options, stop_at_failure)
    refused = [k for k, (_, verdict) in enumerate(judged) if not verdict.traversable]
    if options.kept_margin == 0.0 or not refused:
        return judged
    if stop_at_failure:
        for k in refused:
            judged[k] = _weigh_first_failure(paths[k], judged[k], options, judge_with)
        return judged

    def judge_others(rows: Sequence[int], others: SweepOptions) -> list[Verdict]:
        return [found for _, found in judge_with([paths[refused[k]] for k in rows], others, False)]

    weighed = weigh_margin([judged[k][1] for k in refused], options, judge_others)
    for k, verdict in zip(refused, weighed, strict=True):
        judged[k] = judged[k][0], verdict
    return judged


def weigh_margin(
    verdicts: Sequence[Verdict],
    options: SweepOptions,
    judge_others: Callable[[Sequence[int], SweepOptions], list[Verdict]],
) -> list[Verdict]:
    """Return verdicts without refusals of what equal torques pass, and name the margin.

    A waypoint that breaks its limits only less the margin may be refused as a lifting wheel,
    because no torques were found; the reason is the margin nevertheless.

    Args:
        verdicts: The verdicts on refused paths.
        options: The options they were judged with.
        judge_others: Judges some of the paths, by their indices, with other options.
    """
    equal = judge_others(range(len(verdicts)), replace(options, policy=EQUAL))
    weighed = [forgive(one, other) for one, other in zip(verdicts, equal, strict=True)]
    named = {"", *MARGIN_CODES}
    unnamed = [k for k, verdict in enumerate(weighed) if not set(verdict.codes) <= named]
    physical = judge_others(unnamed, replace(options, control_margin=0.0)) if unnamed else []
    for k, other in zip(unnamed, physical, strict=True):
        weighed[k] = name_margin(weighed[k], other, options.control_margin)
    return weighed


def _weigh_first_failure(
    path: ArrayLike, judged: Judged, options: SweepOptions, judge_with: Judge
) -> Judged:
    """Return a refused path as `weigh_margin` would, from verdicts that end at the first failure.

    They suffice if the path fails at the same waypoint with equal torques and, unless the reason
    names the margin already, not before it without margin. Else the path is judged in full.
    """
    prediction, verdict = judged
    at, kept = verdict.first_failure, options.control_margin
    equal = judge_with([path], replace(options, policy=EQUAL), True)[0][1]
    if equal.first_failure == at:
        if verdict.code in MARGIN_CODES:
            return judged
        physical = judge_with([path], replace(options, control_margin=0.0), True)[0][1]
        if physical.first_failure == at:
            return judged
        if not 0 <= physical.first_failure < at:
            return prediction, name_margin_at(verdict, [at], kept)
    return _judge_and_weigh(path, options, judge_with)


def _judge_and_weigh(path: ArrayLike, options: SweepOptions, judge_with: Judge) -> Judged:
    """Judge one path in full and weigh its margin."""
    prediction, verdict = judge_with([path], options, False)[0]
    if verdict.traversable:
        return prediction, verdict

    def judge_others(rows: Sequence[int], others: SweepOptions) -> list[Verdict]:
        return [judge_with([path], others, False)[0][1] for _ in rows]

    return prediction, weigh_margin([verdict], options, judge_others)[0]


def _judge_under_policy(
    rover: Rover,
    terrain: Terrain,
    extent: tuple[float | None, bool],
    paths: Sequence[ArrayLike],
    options: SweepOptions,
    stop_at_failure: bool,
) -> list[Judged]:
    """Judge several paths under the policy of the options.

    `extent` is `sigmas` and `ask_ways_out` of `judge_paths`.
    """
    sigmas, ask_ways_out = extent
    if stop_at_failure:
        swept_paths = sweep_until_failure(rover, terrain, paths, options)
    else:
        in_full = sweep_in_full(rover, terrain, paths, options)
        swept_paths = [(swept, judge(rover, swept.prediction)) for swept in in_full]
    judged = []
    for swept, verdict in swept_paths:
        check_interruption()
        if ask_ways_out and verdict.code != "wheel_drop":
            course = course_of(rover, terrain, swept, options)
            verdict = ask_for_ways_out(rover, terrain, course, verdict, options)
        prediction = swept.prediction
        bounds = bound_path(rover, terrain, prediction, options, sigmas)
        if bounds is not None:
            verdict = judge_bounds(rover, prediction, bounds, verdict)
            prediction = replace(prediction, bounds=bounds)
        judged.append((prediction, verdict))
    return judged
